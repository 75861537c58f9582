// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/batch/following_back_end.h"

#include <algorithm>
#include <array>

#include "evpose/core/error.h"
#include "evpose/fusion/calibration_states.h"
#include "evpose/fusion/shared_errors.h"

namespace evpose {
namespace {

using namespace error_state;

/// Of biases that are found anew: any IMU.
constexpr double kAnyGyroBias_rad_s = 1, kAnyAccelBias_m_s2 = 3;

/// To each side of a state, for its turn rate.
constexpr TimeNs kSlow = 25 * kNsPerMs, kQuick = 3 * kNsPerMs;

}  // namespace

FollowingBackEnd::FollowingBackEnd(const StatePropagator& propagator, std::span<const FusionState> trajectory,
                                   const Pose& T_body_cam, StaticParameters& parameters, ChainSmoother& chain)
    : BackEnd(propagator),
      trajectory_(trajectory),
      T_body_cam_(T_body_cam),
      parameters_(parameters),
      chain_(chain) {
  EVPOSE_CHECK(!trajectory.empty());
  if (parameters_.places().time) quick_share_ = quick_share();
}

void FollowingBackEnd::start(const FusionState& first) {
  if (next_ > 0) {
    predicted_.covariance.diagonal().segment<3>(kBg).array() += kAnyGyroBias_rad_s * kAnyGyroBias_rad_s;
    predicted_.covariance.diagonal().segment<3>(kBa).array() += kAnyAccelBias_m_s2 * kAnyAccelBias_m_s2;
    return;
  }
  EVPOSE_CHECK(first.t == trajectory_.front().t);
  chain_.start(first.minus(trajectory_.front()), first.covariance);
  state_ = predicted_ = trajectory_.front();
  predicted_.covariance.setZero();
  next_ = 1;
}

void FollowingBackEnd::predict(const ImuSample& a, const ImuSample& b, ImuTrust trust) {
  Matrix15d transition;
  const Eigen::Vector3d gyro_bias = predicted_.gyro_bias, accel_bias = predicted_.accel_bias;
  propagator().propagate(predicted_, a, b, trust, &transition);
  if (parameters_.places().imu_axes)
    add_axes(0.5 * (a.gyro + b.gyro) - gyro_bias, 0.5 * (a.accel + b.accel) - accel_bias, transition);
  add_step(transition, to_seconds(b.t - a.t));
}

/// What is wrong of the axes acts through the readings, as biases do that grow with the motion.
void FollowingBackEnd::add_axes(const Eigen::Vector3d& rate, const Eigen::Vector3d& force,
                                const Matrix15d& transition) {
  by_axes_ = (transition * by_axes_).eval();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) {
      by_axes_.col(3 * row + column).head<9>() += rate(column) * transition.col(kBg + row).head<9>();
      by_axes_.col(9 + 3 * row + column).head<9>() += force(column) * transition.col(kBa + row).head<9>();
    }
}

void FollowingBackEnd::predict(TimeNs t) {
  const double dt_s = to_seconds(t - predicted_.t);
  Matrix15d transition;
  propagator().propagate(predicted_, t, &transition);
  add_step(transition, dt_s);
}

void FollowingBackEnd::add_step(const Matrix15d& transition, double dt_s) {
  transition_ = (transition * transition_).eval();
  if (parameters_.places().gravity)
    by_tilt_ = (transition * by_tilt_).eval() + state_by_gravity_tilt(propagator().gravity_map(), dt_s);
  const Matrix15d known = state_.covariance;
  state_ = predicted_;
  state_.covariance = known;
  if (next_ < trajectory_.size() && predicted_.t >= trajectory_[next_].t) arrive();
}

/// At a state of the trajectory: what the IMU says of the step from the last one.
void FollowingBackEnd::arrive() {
  const FusionState& here = trajectory_[next_];
  EVPOSE_CHECK(predicted_.t == here.t);
  // A noise of nothing at all would make a step that can never be corrected.
  constexpr double kLeast = 1e-9;
  Matrix15d noise = predicted_.covariance;
  noise.diagonal().array() += kLeast * kLeast;
  const Vector15d difference = here.minus(predicted_);
  // The error of the attitude refers to the trajectory's axes, the prediction's to its own.
  Matrix15d turn = Matrix15d::Identity();
  turn.block<3, 3>(kPhi, kPhi) = so3::right_jacobian(difference.segment<3>(kPhi));
  Eigen::MatrixXd by_parameters(15, 0);
  const StaticParameters::Places& places = parameters_.places();
  if (places.gravity || places.imu_axes)
    by_parameters.setZero(15, places.imu_axes ? *places.imu_axes + 18 : *places.gravity + 2);
  if (places.gravity) by_parameters.middleCols<2>(*places.gravity) = turn * by_tilt_;
  if (places.imu_axes) by_parameters.middleCols<18>(*places.imu_axes) = turn * by_axes_;
  chain_.move(turn * transition_, turn * difference, turn * noise * turn.transpose(), by_parameters);
  const Eigen::Vector3d angular_rate = predicted_.angular_rate;
  state_ = predicted_ = here;
  state_.angular_rate = predicted_.angular_rate = angular_rate;
  predicted_.covariance.setZero();
  transition_.setIdentity();
  by_tilt_.setZero();
  by_axes_.setZero();
  ++next_;
}

/// What single contours say of parameters beside the pose.
void FollowingBackEnd::add_contours(std::span<const ContourOffset> contours) {
  const Eigen::Matrix3d R = state_.nav.T_map_body.rotation();
  std::array<BlockRow, 4> rows;
  for (const ContourOffset& contour : contours) {
    std::size_t n = 0;
    const auto add = [&](int block, int place, const BlockRow::Derivative& derivative) {
      if (static_cast<std::size_t>(block) >= places_.size())
        places_.resize(static_cast<std::size_t>(block) + 1);
      places_[static_cast<std::size_t>(block)] = place;
      rows[n++] = {static_cast<BlockId>(block), derivative};
    };
    const Eigen::Vector3d across = R * contour.across_body;
    if (const double length = across.norm(); parameters_.estimates_segments() && length > 0) {
      const auto& segment = parameters_.segment(contour, across / length);
      const double by_offset = -across.dot(segment.across_map);
      add(1 + segment.place, segment.place, BlockRow::Derivative::Constant(1, by_offset));
    }
    if (const auto place = parameters_.places().intrinsics;
        place && contour.by_intrinsics.size() == parameters_.intrinsics_count())
      add(0, *place, contour.by_intrinsics);
    for (const auto& [number, px] : SharedErrors::on(contour))
      if (const auto place = parameters_.shared_error(number))
        add(1 + *place, *place, BlockRow::Derivative::Constant(1, px));
    if (n > 0) measurement_.add({contour.by_pose(R), contour.weight, contour.offset_px, {rows.data(), n}});
  }
}

Eigen::Vector3d FollowingBackEnd::displacement_of(std::uint32_t segment) const {
  return parameters_.displacement_of(segment);
}

/// Of the trajectory about its state k, body frame, rad/s.
Eigen::Vector3d FollowingBackEnd::rate_over(std::size_t k, TimeNs to_each_side, double* dt_s) const {
  std::size_t before = k, after = k;
  const TimeNs t = trajectory_[k].t;
  while (before > 0 && t - trajectory_[before].t < to_each_side) --before;
  while (after + 1 < trajectory_.size() && trajectory_[after].t - t < to_each_side) ++after;
  const FusionState &a = trajectory_[before], &b = trajectory_[after];
  *dt_s = to_seconds(b.t - a.t);
  if (!(*dt_s > 0)) return Eigen::Vector3d::Zero();
  return so3::log(a.nav.T_map_body.q.conjugate() * b.nav.T_map_body.q) / *dt_s;
}

/// Share of the quick part of the turn rate that is motion and not the gyroscope's noise.
double FollowingBackEnd::quick_share() const {
  double square = 0, noise = 0;
  const double density = propagator().noise().gyro_density;
  for (std::size_t k = 0; k < trajectory_.size(); ++k) {
    double slow_s = 0, quick_s = 0;
    const Eigen::Vector3d slow = rate_over(k, kSlow, &slow_s), quick = rate_over(k, kQuick, &quick_s);
    if (!(quick_s > 0) || !(slow_s > quick_s)) continue;
    square += (quick - slow).squaredNorm();
    noise += 3 * density * density * (1 / quick_s - 1 / slow_s);
  }
  return square > noise ? 1 - noise / square : 0;
}

/// What an error of the time offset does to the seen pose. The gyroscope's noise is in the trajectory and in
/// the predictions, and a rate that knew it would pull the offset to one side; a rate over a while does not
/// know a vibration. So of what is quick as much is taken as is motion (Wiener).
Vector6d FollowingBackEnd::seen_pose_by_time() const {
  FusionState state = state_;
  double dt_s = 0;
  const Eigen::Vector3d slow = rate_over(next_ - 1, kSlow, &dt_s),
                        quick = rate_over(next_ - 1, kQuick, &dt_s);
  if (dt_s > 0) state.angular_rate = slow + quick_share_ * (quick - slow);
  return seen_pose_by_time_offset(state);
}

/// The measurement, of the seen pose and of blocks, as one of the pose and of parameters.
ChainMeasurement FollowingBackEnd::by_parameters() const {
  const StaticParameters::Places& at = parameters_.places();
  std::vector<std::pair<int, Vector6d>> shifts;
  const auto add = [&](int place, const auto& columns) {
    for (int i = 0; i < columns.cols(); ++i) shifts.emplace_back(place + i, columns.col(i));
  };
  if (at.time) add(*at.time, seen_pose_by_time());
  if (at.rotation) add(*at.rotation, seen_pose_by_rotation(state_, T_body_cam_.p));
  if (at.translation) add(*at.translation, seen_pose_by_translation(state_));

  ChainMeasurement out;
  const auto shifted = static_cast<Eigen::Index>(shifts.size());
  const Eigen::Index blocks = measurement_.size() - 6, all = 6 + shifted + blocks;
  Eigen::MatrixXd by_shifts(6, shifted);  // of the seen pose
  for (Eigen::Index i = 0; i < shifted; ++i) {
    out.parameters.push_back(shifts[static_cast<std::size_t>(i)].first);
    by_shifts.col(i) = shifts[static_cast<std::size_t>(i)].second;
  }
  for (const JointMeasurement::Block& block : measurement_.blocks())
    for (int i = 0; i < block.size; ++i)
      out.parameters.push_back(places_[static_cast<std::size_t>(block.id)] + i);
  const auto H = measurement_.information();
  const auto pose = H.topLeftCorner<6, 6>();
  const auto mixed = H.topRightCorner(6, blocks);
  const Eigen::Matrix<double, 6, Eigen::Dynamic> pose_shifts = pose * by_shifts;
  out.information.resize(all, all);
  out.information << pose, pose_shifts, mixed,  //
      pose_shifts.transpose(), by_shifts.transpose() * pose_shifts, by_shifts.transpose() * mixed,
      mixed.transpose(), mixed.transpose() * by_shifts, H.bottomRightCorner(blocks, blocks);
  const auto b = measurement_.vector();
  out.vector.resize(all);
  out.vector << b.head<6>(), by_shifts.transpose() * b.head<6>(), b.tail(blocks);
  return out;
}

void FollowingBackEnd::update(const PoseInformation& measurement, std::span<const ContourOffset> contours) {
  if (state_.t != trajectory_[next_ - 1].t) return;  // after the trajectory's end
  measurement_.start(measurement);
  add_contours(contours);
  if (contour_callback_) contour_callback_(state_, contours);
  chain_.measure(by_parameters());
}

Eigen::MatrixXd FollowingBackEnd::seen_covariance() const {
  const Eigen::Index size = 9 + parameters_.intrinsics_count();
  return Eigen::MatrixXd::Zero(size, size);
}

Calibration FollowingBackEnd::calibration() const {
  Calibration out;
  out.frozen = false;
  out.intrinsics.setZero(parameters_.intrinsics_count());
  out.intrinsics_sigma = out.intrinsics;
  return out;
}

}  // namespace evpose
