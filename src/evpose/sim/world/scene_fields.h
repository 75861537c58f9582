// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "evpose/core/pose.h"
#include "evpose/io/files/yaml_document.h"

namespace evpose::sim {

/// Reads the members of a YAML map and keeps the first error; values read after it are the defaults. `finish`
/// returns that error, or the first unknown member.
class SceneFields {
 public:
  /// `what` names the map in messages.
  SceneFields(const YamlDocument& document, const YamlNode& node, std::string what);

  struct Range {
    double low, high;
  };
  double number(const std::string& key, double otherwise, Range range);
  double needed_number(const std::string& key, Range range);
  bool boolean(const std::string& key, bool otherwise);
  std::string string(const std::string& key, const std::string& otherwise);
  std::string needed_string(const std::string& key);
  Eigen::Vector3d vector(const std::string& key, const Eigen::Vector3d& otherwise);
  Eigen::Vector3d needed_vector(const std::string& key);
  /// Each at least `least`, at most 1 km.
  Eigen::Vector3d needed_size(const std::string& key, double least);
  Eigen::Vector2d pair(const std::string& key, const Eigen::Vector2d& otherwise, Range range);
  std::vector<Eigen::Vector3d> points(const std::string& key, std::size_t least);
  /// `at` [x, y, z], and `yaw_deg` or `rpy_deg` (about x, then y, then z).
  Pose pose();
  /// A member of any kind, or nullptr.
  const YamlNode* member(const std::string& key);
  /// The one of the names that is present.
  std::string needed_one_of(const std::vector<std::string>& keys);

  void fail(const YamlNode& node, const std::string& what, const std::string& fix);
  bool failed() const { return error_.has_value(); }
  Status finish();
  const YamlNode& node() const { return node_; }

 private:
  const YamlNode* needed(const std::string& key);

  const YamlDocument& document_;
  const YamlNode& node_;
  std::string what_;
  std::vector<std::string> asked_;
  std::optional<Error> error_;
};

}  // namespace evpose::sim
