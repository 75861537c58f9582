// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/batch/static_parameters.h"

#include <cmath>

namespace evpose {

StaticParameters::StaticParameters(const FusionConfig& config) {
  const CalibrationConfig& c = config.calibration;
  std::vector<double> sigmas;
  const auto add = [&](bool asked, std::optional<int>* place, const Eigen::VectorXd& sigma) {
    if (!asked) return;
    *place = static_cast<int>(sigmas.size());
    sigmas.insert(sigmas.end(), sigma.begin(), sigma.end());
  };
  add(c.time_offset, &places_.time, Eigen::VectorXd::Constant(1, c.start_time_sigma_s));
  add(c.rotation, &places_.rotation, c.start_rotation_sigma_rad);
  add(c.translation, &places_.translation, c.start_translation_sigma_m);
  add(c.gravity, &places_.gravity, Eigen::VectorXd::Constant(2, c.start_gravity_sigma_rad));
  add(c.intrinsics, &places_.intrinsics, c.start_intrinsics_sigma);
  intrinsics_count_ = c.intrinsics ? c.start_intrinsics_sigma.size() : 0;
  // A number that is known has the sigma zero.
  constexpr double kKnown = 1e-9;
  calibration_sigma_ =
      Eigen::Map<const Eigen::VectorXd>(sigmas.data(), static_cast<Eigen::Index>(sigmas.size()))
          .cwiseMax(kKnown);
  found_.intrinsics.setZero(intrinsics_count_);
  calibration_size_ = size_ = static_cast<int>(sigmas.size());
  if (config.segment_offsets == SegmentOffsetUse::on) segments_config_ = config.segments;
}

const StaticParameters::Segment& StaticParameters::segment(const ContourOffset& contour,
                                                           const Eigen::Vector3d& across_map) {
  const auto [found, is_new] = segment_of_number_.try_emplace(contour.segment, segments_.size());
  if (is_new)
    segments_.push_back({size_++, across_map, 0, std::hypot(segments_config_->sigma_m, contour.sigma_m)});
  return segments_[found->second];
}

Eigen::Vector3d StaticParameters::displacement_of(std::uint32_t segment) const {
  const auto known = segment_of_number_.find(segment);
  if (known == segment_of_number_.end()) return Eigen::Vector3d::Zero();
  const Segment& found = segments_[known->second];
  return found.offset_m * found.across_map;
}

Eigen::VectorXd StaticParameters::calibration_errors() const {
  Eigen::VectorXd out(calibration_size_);
  if (places_.time) out(*places_.time) = found_.time_offset_s;
  if (places_.rotation) out.segment<3>(*places_.rotation) = so3::log(found_.turn);
  if (places_.translation) out.segment<3>(*places_.translation) = found_.shift;
  if (places_.gravity) out.segment<2>(*places_.gravity) = found_.gravity_tilt_rad;
  if (places_.intrinsics) out.segment(*places_.intrinsics, intrinsics_count_) = found_.intrinsics;
  return out;
}

ParameterInformation StaticParameters::prior() const {
  Eigen::VectorXd sigma(size_), value(size_);
  sigma.head(calibration_size_) = calibration_sigma_;
  value.head(calibration_size_) = calibration_errors();
  for (const Segment& s : segments_) sigma(s.place) = s.sigma_m, value(s.place) = s.offset_m;
  ParameterInformation out;
  const Eigen::VectorXd information = sigma.cwiseAbs2().cwiseInverse();
  out.S = information.asDiagonal();
  out.s = -information.cwiseProduct(value);
  return out;
}

void StaticParameters::add(const Calibration& found) {
  Eigen::VectorXd z = Eigen::VectorXd::Zero(size_);
  if (places_.time) z(*places_.time) = found.time_offset_s;
  if (places_.rotation) z.segment<3>(*places_.rotation) = so3::log(found.turn);
  if (places_.translation) z.segment<3>(*places_.translation) = found.shift;
  if (places_.gravity) z.segment<2>(*places_.gravity) = found.gravity_tilt_rad;
  if (places_.intrinsics) z.segment(*places_.intrinsics, intrinsics_count_) = found.intrinsics;
  correct(z, Eigen::MatrixXd::Zero(size_, size_));
}

void StaticParameters::correct(const Eigen::VectorXd& z, const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd sigma = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  if (const auto at = places_.time) {
    found_.time_offset_s += z(*at);
    found_.time_sigma_s = sigma(*at);
  }
  if (const auto at = places_.rotation) {
    found_.turn = (so3::exp(z.segment<3>(*at)) * found_.turn).normalized();
    found_.turn_sigma_rad = sigma.segment<3>(*at);
  }
  if (const auto at = places_.translation) {
    found_.shift += z.segment<3>(*at);
    found_.shift_sigma_m = sigma.segment<3>(*at);
  }
  if (const auto at = places_.gravity) {
    found_.gravity_tilt_rad += z.segment<2>(*at);
    found_.gravity_sigma_rad = sigma.segment<2>(*at);
  }
  if (const auto at = places_.intrinsics) {
    found_.intrinsics += z.segment(*at, intrinsics_count_);
    found_.intrinsics_sigma = sigma.segment(*at, intrinsics_count_);
  }
  for (Segment& s : segments_) s.offset_m += z(s.place);
}

}  // namespace evpose
