// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/core/pose.h"

namespace evpose {

/// A YAML value as plain data that knows its line.
struct YamlNode {
  enum class Kind { null, scalar, list, map };
  struct Member;

  Kind kind = Kind::null;
  int line = 1;
  std::string scalar;
  std::vector<YamlNode> items;  ///< of a list
  std::vector<Member> members;  ///< of a map, in the order of the file

  /// The member of a map, or nullptr.
  const YamlNode* find(const std::string& key) const;
};

struct YamlNode::Member {
  std::string key;
  YamlNode value;
};

/// One file and its first document. The functions that read a value name file, line and `key` in their
/// errors.
struct YamlDocument {
  std::string path;
  YamlNode root;

  /// Errors: the file cannot be read, is no YAML, has a key twice, or more than a million values.
  static Expected<YamlDocument> read(const std::string& path);

  Error error(const YamlNode& node, const std::string& what, const std::string& fix) const;
  Expected<std::string> string(const YamlNode& node, const std::string& key) const;
  Expected<double> number(const YamlNode& node, const std::string& key) const;  ///< finite
  Expected<std::int64_t> integer(const YamlNode& node, const std::string& key) const;
  Expected<bool> boolean(const YamlNode& node, const std::string& key) const;
  /// A list of `count` numbers, also nested (rows of a matrix) or as {rows, cols, data}; any count if `count`
  /// is 0.
  Expected<std::vector<double>> numbers(const YamlNode& node, const std::string& key,
                                        std::size_t count = 0) const;
  /// 4x4 or 3x4, in rows or flat; rigid to 1e-3.
  Expected<Pose> transform(const YamlNode& node, const std::string& key) const;
  /// The same from a rotation matrix and a translation; errors name `node`.
  Expected<Pose> rigid(const YamlNode& node, const std::string& key, const Eigen::Matrix3d& R,
                       const Eigen::Vector3d& p) const;
};

}  // namespace evpose
