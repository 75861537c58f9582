// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/camera/adjusted_camera.h"

#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

constexpr double kStep_px = 0.01;        // at the rim, of a derivative's difference
constexpr double kUnnoticed_px = 0.002;  // at the rim, of a correction that is not worth a new camera

/// Changes of the numbers that move a pixel at the rim by about one px. The distortion's terms grow with the
/// radius there, at most about 1 in units of the focal length; a step need not be exact.
AdjustedCamera::Correction per_px(const CameraIntrinsics& c) {
  const double rim = std::hypot(0.5 * c.size.width / c.fx, 0.5 * c.size.height / c.fy);
  AdjustedCamera::Correction out(4 + static_cast<Eigen::Index>(c.distortion.size()));
  out.setConstant(1 / (std::min(c.fx, c.fy) * std::clamp(rim * rim * rim, 0.05, 1.0)));
  out.head<2>().setConstant(1 / std::max(rim, 0.1));
  out.segment<2>(2).setOnes();
  return out;
}

}  // namespace

CameraIntrinsics corrected(const CameraIntrinsics& given, const Eigen::VectorXd& correction) {
  CameraIntrinsics out = given;
  double* const first[] = {&out.fx, &out.fy, &out.cx, &out.cy};
  for (Eigen::Index i = 0; i < 4; ++i) *first[i] += correction(i);
  for (std::size_t i = 0; i < out.distortion.size(); ++i)
    out.distortion[i] += correction(static_cast<Eigen::Index>(i) + 4);
  return out;
}

Expected<std::shared_ptr<AdjustedCamera>> AdjustedCamera::create(const CameraIntrinsics& given) {
  const auto camera = make_camera(given);
  if (!camera) return camera.error();
  std::shared_ptr<AdjustedCamera> out(new AdjustedCamera(given, *camera));
  const Eigen::Index n = out->step_.size();
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto step = [&](double sign) {
      return make_camera(corrected(given, sign * out->step_(i) * Correction::Unit(n, i)));
    };
    auto stepped = step(1);
    if (!stepped) {  // at the end of a number's range
      out->step_(i) *= -1;
      stepped = step(1);
    }
    if (!stepped) return stepped.error();
    out->stepped_.push_back(*stepped);
  }
  return out;
}

AdjustedCamera::AdjustedCamera(const CameraIntrinsics& given, std::shared_ptr<const Camera> camera)
    : numbers_(given),
      given_(camera),
      now_(std::move(camera)),
      applied_(Correction::Zero(4 + static_cast<Eigen::Index>(given.distortion.size()))),
      step_(kStep_px * per_px(given)) {}

bool AdjustedCamera::set_correction(const Correction& correction) {
  EVPOSE_CHECK(correction.size() == applied_.size());
  const double change = (correction - applied_).cwiseQuotient(step_).cwiseAbs().sum() * kStep_px;
  if (change < kUnnoticed_px) return true;
  const auto camera = make_camera(corrected(numbers_, correction));
  if (!camera) return false;
  now_ = *camera;
  applied_ = correction;
  return true;
}

std::optional<AdjustedCamera::ByNumbers> AdjustedCamera::by_numbers(const Eigen::Vector3d& point) const {
  const auto pixel = given_->project(point);
  if (!pixel) return std::nullopt;
  ByNumbers out(2, step_.size());
  for (Eigen::Index i = 0; i < step_.size(); ++i) {
    const auto moved = stepped_[static_cast<std::size_t>(i)]->project(point);
    if (!moved) return std::nullopt;
    out.col(i) = (*moved - *pixel) / step_(i);
  }
  return out;
}

}  // namespace evpose
