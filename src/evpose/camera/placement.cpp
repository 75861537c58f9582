// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/camera/placement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "evpose/core/error.h"

namespace evpose {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kSteep_deg = 80;  // beyond, a heading means nothing

std::string offset_in_words(const Eigen::Vector3d& p) {
  constexpr std::array<std::pair<const char*, const char*>, 3> kSides = {
      {{"ahead", "behind"}, {"left", "right"}, {"above", "below"}}};
  std::string out;
  for (int k = 0; k < 3; ++k) {
    const double mm = 1e3 * p[k];
    if (std::abs(mm) < 0.5) continue;
    const auto& [plus, minus] = kSides[static_cast<std::size_t>(k)];
    out += text(out.empty() ? "" : ", ", std::round(std::abs(mm)), " mm ", mm > 0 ? plus : minus);
  }
  return out.empty() ? "at the body's origin" : out;
}

/// "forward", "left", "20 deg left of forward": where a direction points when seen from above.
std::string heading_in_words(double x, double y) {
  constexpr std::array<const char*, 4> kSides = {"forward", "left", "backward", "right"};
  const double heading = std::atan2(y, x) / kDegree;  // to the left
  const auto quarter = static_cast<int>(std::lround(heading / 90));
  const double rest = heading - 90.0 * quarter;
  std::string side = kSides[static_cast<std::size_t>((quarter + 4) % 4)];
  if (std::abs(rest) < 0.5) return side;
  const std::string other = kSides[static_cast<std::size_t>((quarter + (rest > 0 ? 5 : 3)) % 4)];
  return text(std::round(std::abs(rest)), " deg ", other, " of ", side);
}

/// The camera's turn about its own axis: what points up in its image.
std::string roll_in_words(const Eigen::Matrix3d& R, bool steep) {
  const Eigen::Vector3d ahead = R.col(2), top = -R.col(1);
  const Eigen::Vector3d up = steep ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d upright = (up - up.dot(ahead) * ahead).normalized();
  const double roll = std::atan2(upright.cross(top).dot(ahead), upright.dot(top)) / kDegree;
  if (std::abs(roll) < 0.5) return steep ? "top of the image forward" : "upright";
  if (std::abs(roll) > 179.5) return steep ? "top of the image backward" : "upside down";
  return text("rolled ", std::round(std::abs(roll)), " deg ", roll > 0 ? "clockwise" : "anticlockwise");
}

}  // namespace

std::string placement_in_words(const Pose& T_body_cam) {
  const Eigen::Matrix3d R = T_body_cam.rotation();
  const Eigen::Vector3d ahead = R.col(2);
  const double down = std::asin(std::clamp(-ahead.z(), -1.0, 1.0)) / kDegree;
  const bool steep = std::abs(down) > kSteep_deg;
  std::string looks;
  if (steep) {
    looks = down > 0 ? "down" : "up";
    if (const double off = 90 - std::abs(down); off >= 0.5)
      looks += text(" (", std::round(off), " deg off, ", heading_in_words(ahead.x(), ahead.y()), ")");
  } else {
    looks = heading_in_words(ahead.x(), ahead.y());
    if (std::abs(down) >= 0.5)
      looks += text(", ", std::round(std::abs(down)), " deg ", down > 0 ? "down" : "up");
  }
  return offset_in_words(T_body_cam.p) + "; looks " + looks + ", " + roll_in_words(R, steep);
}

}  // namespace evpose
