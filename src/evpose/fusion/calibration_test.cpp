// SPDX-License-Identifier: BSD-3-Clause
// Slow errors found by the filter: a flight whose IMU clock, camera mounting or map are not as given.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>

#include "evpose/fusion/ekf.h"

namespace evpose {
namespace {

const Eigen::Vector3d kGravity(0, 0, -9.81);
constexpr TimeNs kStep = 2 * kNsPerMs;  // of the IMU; every second one there is a camera pose

/// What is wrong, and what the filter is asked to find.
struct Wrong {
  double offset_s = 0;
  Eigen::Vector3d turn = Eigen::Vector3d::Zero(), shift = Eigen::Vector3d::Zero();
  Eigen::Vector2d tilt = Eigen::Vector2d::Zero();
  bool hover = false;
  double vibration_late_s = 0;        ///< the camera sees the airframe's vibration, not its flight, so late
  bool seen_anew = false;             ///< the flight begins with a pose of the camera, as a search finds it
  std::vector<double> offsets_m;      ///< of the segments of the map; none: the pose is measured as a whole
  Vector6d start = Vector6d::Zero();  ///< error of the pose at the start
};

ImuSample still(TimeNs t) { return {t, {0, 0, 0}, -kGravity}; }

constexpr double kVibration_rad_s = 0.5, kVibrationOmega_rad_s = 2 * M_PI * 90;

/// About x, of the body.
double vibration_angle_rad(double s) {
  return -kVibration_rad_s / kVibrationOmega_rad_s * std::cos(kVibrationOmega_rad_s * s);
}

ImuSample moving(TimeNs t) {
  const double s = to_seconds(t);
  return {t,
          {1.2 * std::sin(5 * s), 1.0 * std::cos(4 * s), 0.9 * std::sin(3 * s)},
          {1.5 * std::sin(4 * s), 1.2 * std::cos(7 * s), 9.81 + 2 * std::cos(6 * s)}};
}

/// Of a calibration that may be wrong by more than an ordinary one.
CalibrationConfig coarse() {
  CalibrationConfig c;
  c.start_time_sigma_s = 0.02;
  c.start_rotation_sigma_rad.setConstant(0.02);
  return c;
}

Eigen::Vector3d draw(std::mt19937& random, double sigma) {
  std::normal_distribution<double> normal(0, sigma);
  return {normal(random), normal(random), normal(random)};
}

struct Found {
  Calibration calibration;
  std::vector<SegmentOffsets::Segment> segments;
  Eigen::MatrixXd covariance;  ///< of the blocks: calibration, then segments
  double frozen = 0;           ///< share of the updates
};

FusionConfig flight_config(const CalibrationConfig& calibration) {
  FusionConfig config;
  config.imu_noise_scale = 1;
  config.imu_scale_sigma = 0;
  config.start_rotation_sigma_rad = 0.03;
  config.start_position_sigma_m = 0.03;
  config.calibration = calibration;
  return config;
}

/// What the camera's contours, some of each segment, say of the pose that it sees; their segments stand off,
/// and are measured where the filter knows them to stand.
std::vector<ContourOffset> see_segments(const Pose& seen, const BackEnd& filter,
                                        const std::vector<double>& offsets_m, std::mt19937& random) {
  constexpr double kWeight_px2 = 25;  // a fifth of a pixel
  std::mt19937 layout(3);             // the map is the same at each update
  std::uniform_real_distribution<double> place(-1, 1);
  std::normal_distribution<double> noise(0, 1 / std::sqrt(kWeight_px2));
  const Pose& predicted = filter.state().nav.T_map_body;
  const Vector6d ahead = seen.minus(predicted);
  std::vector<ContourOffset> out;
  for (std::uint32_t segment = 0; segment < offsets_m.size(); ++segment) {
    const Eigen::Vector3d middle(1 + 3 * place(layout), 2 + 3 * place(layout), 1 + 3 * place(layout));
    const Eigen::Vector3d across = Eigen::Vector3d(place(layout), place(layout), place(layout)).normalized();
    for (int k = 0; k < 2; ++k) {
      const Eigen::Vector3d point = middle + 0.2 * k * across.unitOrthogonal();
      ContourOffset contour{predicted.inverse() * point, predicted.q.conjugate() * (200 * across), 0,
                            kWeight_px2, segment};
      Vector6d by_pose;
      by_pose << 200 * across, contour.point_body.cross(contour.across_body);
      const double known_m = across.dot(filter.displacement_of(segment));
      contour.offset_px = by_pose.dot(ahead) - 200 * (offsets_m[segment] - known_m) + noise(random);
      out.push_back(contour);
    }
  }
  return out;
}

/// The measurement of the pose as a registration sums it up over contours.
PoseInformation summed(const std::vector<ContourOffset>& contours, const Pose& at) {
  PoseInformation sum;
  for (const ContourOffset& contour : contours) {
    Vector6d by_pose;
    by_pose << at.q * contour.across_body, contour.point_body.cross(contour.across_body);
    sum.information += contour.weight * by_pose * by_pose.transpose();
    sum.vector += contour.weight * contour.offset_px * by_pose;
  }
  return sum;
}

/// The true states, sample by sample, and what an IMU reads whose clock is ahead by the offset.
struct Flight {
  std::vector<NavState> truth;
  std::vector<ImuSample> readings;

  ImuSample reading_at(TimeNs clock) const {
    const auto k = static_cast<std::size_t>((clock - readings[0].t) / kStep);
    return interpolate(readings[k], readings[k + 1], clock);
  }
};

Flight make_flight(const Wrong& wrong, int seconds, std::mt19937& random) {
  const ImuNoise noise;
  const Eigen::Vector3d gravity = so3::exp({wrong.tilt.x(), wrong.tilt.y(), 0}) * kGravity;
  const int samples = seconds * static_cast<int>(1000 * kNsPerMs / kStep) + 50;
  Flight out;
  out.truth = {{{so3::exp({0.1, -0.2, 0.8}), {1, 2, 1}}, {0, 0, 0}}};
  if (wrong.hover) out.truth[0].T_map_body.q = Eigen::Quaterniond::Identity();
  std::vector<ImuSample> clean;
  const Eigen::Vector3d gyro_bias = draw(random, 0.01), accel_bias = draw(random, 0.05);
  const double rate = std::sqrt(1 / to_seconds(kStep));
  for (int k = 0; k < samples; ++k) {
    clean.push_back(wrong.hover ? still(k * kStep) : moving(k * kStep));
    if (wrong.vibration_late_s != 0)
      clean.back().gyro.x() += kVibration_rad_s * std::sin(kVibrationOmega_rad_s * to_seconds(k * kStep));
    if (k > 0)
      out.truth.push_back(
          strapdown(out.truth.back(), clean[clean.size() - 2], clean.back(), {0, 0, 0}, {0, 0, 0}, gravity));
    ImuSample s = clean.back();
    s.t += from_seconds(wrong.offset_s);
    s.gyro += gyro_bias + draw(random, noise.gyro_density * rate);
    s.accel += accel_bias + draw(random, noise.accel_density * rate);
    out.readings.push_back(s);
  }
  return out;
}

Found fly(const Wrong& wrong, const FusionConfig& config, int seconds, unsigned seed = 17) {
  const Pose T_body_cam{so3::exp({0.1, -1.2, 0.4}), {0.1, 0.02, -0.05}};
  const Pose true_T_body_cam{so3::exp(wrong.turn) * T_body_cam.q, T_body_cam.p + wrong.shift};
  std::mt19937 random(seed);
  const Flight flight = make_flight(wrong, seconds, random);
  const std::vector<NavState>& truth = flight.truth;

  Ekf ekf(StatePropagator(MotionModel::imu, config, ImuNoise{}), config, T_body_cam);
  const std::size_t first = 20;
  NavState start = truth[first];
  start.T_map_body = start.T_map_body.plus(wrong.start);
  ekf.start(static_cast<TimeNs>(first) * kStep, start, {0, 0, 0});
  if (wrong.seen_anew) {
    FusionState seen = ekf.state();
    seen.nav.T_map_body = truth[first].T_map_body * true_T_body_cam * T_body_cam.inverse();
    seen.covariance.diagonal().head<6>().setConstant(1e-6);
    ekf.start(seen);
  }
  Found out;
  int updates = 0;
  for (std::size_t k = first + 2; k + 30 < truth.size(); k += 2) {
    const Calibration now = ekf.calibration();
    const TimeNs until = static_cast<TimeNs>(k) * kStep + from_seconds(now.time_offset_s);
    if (until < ekf.state().t) continue;  // the offset has fallen: that time is past
    while (ekf.state().t < until) {
      const TimeNs from = ekf.state().t;
      const TimeNs zero = flight.readings[0].t, grid = zero + ((from - zero) / kStep + 1) * kStep;
      ekf.predict(flight.reading_at(from), flight.reading_at(std::min(grid, until)), ImuTrust::good);
    }
    ++updates;
    out.frozen += ekf.calibration().frozen ? 1 : 0;
    const Pose assumed{now.turn * T_body_cam.q, T_body_cam.p + now.shift};
    if (!wrong.offsets_m.empty()) {
      const Pose seen = truth[k].T_map_body * true_T_body_cam * assumed.inverse();
      const auto contours = see_segments(seen, ekf, wrong.offsets_m, random);
      ekf.update(summed(contours, ekf.state().nav.T_map_body), contours);
      continue;
    }
    Vector6d scatter;
    scatter << draw(random, 1e-3), draw(random, 5e-4);
    const double s = to_seconds(static_cast<TimeNs>(k) * kStep);
    scatter(3) += vibration_angle_rad(s - wrong.vibration_late_s) - vibration_angle_rad(s);
    const Pose T_map_cam = truth[k].T_map_body.plus(scatter) * true_T_body_cam;
    PoseInformation m;
    Vector6d information;
    information << 1e6, 1e6, 1e6, 4e6, 4e6, 4e6;
    m.information = information.asDiagonal();
    m.vector = m.information * (T_map_cam * assumed.inverse()).minus(ekf.state().nav.T_map_body);
    ekf.update(m);
  }
  out.frozen /= updates;
  out.calibration = ekf.calibration();
  out.segments.assign(ekf.segments().begin(), ekf.segments().end());
  out.covariance = ekf.filter().joint_covariance();
  out.covariance =
      out.covariance.bottomRightCorner(ekf.filter().block_states(), ekf.filter().block_states()).eval();
  return out;
}

Found fly(const Wrong& wrong, const CalibrationConfig& calibration, int seconds) {
  return fly(wrong, flight_config(calibration), seconds);
}

double rotation_error_deg(const Calibration& found, const Eigen::Vector3d& turn) {
  return so3::log(found.turn * so3::exp(turn).conjugate()).norm() * 180 / M_PI;
}

TEST(Calibration, TimeOffsetOfTwentyMillisecondsIsFoundToATenth) {
  CalibrationConfig c = coarse();
  c.time_offset = true;
  for (const double offset_s : {-0.02, 0.0, 0.02}) {
    Wrong wrong;
    wrong.offset_s = offset_s;
    const Calibration found = fly(wrong, c, 5).calibration;
    EXPECT_NEAR(found.time_offset_s, offset_s, 1e-4);
    EXPECT_LT(std::abs(found.time_offset_s - offset_s), 4 * found.time_sigma_s + 1e-5);
    EXPECT_FALSE(found.frozen);
  }
}

TEST(Calibration, VibrationThatIsSeenLateIsNotTakenForATimeOffset) {
  CalibrationConfig c = coarse();
  c.time_offset = true;
  c.start_time_sigma_s = 2e-3;
  Wrong wrong;
  wrong.vibration_late_s = 2e-3;
  const Calibration found = fly(wrong, c, 5).calibration;
  EXPECT_LT(std::abs(found.time_offset_s), 2e-4);
  EXPECT_LT(std::abs(found.time_offset_s), 4 * found.time_sigma_s);
}

TEST(Calibration, RotationOfOneDegreeIsFoundToAFiftieth) {
  CalibrationConfig c = coarse();
  c.rotation = true;
  Wrong wrong;
  wrong.turn = Eigen::Vector3d(0.6, -0.5, 0.62) * (M_PI / 180);
  const Calibration found = fly(wrong, c, 12).calibration;
  EXPECT_LT(rotation_error_deg(found, wrong.turn), 0.02);
  EXPECT_LT(found.turn_sigma_rad.norm() * 180 / M_PI, 0.02);
}

TEST(Calibration, APoseThatTheCameraFoundDoesNotVouchForTheBody) {
  CalibrationConfig c = coarse();
  c.rotation = true;
  Wrong wrong;
  wrong.turn = Eigen::Vector3d(0.6, -0.5, 0.62) * (M_PI / 180);
  wrong.seen_anew = true;
  EXPECT_LT(rotation_error_deg(fly(wrong, c, 12).calibration, wrong.turn), 0.02);
}

TEST(Calibration, PlaceOfTheCameraIsFoundToAMillimetre) {
  CalibrationConfig c = coarse();
  c.translation = true;
  Wrong wrong;
  wrong.shift = {0.01, -0.015, 0.008};
  const Calibration found = fly(wrong, c, 12).calibration;
  EXPECT_LT((found.shift - wrong.shift).norm(), 1e-3);
  EXPECT_LT((found.shift - wrong.shift).cwiseQuotient(found.shift_sigma_m).cwiseAbs().maxCoeff(), 4);
}

TEST(Calibration, AllThreeAreFoundTogether) {
  CalibrationConfig c = coarse();
  c.time_offset = c.rotation = c.translation = true;
  Wrong wrong;
  wrong.offset_s = 0.005;
  wrong.turn = Eigen::Vector3d(-0.3, 0.5, 0.2) * (M_PI / 180);
  wrong.shift = {-0.005, 0.01, 0.004};
  const Calibration found = fly(wrong, c, 12).calibration;
  EXPECT_NEAR(found.time_offset_s, wrong.offset_s, 1e-4);
  EXPECT_LT(rotation_error_deg(found, wrong.turn), 0.02);
  EXPECT_LT((found.shift - wrong.shift).norm(), 1e-3);
}

TEST(Calibration, InHoverItIsFrozenAndSaidSo) {
  CalibrationConfig c = coarse();
  c.time_offset = c.rotation = c.translation = true;
  Wrong wrong;
  wrong.hover = true;
  wrong.turn = {0.01, 0, 0};
  const Found found = fly(wrong, c, 3);
  EXPECT_GT(found.frozen, 0.99);
  EXPECT_TRUE(found.calibration.frozen);
  EXPECT_EQ(found.calibration.time_offset_s, 0);
  EXPECT_EQ(found.calibration.shift, Eigen::Vector3d(0, 0, 0));
  EXPECT_EQ(found.calibration.time_sigma_s, c.start_time_sigma_s) << "what is not estimated stays as unsure";
}

TEST(Calibration, TiltOfTheMapIsFound) {
  CalibrationConfig c = coarse();
  c.gravity = true;
  Wrong wrong;
  wrong.tilt = {0.005, -0.004};
  const Calibration found = fly(wrong, c, 12).calibration;
  EXPECT_LT((found.gravity_tilt_rad - wrong.tilt).norm(), 4e-4);
  EXPECT_LT(
      (found.gravity_tilt_rad - wrong.tilt).cwiseQuotient(found.gravity_sigma_rad).cwiseAbs().maxCoeff(), 4);
}

TEST(Calibration, WhatWasFoundOutlivesANewStart) {
  FusionConfig c;
  c.calibration.time_offset = true;
  Ekf ekf(StatePropagator(MotionModel::imu, c, ImuNoise{}), c);
  NavState nav;
  nav.velocity = {1, 0, 0};
  ekf.start(0, nav, {0, 0, 0});
  // A velocity that changes, so that nothing is frozen.
  for (int k = 0; k < 50; ++k) {
    ekf.predict({k * kStep, {0, 0, 1}, {4, 0, 9.81}}, {(k + 1) * kStep, {0, 0, 1}, {4, 0, 9.81}},
                ImuTrust::good);
    PoseInformation m;
    m.information.diagonal().setConstant(1e6);
    m.vector(0) = 1e6 * 2e-3;
    ekf.update(m);
  }
  const Calibration before = ekf.calibration();
  EXPECT_NE(before.time_offset_s, 0);
  ekf.start(ekf.state());
  EXPECT_EQ(ekf.calibration().time_offset_s, before.time_offset_s);
  EXPECT_EQ(ekf.calibration().time_sigma_s, before.time_sigma_s);
}

TEST(Calibration, BeginsAsCorrelatedAsItIsStated) {
  CalibrationConfig c = coarse();
  c.time_offset = c.translation = c.intrinsics = true;
  c.start_intrinsics_sigma = Eigen::Vector4d(2, 3, 0.5, 0.25);
  c.start_correlation.setIdentity(11, 11);
  const auto set = [&](int a, int b, double r) { c.start_correlation(a, b) = c.start_correlation(b, a) = r; };
  set(0, 1, 0.9);   // both focal lengths
  set(2, 8, -0.6);  // the centre and a place of the camera
  set(9, 10, 0.3);  // another place and the time
  FusionState state;
  ErrorStateFilter filter;
  filter.reset_state(state);
  CalibrationStates(c, {}).start(filter);
  const Eigen::MatrixXd P =
      filter.joint_covariance().bottomRightCorner(9, 9);  // time, translation, intrinsics, vibration
  const double place_m = c.start_translation_sigma_m.x();
  EXPECT_DOUBLE_EQ(P(4, 5), 0.9 * 2 * 3);
  EXPECT_DOUBLE_EQ(P(6, 2), -0.6 * 0.5 * place_m);
  EXPECT_DOUBLE_EQ(P(2, 6), P(6, 2));
  EXPECT_DOUBLE_EQ(P(3, 0), 0.3 * place_m * c.start_time_sigma_s);
  EXPECT_DOUBLE_EQ(P(7, 7), 0.25 * 0.25);
  EXPECT_EQ(P(1, 4), 0);
}

TEST(Calibration, TheSeenPoseDependsOnItAsDifferencesSay) {
  CalibrationConfig c = coarse();
  c.time_offset = c.rotation = c.translation = true;
  const Pose given{so3::exp({0.1, -1.2, 0.4}), {0.1, 0.02, -0.05}};
  ErrorStateFilter filter;
  FusionState state;
  state.nav = {{so3::exp({0.3, -0.2, 1.1}), {1, 2, 3}}, {0.5, -1, 0.2}};
  state.angular_rate = {0.3, 0.7, -0.4};
  filter.reset_state(state);
  CalibrationStates states(c, given);
  states.start(filter);
  const std::vector<PoseShift> shifts = states.pose_shifts(state);
  ASSERT_EQ(shifts.size(), 4U);
  // The pose that a camera sees that is mounted, and timed, otherwise than given.
  const auto seen = [&](const Eigen::Matrix<double, 7, 1>& d) {
    const Pose body{state.nav.T_map_body.q * so3::exp(d(0) * state.angular_rate),
                    state.nav.T_map_body.p + d(0) * state.nav.velocity};
    const Pose mounted{so3::exp(d.segment<3>(1)) * given.q, given.p + d.tail<3>()};
    return body * mounted * given.inverse();
  };
  Eigen::Matrix<double, 6, 7> expected, got;
  for (int i = 0; i < 7; ++i) {
    const Eigen::Matrix<double, 7, 1> d = 1e-6 * Eigen::Matrix<double, 7, 1>::Unit(i);
    expected.col(i) = (seen(d).minus(state.nav.T_map_body) - seen(-d).minus(state.nav.T_map_body)) / 2e-6;
  }
  got << shifts[0].by_block, shifts[1].by_block, shifts[2].by_block;
  EXPECT_LT((got - expected).cwiseAbs().maxCoeff(), 1e-7);
  EXPECT_EQ(shifts[3].by_block, Vector6d::Zero());  // no vibration yet
}

/// A camera that is mounted and timed otherwise than given, before a map whose segments stand off.
TEST(Calibration, IsFoundTogetherWithTheOffsetsOfTheMap) {
  constexpr int kRuns = 8, kSegments = 24,
                kStates = 8 + kSegments;  // the eighth: vibration, which is only considered
  CalibrationConfig c = coarse();
  c.time_offset = c.rotation = c.translation = true;
  c.start_time_sigma_s = 3e-3;
  c.start_rotation_sigma_rad.setConstant(5e-3);
  c.start_translation_sigma_m.setConstant(5e-3);
  FusionConfig config = flight_config(c);
  config.segment_offsets = SegmentOffsetUse::on;
  constexpr double kOffsetSigma_m = 3e-3;
  config.segments.sigma_px = 200 * kOffsetSigma_m;  // in the image; the map states none
  config.start_position_sigma_m = 0.01;
  config.start_rotation_sigma_rad = 5e-3;
  double nees = 0, worst = 0;
  for (unsigned run = 0; run < kRuns; ++run) {
    std::mt19937 random(100 + run);
    Wrong wrong;
    wrong.offset_s = draw(random, c.start_time_sigma_s).x();
    wrong.turn = draw(random, c.start_rotation_sigma_rad.x());
    wrong.shift = draw(random, c.start_translation_sigma_m.x());
    wrong.start << draw(random, config.start_position_sigma_m), draw(random, config.start_rotation_sigma_rad);
    for (int i = 0; i < kSegments; ++i) wrong.offsets_m.push_back(draw(random, kOffsetSigma_m).x());
    const Found found = fly(wrong, config, 6, 200 + run);
    ASSERT_EQ(found.segments.size(), kSegments);
    ASSERT_EQ(found.covariance.rows(), kStates);
    EXPECT_LT(found.frozen, 0.2);
    Eigen::VectorXd error(kStates);
    error << wrong.offset_s - found.calibration.time_offset_s,
        so3::log(so3::exp(wrong.turn) * found.calibration.turn.conjugate()),
        wrong.shift - found.calibration.shift, Eigen::VectorXd::Zero(1 + kSegments);
    for (int i = 0; i < kSegments; ++i) {
      const SegmentOffsets::Segment& segment = found.segments[static_cast<std::size_t>(i)];
      error(8 + i) = wrong.offsets_m[segment.number] - segment.offset_m;
    }
    nees += error.dot(found.covariance.ldlt().solve(error)) / kStates / kRuns;
    const Eigen::VectorXd sigma = found.covariance.diagonal().cwiseSqrt();
    worst = std::max(worst, error.cwiseQuotient(sigma).cwiseAbs().maxCoeff());
    // Both are learnt: the calibration to a part of what was known, the map but for its place as a whole.
    EXPECT_LT(found.calibration.time_sigma_s, 0.05 * c.start_time_sigma_s);
    EXPECT_LT(found.calibration.turn_sigma_rad.maxCoeff(), 0.3 * c.start_rotation_sigma_rad.x());
    EXPECT_LT(found.calibration.shift_sigma_m.maxCoeff(), 0.5 * c.start_translation_sigma_m.x());
    EXPECT_LT(sigma.tail(kSegments).maxCoeff(), 0.8 * kOffsetSigma_m);
  }
  EXPECT_NEAR(nees, 1, 0.3);
  EXPECT_LT(worst, 4);
}

}  // namespace
}  // namespace evpose
