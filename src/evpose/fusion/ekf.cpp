// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/ekf.h"

#include <array>
#include <numeric>
#include <vector>

#include "evpose/fusion/shared_errors.h"

namespace evpose {

Ekf::Ekf(const StatePropagator& propagator, const FusionConfig& config, const Pose& T_body_cam)
    : BackEnd(propagator), calibration_(config.calibration, T_body_cam) {
  if (config.segment_offsets == SegmentOffsetUse::on) offsets_.emplace(config.segments);
}

void Ekf::start(const FusionState& first) {
  if (offsets_) offsets_->remove_all(filter_);
  share_of_blocks_.setZero();
  forget_kept_pose();
  filter_.reset_state(first);
  filter_.follow_shared_errors(SharedErrors::kCount);
  calibration_.start(filter_);
}

void Ekf::predict(const ImuSample& a, const ImuSample& b, ImuTrust trust) {
  filter_.propagate(propagator(), a, b, trust);
  calibration_.propagate(filter_, propagator().gravity_map(), to_seconds(b.t - a.t));
}

void Ekf::predict(TimeNs t) {
  const double dt_s = to_seconds(t - state().t);
  filter_.propagate(propagator(), t);
  calibration_.propagate(filter_, propagator().gravity_map(), dt_s);
}

void Ekf::update(const PoseInformation& measurement, std::span<const ContourOffset> contours) {
  calibration_.judge_excitation(filter_);
  measurement_.start(measurement, calibration_.pose_shifts(state()));
  measurement_.expect_shared_errors(SharedErrors::kCount);
  add_contours(contours);
  filter_.update(measurement_);
  if (blocks_take_contours()) share_of_blocks_ = filter_.share_of_blocks(measurement_);
  apply_corrections();
}

void Ekf::update(const SeenMeasurement& measurement) {
  measurement_.start({measurement.information.topLeftCorner<6, 6>(), measurement.vector.head<6>()},
                     calibration_.pose_shifts(state()));
  measurement_.expect_shared_errors(SharedErrors::kCount);
  const BlockId velocity = filter_.add_copy(error_state::kV, 3);
  std::vector<JointMeasurement::SizedBlock> blocks{{velocity, 3}};
  const auto more = static_cast<int>(measurement.vector.size()) - SeenMeasurement::kNumbers;
  if (more > 0) blocks.push_back({calibration_.intrinsics().value(), more});
  measurement_.add_blocks(blocks, measurement.information, measurement.vector);
  filter_.update(measurement_);
  apply_corrections();
  filter_.remove_block(velocity);
}

void Ekf::forget_kept_pose() {
  if (kept_pose_) filter_.remove_block(kept_);
  kept_pose_.reset();
}

void Ekf::keep_pose() {
  forget_kept_pose();
  kept_ = filter_.add_copy(error_state::kP, 6);
  kept_pose_ = state().nav.T_map_body;
}

void Ekf::update(const RelativeInformation& measurement) {
  if (!kept_pose_) return;
  std::vector<JointMeasurement::SizedBlock> blocks{{kept_, 6}};
  std::vector<int> told(RelativeInformation::kPoses);  // of what was measured, that are states
  std::iota(told.begin(), told.end(), 0);
  const auto add = [&](const std::optional<BlockId>& block, int first, int size) {
    if (!block || size == 0) return;
    blocks.push_back({*block, size});
    for (int i = 0; i < size; ++i) told.push_back(first + i);
  };
  add(calibration_.rotation(), RelativeInformation::kPoses, 3);
  add(calibration_.intrinsics(), RelativeInformation::kNumbers,
      static_cast<int>(measurement.vector.size()) - RelativeInformation::kNumbers);
  measurement_.start({measurement.information.topLeftCorner<6, 6>(), measurement.vector.head<6>()});
  measurement_.expect_shared_errors(SharedErrors::kCount);
  measurement_.add_blocks(blocks, measurement.information(told, told), measurement.vector(told));
  filter_.update(measurement_);
  apply_corrections();
}

/// Of the blocks, after an update.
void Ekf::apply_corrections() {
  if (offsets_) offsets_->apply_corrections(filter_);
  if (kept_pose_) kept_pose_ = kept_pose_->plus(filter_.correction(kept_));
  Eigen::Vector3d gravity_map = propagator().gravity_map();
  calibration_.apply_corrections(filter_, &gravity_map);
  set_gravity_map(gravity_map);
}

Eigen::MatrixXd Ekf::seen_covariance() const {
  const auto numbers = calibration_.intrinsics();
  return filter_.seen_covariance(calibration_.pose_shifts(state()), numbers ? &*numbers : nullptr);
}

FusionState Ekf::reported_state() const {
  FusionState out = state();
  out.covariance += filter_.shared_covariance();
  return out;
}

/// Adds what the contours say about the blocks that they depend on one by one, and what errors they share.
/// One whose segment finds no state says nothing.
void Ekf::add_contours(std::span<const ContourOffset> contours) {
  const Eigen::Matrix3d R = state().nav.T_map_body.rotation();
  std::array<BlockRow, 2> rows;
  for (const ContourOffset& contour : contours) {
    std::size_t n = 0;
    if (offsets_) {
      const auto row = offsets_->row_of(contour, filter_);
      if (!row) {
        measurement_.withdraw(contour.by_pose(R), contour.weight, contour.offset_px);
        continue;
      }
      rows[n++] = *row;
    }
    if (const auto row = calibration_.row_of(contour)) rows[n++] = *row;
    const BlockSample sample{contour.by_pose(R), contour.weight, contour.offset_px, {rows.data(), n}};
    if (n > 0) measurement_.add(sample);
    SharedErrors::add(contour, sample, measurement_);
  }
}

Eigen::Vector3d Ekf::displacement_of(std::uint32_t segment) const {
  return offsets_ ? offsets_->displacement_of(segment) : Eigen::Vector3d::Zero();
}

Matrix6d Ekf::measured_covariance() const {
  const Matrix6d seen = filter_.seen_pose_covariance(calibration_.pose_shifts(state()));
  return blocks_take_contours() ? Matrix6d(seen + share_of_blocks_) : seen;
}

std::span<const SegmentOffsets::Segment> Ekf::segments() const {
  if (!offsets_) return {};
  return offsets_->segments();
}

}  // namespace evpose
