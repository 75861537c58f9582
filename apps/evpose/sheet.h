// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "evpose/core/error.h"

namespace evpose {

/// What `evpose info` tells: sections of named values, each once for people and once for programs, and
/// findings with what to do about them.
class Sheet {
 public:
  /// Rows that follow belong to it; `key` is its place in the JSON.
  void section(const std::string& title, const std::string& key);
  /// A row; with an empty key only for people, with an empty text only for programs.
  void row(const std::string& label, const std::string& text, const std::string& key,
           nlohmann::ordered_json value);
  void note(const std::string& label, const std::string& text) { row(label, text, "", nullptr); }
  void find(Error finding) { findings_.push_back(std::move(finding)); }

  bool has_findings() const { return !findings_.empty(); }
  std::string text() const;
  std::string json() const;

 private:
  struct Line {
    std::string label, text;
  };
  struct Section {
    std::string title;
    std::vector<Line> lines;
  };
  std::vector<Section> sections_;
  nlohmann::ordered_json json_ = nlohmann::ordered_json::object();
  std::string key_;
  std::vector<Error> findings_;
};

/// Height of each value as one of eight blocks; blank for zero.
std::string sparkline(const std::vector<double>& values);

/// A number with so many decimals.
std::string fixed(double value, int decimals);

}  // namespace evpose
