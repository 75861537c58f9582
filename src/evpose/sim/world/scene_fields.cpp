// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/scene_fields.h"

#include <algorithm>
#include <numbers>
#include <utility>

#include "evpose/core/config.h"

namespace evpose::sim {
namespace {

constexpr double kFarthest_m = 1e5;
constexpr double kRad = std::numbers::pi / 180;

}  // namespace

SceneFields::SceneFields(const YamlDocument& document, const YamlNode& node, std::string what)
    : document_(document), node_(node), what_(std::move(what)) {
  if (node.kind != YamlNode::Kind::map)
    fail(node, what_ + ": keys and values are expected", "write {key: value, ...}");
}

void SceneFields::fail(const YamlNode& node, const std::string& what, const std::string& fix) {
  if (!error_) error_ = document_.error(node, what, fix);
}

const YamlNode* SceneFields::member(const std::string& key) {
  asked_.push_back(key);
  return error_ ? nullptr : node_.find(key);
}

const YamlNode* SceneFields::needed(const std::string& key) {
  const YamlNode* found = member(key);
  if (found == nullptr) fail(node_, what_ + ": '" + key + "' is missing", "add it");
  return found;
}

double SceneFields::number(const std::string& key, double otherwise, Range range) {
  const YamlNode* found = member(key);
  if (found == nullptr) return otherwise;
  const auto value = document_.number(*found, key);
  if (!value) {
    error_ = value.error();
    return otherwise;
  }
  if (*value < range.low || *value > range.high) {
    fail(*found, text(key, ": ", *value, " is not between ", range.low, " and ", range.high), "correct it");
    return otherwise;
  }
  return *value;
}

double SceneFields::needed_number(const std::string& key, Range range) {
  return needed(key) == nullptr ? range.low : number(key, range.low, range);
}

bool SceneFields::boolean(const std::string& key, bool otherwise) {
  const YamlNode* found = member(key);
  if (found == nullptr) return otherwise;
  const auto value = document_.boolean(*found, key);
  if (value) return *value;
  error_ = value.error();
  return otherwise;
}

std::string SceneFields::string(const std::string& key, const std::string& otherwise) {
  const YamlNode* found = member(key);
  if (found == nullptr) return otherwise;
  auto value = document_.string(*found, key);
  if (value) return *std::move(value);
  error_ = value.error();
  return otherwise;
}

std::string SceneFields::needed_string(const std::string& key) {
  return needed(key) == nullptr ? std::string() : string(key, "");
}

Eigen::Vector3d SceneFields::vector(const std::string& key, const Eigen::Vector3d& otherwise) {
  const YamlNode* found = member(key);
  if (found == nullptr) return otherwise;
  const auto value = document_.numbers(*found, key, 3);
  if (!value) {
    error_ = value.error();
    return otherwise;
  }
  Eigen::Vector3d out((*value)[0], (*value)[1], (*value)[2]);
  if (out.cwiseAbs().maxCoeff() > kFarthest_m) fail(*found, key + ": farther than 100 km", "give metres");
  return out;
}

Eigen::Vector3d SceneFields::needed_vector(const std::string& key) {
  return needed(key) == nullptr ? Eigen::Vector3d(Eigen::Vector3d::Zero())
                                : vector(key, Eigen::Vector3d::Zero());
}

Eigen::Vector3d SceneFields::needed_size(const std::string& key, double least) {
  const YamlNode* found = needed(key);
  Eigen::Vector3d size =
      found == nullptr ? Eigen::Vector3d(Eigen::Vector3d::Ones()) : vector(key, Eigen::Vector3d::Ones());
  if (found != nullptr && (size.minCoeff() < least || size.maxCoeff() > 1000))
    fail(*found, text(key, ": each must be between ", least, " and 1000 m"), "correct it");
  return size;
}

Eigen::Vector2d SceneFields::pair(const std::string& key, const Eigen::Vector2d& otherwise, Range range) {
  const YamlNode* found = member(key);
  if (found == nullptr) return otherwise;
  const auto value = document_.numbers(*found, key, 2);
  if (!value) {
    error_ = value.error();
    return otherwise;
  }
  for (const double v : *value)
    if (v < range.low || v > range.high)
      fail(*found, text(key, ": ", v, " is not between ", range.low, " and ", range.high), "correct it");
  return {(*value)[0], (*value)[1]};
}

std::vector<Eigen::Vector3d> SceneFields::points(const std::string& key, std::size_t least) {
  std::vector<Eigen::Vector3d> out;
  const YamlNode* found = needed(key);
  if (found == nullptr) return out;
  if (found->kind != YamlNode::Kind::list || found->items.size() < least || found->items.size() > 500) {
    fail(*found, text(key, ": a list of ", least, " to 500 points is expected"), "write [[x, y, z], ...]");
    return out;
  }
  for (const YamlNode& item : found->items) {
    const auto value = document_.numbers(item, key, 3);
    if (!value) {
      error_ = value.error();
      return out;
    }
    out.emplace_back((*value)[0], (*value)[1], (*value)[2]);
    if (out.back().cwiseAbs().maxCoeff() > kFarthest_m)
      fail(item, key + ": farther than 100 km", "give metres");
  }
  for (std::size_t i = 0; i < out.size(); ++i)
    if ((out[i] - out[(i + 1) % out.size()]).norm() < 0.01)
      fail(*found, text(key, ": points ", i + 1, " and ", (i + 1) % out.size() + 1, " are the same"),
           "the path closes by itself; leave one out");
  return out;
}

Pose SceneFields::pose() {
  Pose T;
  T.p = vector("at", Eigen::Vector3d::Zero());
  const double yaw = number("yaw_deg", 0, {-3600, 3600});
  const Eigen::Vector3d rpy = vector("rpy_deg", Eigen::Vector3d(0, 0, yaw));
  T.q =
      so3::exp({0, 0, kRad * rpy.z()}) * so3::exp({0, kRad * rpy.y(), 0}) * so3::exp({kRad * rpy.x(), 0, 0});
  return T;
}

std::string SceneFields::needed_one_of(const std::vector<std::string>& keys) {
  std::string all;
  for (const std::string& key : keys) {
    all += (all.empty() ? "" : ", ") + key;
    if (!error_ && node_.find(key) != nullptr) return key;
  }
  fail(node_, what_ + ": none of " + all + " is there", "add one");
  return "";
}

Status SceneFields::finish() {
  if (error_) return *error_;
  for (const YamlNode::Member& m : node_.members) {
    if (std::find(asked_.begin(), asked_.end(), m.key) != asked_.end()) continue;
    const std::string nearest = nearest_word(m.key, asked_);
    return document_.error(m.value, what_ + ": '" + m.key + "' is unknown",
                           nearest.empty() ? "remove it" : "did you mean '" + nearest + "'?");
  }
  return {};
}

}  // namespace evpose::sim
