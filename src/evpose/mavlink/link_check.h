// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "evpose/core/time.h"
#include "evpose/mavlink/codec.h"

namespace evpose::mavlink {

/// Listens to a link and says what is on it: rates, gaps, frames, delay, whether covariances make sense, and
/// what the autopilot says. Bounded, whatever arrives.
class LinkCheck {
 public:
  /// `now_ns`: the machine's monotone clock, which delays are held against.
  void receive(Bytes bytes, TimeNs now_ns);

  struct Report {
    std::vector<std::string> lines;   ///< for people
    std::vector<std::string> faults;  ///< what an autopilot would stumble over
  };
  Report report() const;

 private:
  struct Stream {
    std::uint64_t frames = 0;
    TimeNs first = 0, last = 0, longest_gap = 0;
  };
  struct Sender {
    std::uint64_t frames = 0, missed = 0;
    std::uint8_t sequence = 0;
  };
  void handle(const Frame& frame, TimeNs now_ns);
  void take(const Odometry& m, TimeNs now_ns);
  void fault(const std::string& what);
  void say(std::string words);

  Parser parser_;
  std::map<std::pair<std::uint32_t, std::uint16_t>, Stream> streams_;  ///< by message and sender
  std::map<std::uint16_t, Sender> senders_;
  std::vector<float> delays_ms_;
  std::map<std::string, std::uint64_t> faults_;
  std::vector<std::string> said_;
  std::uint64_t odometry_ = 0, failed_ = 0, resets_ = 0, last_time_usec_ = 0;
  std::uint8_t reset_counter_ = 0, frame_id_ = 0, child_frame_id_ = 0;
  float largest_sigma_m_ = 0;
};

}  // namespace evpose::mavlink
