// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/batch/static_parameters.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

namespace evpose {
namespace {

using RowMajor3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

/// Row by row, of gyroscope and accelerometer.
Eigen::VectorXd elements(const Eigen::Matrix3d& gyro, const Eigen::Matrix3d& accel) {
  Eigen::VectorXd out(18);
  Eigen::Map<RowMajor3d>(out.data()) = gyro;
  Eigen::Map<RowMajor3d>(out.data() + 9) = accel;
  return out;
}

Eigen::VectorXd axes_sigma(const ImuAxes& axes, double otherwise) {
  const auto stated = [&](const Eigen::Matrix3d& sigma) -> Eigen::Matrix3d {
    return sigma.minCoeff() < 0 ? Eigen::Matrix3d::Constant(otherwise) : sigma;
  };
  return elements(stated(axes.gyro_sigma), stated(axes.accel_sigma));
}

}  // namespace

StaticParameters::StaticParameters(const FusionConfig& config, Shared shared)
    : StaticParameters(config, shared, Eigen::VectorXd()) {}

StaticParameters::StaticParameters(const FusionConfig& config, Shared shared, const ImuAxes& imu)
    : StaticParameters(config, shared, axes_sigma(imu, config.imu_scale_sigma)) {}

StaticParameters::StaticParameters(const FusionConfig& config, Shared shared,
                                   const Eigen::VectorXd& imu_axes_sigma)
    : shared_(shared), imu_axes_sigma_(imu_axes_sigma) {
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
  add(imu_axes_sigma.size() > 0, &places_.imu_axes, imu_axes_sigma);
  imu_axes_.setZero(imu_axes_sigma.size());
  intrinsics_count_ = c.intrinsics ? c.start_intrinsics_sigma.size() : 0;
  state_prior(c, sigmas);
  found_.intrinsics.setZero(intrinsics_count_);
  calibration_size_ = places_.shared = static_cast<int>(sigmas.size());
  size_ = calibration_size_ + SharedErrors::kCount;
  if (config.segment_offsets == SegmentOffsetUse::on) segments_config_ = config.segments;
}

void StaticParameters::state_prior(const CalibrationConfig& config, const std::vector<double>& sigmas) {
  const auto n = static_cast<Eigen::Index>(sigmas.size());
  // A number that is known has the sigma zero.
  constexpr double kKnown = 1e-9;
  given_sigma_ = Eigen::Map<const Eigen::VectorXd>(sigmas.data(), n).cwiseMax(kKnown);
  Eigen::MatrixXd correlation = Eigen::MatrixXd::Identity(n, n);
  using Kind = CalibrationConfig::Kind;
  const std::pair<Kind, std::optional<int>> kinds[] = {{Kind::intrinsics, places_.intrinsics},
                                                       {Kind::rotation, places_.rotation},
                                                       {Kind::translation, places_.translation},
                                                       {Kind::time, places_.time}};
  for (const auto& [a, at_a] : kinds)
    for (const auto& [b, at_b] : kinds)
      if (const auto R = config.correlation(a, b); at_a && at_b && R.size() > 0)
        correlation.block(*at_a, *at_b, R.rows(), R.cols()) = R;
  constexpr double kRounding = 1e-9;  // of a correlation that was written and read
  correlation.diagonal().array() += kRounding;
  const Eigen::VectorXd weight = given_sigma_.cwiseInverse();
  calibration_information_ =
      weight.asDiagonal() * correlation.ldlt().solve(Eigen::MatrixXd::Identity(n, n)) * weight.asDiagonal();
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
  if (places_.imu_axes) out.segment<18>(*places_.imu_axes) = imu_axes_;
  return out;
}

ImuAxes StaticParameters::corrected(const ImuAxes& given) const {
  ImuAxes out = given;
  if (!places_.imu_axes) return out;
  const auto matrix = [](const Eigen::VectorXd& values, Eigen::Index first) -> Eigen::Matrix3d {
    return Eigen::Map<const RowMajor3d>(values.data() + first);
  };
  out.gyro += given.gyro * matrix(imu_axes_, 0);
  out.accel += given.accel * matrix(imu_axes_, 9);
  out.gyro_sigma = matrix(imu_axes_sigma_, 0);
  out.accel_sigma = matrix(imu_axes_sigma_, 9);
  return out;
}

ParameterInformation StaticParameters::prior() const {
  Eigen::VectorXd value = Eigen::VectorXd::Zero(size_);
  value.head(calibration_size_) = calibration_errors();
  ParameterInformation out;
  out.S = Eigen::MatrixXd::Identity(size_, size_);
  out.S.topLeftCorner(calibration_size_, calibration_size_) = calibration_information_;
  for (const Segment& s : segments_) {
    out.S(s.place, s.place) = 1 / (s.sigma_m * s.sigma_m);
    value(s.place) = s.offset_m;
  }
  out.s = -(out.S * value);
  return out;
}

ParameterSolution StaticParameters::solve(const ParameterInformation& of_recordings, double trust) const {
  ParameterInformation known = prior();
  known.S.topLeftCorner(calibration_size_, calibration_size_) *= trust;
  known.s.head(calibration_size_) *= trust;
  known.add(of_recordings);
  const Eigen::LDLT<Eigen::MatrixXd> ldlt(known.S);
  return {ldlt.solve(known.s), ldlt.solve(Eigen::MatrixXd::Identity(size_, size_))};
}

Eigen::MatrixXd StaticParameters::calibration_correlation(Eigen::Index n, bool with_imu) const {
  std::vector<std::pair<Eigen::Index, int>> known;  // place in the result, and here
  const auto add = [&](std::optional<int> place, Eigen::Index at, Eigen::Index size) {
    for (int i = 0; place && i < size; ++i) known.emplace_back(at + i, *place + i);
  };
  add(places_.intrinsics, 0, intrinsics_count_);
  if (with_imu) {
    add(places_.rotation, n, 3);
    add(places_.translation, n + 3, 3);
    add(places_.time, n + 6, 1);
  }
  const Eigen::MatrixXd& P = calibration_covariance_;
  Eigen::MatrixXd out = with_imu ? Eigen::MatrixXd::Identity(n + 7, n + 7) : Eigen::MatrixXd::Identity(n, n);
  for (const auto& [to_row, row] : known)
    for (const auto& [to_column, column] : known)
      if (to_row != to_column)
        out(to_row, to_column) = P(row, column) / std::sqrt(P(row, row) * P(column, column));
  return out;
}

double StaticParameters::change(const ParameterSolution& solution) const {
  double out = 0;
  for (int i = 0; i < calibration_size_; ++i)
    out = std::max(out, std::abs(solution.z(i)) / std::sqrt(solution.covariance(i, i)));
  return out;
}

void StaticParameters::add(const Calibration& found) {
  Eigen::VectorXd z = Eigen::VectorXd::Zero(size_);
  if (places_.time) z(*places_.time) = found.time_offset_s;
  if (places_.rotation) z.segment<3>(*places_.rotation) = so3::log(found.turn);
  if (places_.translation) z.segment<3>(*places_.translation) = found.shift;
  if (places_.gravity) z.segment<2>(*places_.gravity) = found.gravity_tilt_rad;
  if (places_.intrinsics) z.segment(*places_.intrinsics, intrinsics_count_) = found.intrinsics;
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(size_, size_);
  const auto set = [&](std::optional<int> place, const Eigen::VectorXd& sigma) {
    if (place) covariance.diagonal().segment(*place, sigma.size()) = sigma.cwiseAbs2();
  };
  set(places_.time, Eigen::VectorXd::Constant(1, found.time_sigma_s));
  set(places_.rotation, found.turn_sigma_rad);
  set(places_.translation, found.shift_sigma_m);
  set(places_.gravity, found.gravity_sigma_rad);
  set(places_.intrinsics, found.intrinsics_sigma);
  set(places_.imu_axes, imu_axes_sigma_);
  correct({z, covariance});
}

void StaticParameters::correct(const ParameterSolution& solution) {
  const auto& [z, covariance] = solution;
  calibration_covariance_ = covariance.topLeftCorner(calibration_size_, calibration_size_);
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
  if (const auto at = places_.imu_axes) {
    imu_axes_ += z.segment<18>(*at);
    imu_axes_sigma_ = sigma.segment<18>(*at);
  }
  for (Segment& s : segments_) s.offset_m += z(s.place);
}

}  // namespace evpose
