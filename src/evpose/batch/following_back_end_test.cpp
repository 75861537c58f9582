// SPDX-License-Identifier: BSD-3-Clause
// Whole flights and their calibration at once: contours in space, seen by a camera that is not as given.
#include "evpose/batch/following_back_end.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

#include "evpose/camera/adjusted_camera.h"
#include "evpose/camera/calibration_sigma.h"
#include "evpose/fusion/shared_errors.h"
#include "evpose/tracker/test_flight.h"

namespace evpose {
namespace {

using test_flight::imu_at;
using test_flight::kStart_ns;
using test_flight::pose_at;
using test_flight::velocity_at;

const CameraIntrinsics kGiven{381, 382, 322, 237, "radtan", {-0.1, 0.02, 5e-4, -3e-4}, {640, 480}};
constexpr int kNumbers = 8, kCalibration = 7 + kNumbers;
constexpr double kWeight_px2 = 25;  // of a contour: a fifth of a pixel
constexpr double kImuStep_s = 5e-3, kUpdateStep_s = 1e-2;
constexpr int kContours = 60;
constexpr int kAxes = 18;  // of the IMU

FusionConfig settings() {
  FusionConfig config;
  config.imu_noise_scale = 1;
  config.imu_scale_sigma = 0;
  CalibrationConfig& c = config.calibration;
  c.time_offset = c.rotation = c.translation = c.intrinsics = true;
  c.start_intrinsics_sigma = CalibrationSigma().of_intrinsics(kGiven);
  return config;
}

/// With that sigma of each element; 0: they are ideal and believed.
StaticParameters parameters_with(double axes_sigma) {
  ImuAxes axes;
  axes.gyro_sigma.setConstant(axes_sigma), axes.accel_sigma.setConstant(axes_sigma);
  using enum StaticParameters::Shared;
  return axes_sigma > 0 ? StaticParameters(settings(), estimated, axes)
                        : StaticParameters(settings(), estimated);
}

class Flight {
 public:
  Flight(unsigned seed, double duration_s, double axes_sigma = 0)
      : random_(seed), duration_s_(duration_s), parameters_(parameters_with(axes_sigma)) {
    noise_.gyro_density = 2e-3, noise_.accel_density = 2e-2, noise_.gyro_walk = noise_.accel_walk = 1e-5;
    const FusionConfig config = settings();
    const CalibrationConfig& c = config.calibration;
    errors_.resize(parameters_.calibration_size());
    errors_(0) = c.start_time_sigma_s * normal_(random_);
    errors_.segment<3>(1) = c.start_rotation_sigma_rad.x() * draw();
    errors_.segment<3>(4) = c.start_translation_sigma_m.x() * draw();
    for (Eigen::Index i = 0; i < kNumbers; ++i)
      errors_(7 + i) = c.start_intrinsics_sigma(i) * normal_(random_);
    for (Eigen::Index i = kCalibration; i < errors_.size(); ++i) errors_(i) = axes_sigma * normal_(random_);
    gyro_bias_ = config.start_gyro_bias_sigma_rad_s * draw();
    accel_bias_ = config.start_accel_bias_sigma_m_s2 * draw();
    const StatePropagator propagator(MotionModel::imu, config, noise_);
    start_ = propagator.initial_state(kStart_ns, {pose_at(0), velocity_at(0)}, Eigen::Vector3d::Zero());
    Vector15d off;
    for (int i = 0; i < 15; ++i) off(i) = i < 9 ? std::sqrt(start_.covariance(i, i)) * normal_(random_) : 0;
    start_.add(off);
    for (int i = 1; i < SharedErrors::kCount; ++i) shared_errors_(i) = normal_(random_);
    make_imu();
    make_contours();
    for (int k = 0; k * kUpdateStep_s < duration_s; ++k)
      trajectory_.push_back(first_guess(k * kUpdateStep_s));
  }

  /// Largest change of the calibration over its sigma.
  double iterate() {
    const Calibration& now = parameters_.calibration();
    const Pose T_body_cam{now.turn * given_.q, given_.p + now.shift};
    const auto camera = *AdjustedCamera::create(corrected(kGiven, now.intrinsics));
    ChainSmoother chain;
    FollowingBackEnd follow(StatePropagator(MotionModel::imu, settings(), noise_), trajectory_, T_body_cam,
                            parameters_, chain);
    follow.start(start_);
    PixelNoise pixels;  // the same in each pass
    std::size_t next = 1;
    const ImuAxes axes = parameters_.corrected(ImuAxes());
    for (std::size_t i = 0; i + 1 < imu_.size() && next < trajectory_.size(); ++i) {
      follow.predict(axes.corrected(imu_[i]), axes.corrected(imu_[i + 1]), ImuTrust::good);
      if (follow.state().t != trajectory_[next].t) continue;
      measure(follow, *camera, T_body_cam, pixels);
      ++next;
    }
    const ParameterSolution found = parameters_.solve(chain.parameters());
    const Eigen::Index n = parameters_.calibration_size();
    covariance_ = found.covariance.topLeftCorner(n, n);
    const Eigen::VectorXd z = found.z.head(n);
    const auto smoothed = chain.smooth(found.z, found.covariance);
    for (std::size_t k = 0; k < smoothed.size(); ++k) {
      trajectory_[k].add(smoothed[k].mean);
      trajectory_[k].covariance = smoothed[k].covariance;
    }
    parameters_.correct(found);
    return z.cwiseQuotient(covariance_.diagonal().cwiseSqrt()).cwiseAbs().maxCoeff();
  }

  Eigen::VectorXd calibration_error() const { return parameters_.calibration_errors() - errors_; }
  double calibration_nees() const {
    const Eigen::VectorXd e = calibration_error();
    return e.dot(covariance_.ldlt().solve(e)) / static_cast<double>(e.size());
  }
  /// Of the IMU's axes alone.
  double axes_nees() const {
    const Eigen::VectorXd e = calibration_error().tail<kAxes>();
    return e.dot(covariance_.bottomRightCorner<kAxes, kAxes>().ldlt().solve(e)) / kAxes;
  }
  /// Mean over the flight, of pose and velocity.
  double state_nees() const {
    double sum = 0;
    for (const FusionState& s : trajectory_) {
      const double t_s = to_seconds(s.t - kStart_ns);
      Eigen::Matrix<double, 9, 1> e;
      e << s.nav.T_map_body.minus(pose_at(t_s)), s.nav.velocity - velocity_at(t_s);
      sum += e.dot(s.covariance.topLeftCorner<9, 9>().ldlt().solve(e)) / 9;
    }
    return sum / static_cast<double>(trajectory_.size());
  }
  const Eigen::MatrixXd& covariance() const { return covariance_; }

 private:
  struct PixelNoise {
    std::mt19937 random{99};
    std::normal_distribution<double> normal;
  };
  Eigen::Vector3d draw() {
    const double x = normal_(random_), y = normal_(random_), z = normal_(random_);
    return {x, y, z};
  }
  void make_imu() {
    const double gyro = noise_.gyro_density / std::sqrt(kImuStep_s),
                 accel = noise_.accel_density / std::sqrt(kImuStep_s);
    for (int i = 0; i * kImuStep_s < duration_s_ + kImuStep_s; ++i) {
      ImuSample s = imu_at(i * kImuStep_s);
      if (errors_.size() > kCalibration) {
        using RowMajor3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
        s.gyro += Eigen::Map<const RowMajor3d>(&errors_(kCalibration)) * Eigen::Vector3d(s.gyro);
        s.accel += Eigen::Map<const RowMajor3d>(&errors_(kCalibration + 9)) * Eigen::Vector3d(s.accel);
      }
      s.gyro += gyro_bias_ + gyro * draw();
      s.accel += accel_bias_ + accel * draw();
      imu_.push_back(s);
    }
  }
  void make_contours() {
    std::uniform_real_distribution<double> unit(-1, 1);
    for (int i = 0; i < kContours; ++i) {
      const Eigen::Vector3d along(unit(random_), unit(random_), unit(random_));
      contours_.push_back({{4 + 1.2 * unit(random_), 3 + 2.2 * unit(random_), 1.5 + 1.6 * unit(random_)},
                           along.normalized()});
    }
  }
  /// A trajectory to begin with: off by what a filter is off.
  FusionState first_guess(double t_s) {
    FusionState state;
    state.t = kStart_ns + from_seconds(t_s);
    Vector6d off;
    off << 2e-3 * draw(), 1e-3 * draw();
    state.nav = {pose_at(t_s).plus(off), velocity_at(t_s) + 0.02 * draw()};
    state.covariance.setIdentity();
    return state;
  }
  /// What the flight's shared errors do to this contour.
  double shared_offset_px(const ContourOffset& contour) const {
    double out = 0;
    for (const auto& [number, px] : SharedErrors::on(contour)) out += px * shared_errors_(number);
    return out;
  }
  void measure(FollowingBackEnd& follow, const AdjustedCamera& camera, const Pose& T_body_cam,
               PixelNoise& pixels) {
    const FusionState& state = follow.state();
    const double seen_s =
        to_seconds(state.t - kStart_ns) + errors_(0) - parameters_.calibration().time_offset_s;
    const Pose true_mount{so3::exp(errors_.segment<3>(1)) * given_.q, given_.p + errors_.segment<3>(4)};
    const Pose T_map_cam = pose_at(seen_s) * true_mount;
    const auto seen_by = *make_camera(corrected(kGiven, errors_.segment<kNumbers>(7)));
    const Pose& at = state.nav.T_map_body;
    PoseInformation sum;
    std::vector<ContourOffset> offsets;
    for (const auto& [point, along] : contours_) {
      const double noise_px = pixels.normal(pixels.random) / std::sqrt(kWeight_px2);
      const Eigen::Vector3d x_body = at.inverse() * point, x_cam = T_body_cam.inverse() * x_body;
      Matrix23d J;
      const auto pixel = camera.project(x_cam, &J);
      const auto seen = seen_by->project(T_map_cam.inverse() * point);
      const auto by_numbers = camera.by_numbers(x_cam);
      if (!pixel || !seen || !by_numbers || !camera.size().contains(*pixel)) continue;
      const Eigen::Vector2d line = J * (T_body_cam.q.conjugate() * (at.q.conjugate() * along));
      const Eigen::Vector2d n = Eigen::Vector2d(-line.y(), line.x()).normalized();
      ContourOffset o{x_body, T_body_cam.q * Eigen::Vector3d(J.transpose() * n), 0, kWeight_px2};
      o.normal_px = n;
      o.offset_px = -n.dot(*seen - *pixel) + noise_px + shared_offset_px(o);
      o.by_intrinsics = -n.transpose() * *by_numbers;
      const Vector6d by_pose = o.by_pose(at.rotation());
      sum.information += o.weight * by_pose * by_pose.transpose();
      sum.vector += o.weight * o.offset_px * by_pose;
      offsets.push_back(o);
    }
    follow.update(sum, offsets);
  }

  std::mt19937 random_;
  std::normal_distribution<double> normal_;
  double duration_s_;
  StaticParameters parameters_;
  ImuNoise noise_;
  const Pose given_ = test_flight::camera_on_body();
  Eigen::VectorXd errors_;  ///< of what was given, in the order of the parameters
  Eigen::VectorXd shared_errors_ = Eigen::VectorXd::Zero(SharedErrors::kCount);  ///< in sigmas
  Eigen::Vector3d gyro_bias_, accel_bias_;
  FusionState start_;
  std::vector<ImuSample> imu_;
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> contours_;  ///< point, direction
  std::vector<FusionState> trajectory_;
  Eigen::MatrixXd covariance_;
};

TEST(FollowingBackEnd, CalibrationAndTrajectoryAreFoundUnderTheirStatedSigma) {
  constexpr int kRuns = 10;
  double calibration = 0, state = 0;
  for (unsigned run = 0; run < kRuns; ++run) {
    Flight flight(100 + run, 2);
    double change = 1;
    for (int pass = 0; pass < 4; ++pass) change = flight.iterate();
    EXPECT_LT(change, 0.1);  // contours at the rim of the image come and go from pass to pass
    calibration += flight.calibration_nees() / kRuns;
    state += flight.state_nees() / kRuns;
  }
  EXPECT_NEAR(calibration, 1, 0.3);
  EXPECT_NEAR(state, 1, 0.3);
}

TEST(FollowingBackEnd, AxesOfTheImuAreFoundUnderTheirStatedSigma) {
  constexpr int kRuns = 10;
  constexpr double kSigma = 0.02;
  double axes = 0, calibration = 0, state = 0;
  Eigen::VectorXd left = Eigen::VectorXd::Zero(kAxes);  // of the sigma
  for (unsigned run = 0; run < kRuns; ++run) {
    Flight flight(300 + run, 2, kSigma);
    double change = 1;
    for (int pass = 0; pass < 5; ++pass) change = flight.iterate();
    EXPECT_LT(change, 0.1);
    axes += flight.axes_nees() / kRuns;
    calibration += flight.calibration_nees() / kRuns;
    state += flight.state_nees() / kRuns;
    left += flight.covariance().diagonal().tail<kAxes>().cwiseSqrt() / (kSigma * kRuns);
  }
  EXPECT_NEAR(axes, 1, 0.3);
  EXPECT_NEAR(calibration, 1, 0.3);
  EXPECT_NEAR(state, 1, 0.3);
  EXPECT_LT(left.minCoeff(), 0.6);  // what the motion tells best
  EXPECT_LE(left.maxCoeff(), 1 + 1e-9);
}

TEST(FollowingBackEnd, MoreFlightTellsMore) {
  Flight brief(7, 0.5), whole(7, 2);
  for (int pass = 0; pass < 3; ++pass) brief.iterate(), whole.iterate();
  for (int i = 0; i < kCalibration; ++i) EXPECT_LT(whole.covariance()(i, i), brief.covariance()(i, i)) << i;
}

}  // namespace
}  // namespace evpose
