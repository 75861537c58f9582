// SPDX-License-Identifier: BSD-3-Clause
// The camera's numbers as states of the filter: contours in space, seen by a camera that is not as given.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <optional>
#include <random>

#include "evpose/camera/adjusted_camera.h"
#include "evpose/camera/calibration_sigma.h"
#include "evpose/fusion/ekf.h"

namespace evpose {
namespace {

const CameraIntrinsics kGiven{381, 382, 322, 237, "radtan", {-0.1, 0.02, 5e-4, -3e-4}, {640, 480}};
constexpr int kNumbers = 8;
constexpr double kWeight_px2 = 100;  // of a contour: a tenth of a pixel
constexpr TimeNs kStep = 5 * kNsPerMs;

CameraIntrinsics changed(const AdjustedCamera::Correction& by) {
  CameraIntrinsics out = kGiven;
  out.fx += by(0), out.fy += by(1), out.cx += by(2), out.cy += by(3);
  for (Eigen::Index i = 0; i < 4; ++i) out.distortion[static_cast<std::size_t>(i)] += by(4 + i);
  return out;
}

/// Straight contours in a room around the camera.
struct Contour {
  Eigen::Vector3d point, along;
};
std::vector<Contour> make_contours(int count, std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1, 1);
  std::vector<Contour> out;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d point(3 * unit(random), 2.4 * unit(random), 3.5 + 1.5 * unit(random));
    out.push_back({point, Eigen::Vector3d(unit(random), unit(random), unit(random)).normalized()});
  }
  return out;
}

/// A camera without an IMU; body and camera are one.
class Flight {
 public:
  explicit Flight(unsigned seed) : random_(seed) {
    camera_ = *AdjustedCamera::create(kGiven);
    FusionConfig config;
    config.calibration.intrinsics = true;
    config.calibration.start_intrinsics_sigma = CalibrationSigma{}.of_intrinsics(kGiven);
    AdjustedCamera::Correction error(kNumbers);
    for (Eigen::Index i = 0; i < kNumbers; ++i)
      error(i) = config.calibration.start_intrinsics_sigma(i) * normal_(random_);
    error_ = error;
    seen_by_ = *make_camera(changed(error));
    contours_ = make_contours(150, random_);
    ekf_.emplace(StatePropagator(MotionModel::constant_velocity, config, ImuNoise{}), config);
    const auto draw = [&](double sigma) {
      const double x = normal_(random_), y = normal_(random_), z = normal_(random_);
      return Eigen::Vector3d(sigma * x, sigma * y, sigma * z);
    };
    Vector6d start;
    start.head<3>() = draw(config.start_position_sigma_m);
    start.tail<3>() = draw(config.start_rotation_sigma_rad);
    ekf_->start(0, {truth(0).plus(start), {0, 0, 0}}, {0, 0, 0});
  }

  /// From rest.
  static Pose truth(double t_s) {
    const auto swing = [t_s](double rate) { return 1 - std::cos(rate * t_s); };
    return {so3::exp({0.15 * swing(2), 0.2 * swing(1.7), 0.1 * swing(1)}),
            {0.5 * swing(1.5), 0.4 * swing(1.2), 0.5 * swing(0.9)}};
  }

  void fly(double seconds) {
    for (TimeNs t = kStep; t <= from_seconds(seconds); t += kStep) {
      ekf_->predict(t);
      measure(truth(to_seconds(t)));
      t_s_ = to_seconds(t);
    }
  }

  /// Error of pose and numbers, true minus found.
  Eigen::VectorXd error() const {
    Eigen::VectorXd out(6 + kNumbers);
    out << truth(t_s_).minus(ekf_->state().nav.T_map_body), error_ - ekf_->calibration().intrinsics;
    return out;
  }
  Eigen::MatrixXd covariance() const {
    const Eigen::MatrixXd all = ekf_->filter().joint_covariance();
    std::vector<int> wanted = {0, 1, 2, 3, 4, 5};
    for (int i = 0; i < kNumbers; ++i) wanted.push_back(15 + i);
    return all(wanted, wanted);
  }
  /// Normalised estimation error squared, by its degrees of freedom.
  double nees() const {
    const Eigen::VectorXd e = error();
    return e.dot(covariance().ldlt().solve(e)) / static_cast<double>(e.size());
  }
  const Ekf& ekf() const { return *ekf_; }

 private:
  void measure(const Pose& T_map_cam) {
    const Pose predicted = ekf_->state().nav.T_map_body;
    PoseInformation sum;
    std::vector<ContourOffset> offsets;
    for (const Contour& c : contours_) {
      const Eigen::Vector3d at = predicted.inverse() * c.point;
      Matrix23d J;
      const auto pixel = camera_->project(at, &J);
      const auto seen = seen_by_->project(T_map_cam.inverse() * c.point);
      const auto by_numbers = camera_->by_numbers(at);
      if (!pixel || !seen || !by_numbers || !camera_->size().contains(*pixel)) continue;
      const Eigen::Vector2d along = J * (predicted.q.conjugate() * c.along);
      const Eigen::Vector2d n = Eigen::Vector2d(-along.y(), along.x()).normalized();
      ContourOffset o{at, J.transpose() * n, 0, kWeight_px2};
      o.offset_px = -n.dot(*seen - *pixel) + normal_(random_) / std::sqrt(kWeight_px2);
      o.by_intrinsics = -n.transpose() * *by_numbers;
      const Vector6d by_pose = o.by_pose(predicted.rotation());
      sum.information += o.weight * by_pose * by_pose.transpose();
      sum.vector += o.weight * o.offset_px * by_pose;
      offsets.push_back(o);
    }
    ekf_->update(sum, offsets);
    ASSERT_TRUE(camera_->set_correction(ekf_->calibration().intrinsics));
  }

  std::mt19937 random_;
  std::normal_distribution<double> normal_{0, 1};
  std::shared_ptr<AdjustedCamera> camera_;
  std::shared_ptr<const Camera> seen_by_;
  Eigen::VectorXd error_;
  std::vector<Contour> contours_;
  std::optional<Ekf> ekf_;
  double t_s_ = 0;
};

TEST(Intrinsics, AreFoundWithThePoseUnderTheirStatedSigma) {
  constexpr int kRuns = 12;
  double nees = 0;
  for (unsigned run = 0; run < kRuns; ++run) {
    Flight flight(300 + run);
    flight.fly(2);
    nees += flight.nees() / kRuns;
    const Eigen::VectorXd start = CalibrationSigma{}.of_intrinsics(kGiven);
    const Eigen::VectorXd sigma = flight.ekf().calibration().intrinsics_sigma;
    for (Eigen::Index i = 0; i < kNumbers; ++i)
      EXPECT_LT(sigma(i), (i < 6 ? 0.1 : 0.3) * start(i)) << "number " << i;
    EXPECT_LT(1e3 * flight.error().head<3>().norm(), 2);  // mm
  }
  EXPECT_NEAR(nees, 1, 0.4);
}

TEST(Intrinsics, FromTheFirstUpdateOnTheCovarianceCoversWhatTheyDoToThePose) {
  constexpr int kRuns = 40;
  double nees = 0;
  for (unsigned run = 0; run < kRuns; ++run) {
    Flight flight(500 + run);
    flight.fly(0.1);
    nees += flight.nees() / kRuns;
  }
  EXPECT_NEAR(nees, 1, 0.3);
}

}  // namespace
}  // namespace evpose
