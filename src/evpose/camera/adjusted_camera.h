// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "evpose/camera/camera.h"

namespace evpose {

/// The intrinsics with each number changed by its entry, in that order.
CameraIntrinsics corrected(const CameraIntrinsics& given, const Eigen::VectorXd& correction);

/// A camera whose given intrinsics are corrected while it is in use. The numbers stand in the order fx, fy,
/// cx, cy (px), then `CameraIntrinsics::distortion`.
class AdjustedCamera final : public Camera {
 public:
  static constexpr int kMostNumbers = 9;
  using Correction = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMostNumbers, 1>;
  /// d pixel / d numbers.
  using ByNumbers = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::ColMajor, 2, kMostNumbers>;

  /// Errors as make_camera().
  static Expected<std::shared_ptr<AdjustedCamera>> create(const CameraIntrinsics& given);

  /// The numbers are the given ones plus `correction`, to within 0.002 px. A correction that makes no camera
  /// leaves the camera as it was, and is answered with false.
  bool set_correction(const Correction& correction);
  int numbers() const { return static_cast<int>(stepped_.size()); }
  /// At the given numbers; nothing where project() has nothing.
  std::optional<ByNumbers> by_numbers(const Eigen::Vector3d& point_cam) const;
  /// Stays as given.
  const Camera& given() const { return *given_; }

  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& point_cam,
                                         Matrix23d* jacobian = nullptr) const override {
    return now_->project(point_cam, jacobian);
  }
  std::optional<Eigen::Vector3d> unproject(const Eigen::Vector2d& pixel) const override {
    return now_->unproject(pixel);
  }
  double valid_angle() const override { return now_->valid_angle(); }
  ImageSize size() const override { return now_->size(); }
  double focal_px() const override { return now_->focal_px(); }
  std::string model() const override { return now_->model(); }

 private:
  AdjustedCamera(const CameraIntrinsics& given, std::shared_ptr<const Camera> camera);

  CameraIntrinsics numbers_;  ///< as given
  std::shared_ptr<const Camera> given_, now_;
  Correction applied_;                                  ///< in now_
  Correction step_;                                     ///< moves a pixel at the image's rim by about 0.01 px
  std::vector<std::shared_ptr<const Camera>> stepped_;  ///< given + step, number by number
};

}  // namespace evpose
