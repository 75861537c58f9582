// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "evpose/core/pose.h"
#include "evpose/tracker/update.h"

namespace evpose::experiments {

/// What the updates of one start say of its pose, beside the truth: rows of a CSV file, from which
/// PoseProbability is fitted and judged.
class StartLooks {
 public:
  static std::string header();

  struct Start {
    std::string recording, kind;
    unsigned seed;
  };
  StartLooks(Start start, TimeNs begin, const std::vector<TimedPose>& truth)
      : start_(std::move(start)), begin_(begin), truth_(&truth) {}

  /// Nothing while there is no pose, or too little was seen of it.
  void add(const Update& u);
  const std::string& rows() const { return rows_; }

 private:
  Start start_;
  TimeNs begin_;
  const std::vector<TimedPose>* truth_;
  std::string rows_;
};

}  // namespace evpose::experiments
