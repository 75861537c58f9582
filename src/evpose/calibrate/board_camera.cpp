// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/board_camera.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "evpose/camera/adjusted_camera.h"

namespace evpose {
namespace {

constexpr double kLeastPoint_px =
    0.3;                           // 1 sigma of a point along each axis: light and motion move all of a view
constexpr double kOutlier_px = 3;  // RMS of a view
constexpr int kMostSteps = 200;
constexpr double kSmallStep = 1e-10;  // relative change of the cost
constexpr std::size_t kLeastViews = 3;

using Matrix26d = Eigen::Matrix<double, 2, 6>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// d pixel by Pose::plus: position in the map frame, rotation in that of the camera.
Matrix26d by_pose(const Matrix23d& by_point, const Eigen::Matrix3d& R_cam_map,
                  const Eigen::Vector3d& point_cam) {
  Matrix26d out;
  out << -by_point * R_cam_map, by_point * so3::hat(point_cam);
  return out;
}

/// Normal equations of the intrinsics and one pose each view; a pose's rows come after the intrinsics'.
struct NormalEquations {
  Eigen::MatrixXd H;
  Eigen::VectorXd b;
  double cost = 0;
};

class BoardAdjustment {
 public:
  BoardAdjustment(const CameraIntrinsics& given, const Eigen::MatrixXd& covariance,
                  const BoardLattice& lattice, std::vector<BoardView>* views)
      : given_(given),
        prior_(covariance.ldlt().solve(Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()))),
        lattice_(lattice),
        views_(*views),
        numbers_(Eigen::VectorXd::Zero(covariance.rows())) {}

  /// With points that scatter as they do. False where the given intrinsics do not see all of them.
  bool solve() {
    if (!minimise()) return false;
    const double sigma_px = std::max(kLeastPoint_px, rms_px() / std::numbers::sqrt2);
    weight_ = 1 / (sigma_px * sigma_px);
    return minimise();
  }

  const Eigen::VectorXd& numbers() const { return numbers_; }
  /// Of the numbers, at what was found.
  Eigen::VectorXd sigma() const {
    const Eigen::Index n = numbers_.size();
    const Eigen::MatrixXd covariance =
        last_.H.ldlt().solve(Eigen::MatrixXd::Identity(last_.H.rows(), last_.H.cols()));
    return covariance.topLeftCorner(n, n).diagonal().cwiseSqrt();
  }

  double rms_px() const {
    double sum = 0;
    for (const BoardView& view : views_) sum += view.rms_px * view.rms_px;
    return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, views_.size())));
  }

 private:
  bool minimise() {
    double damping = 1e-3;
    NormalEquations now = equations();
    if (now.H.size() == 0) return false;
    for (int i = 0; i < kMostSteps && damping < 1e9; ++i) {
      Eigen::MatrixXd H = now.H;
      H.diagonal() *= 1 + damping;
      const Eigen::VectorXd step = H.ldlt().solve(now.b);
      const std::vector<BoardView> kept = views_;
      const Eigen::VectorXd kept_numbers = numbers_;
      NormalEquations next;
      if (step.allFinite()) {
        apply(step);
        next = equations();
      }
      if (!(next.H.size() > 0 && next.cost < now.cost)) {
        views_ = kept;
        numbers_ = kept_numbers;
        damping *= 10;
        continue;
      }
      const bool rests = now.cost - next.cost < kSmallStep * now.cost;
      now = std::move(next);
      damping *= 0.1;
      if (rests) break;
    }
    last_ = std::move(now);
    return true;
  }

  void apply(const Eigen::VectorXd& step) {
    const Eigen::Index n = numbers_.size();
    numbers_ += step.head(n);
    for (std::size_t k = 0; k < views_.size(); ++k)
      views_[k].T_map_cam = views_[k].T_map_cam.plus(step.segment<6>(n + 6 * static_cast<Eigen::Index>(k)));
  }

  /// Linearised where the numbers are now. Empty where they make no camera, or a point is not in front of it.
  NormalEquations equations() {
    // Its derivatives are those at the numbers it was made with.
    const auto camera = AdjustedCamera::create(corrected(given_, numbers_));
    if (!camera) return {};
    const Eigen::Index n = numbers_.size(), all = n + 6 * static_cast<Eigen::Index>(views_.size());
    NormalEquations out{Eigen::MatrixXd::Zero(all, all), Eigen::VectorXd::Zero(all),
                        numbers_.dot(prior_ * numbers_)};
    out.H.topLeftCorner(n, n) = prior_;
    out.b.head(n) = -prior_ * numbers_;
    for (std::size_t k = 0; k < views_.size(); ++k)
      if (!add(**camera, views_[k], n + 6 * static_cast<Eigen::Index>(k), &out)) return {};
    return out;
  }

  bool add(const AdjustedCamera& camera, BoardView& view, Eigen::Index place, NormalEquations* out) const {
    const Eigen::Index n = numbers_.size();
    const Pose T_cam_map = view.T_map_cam.inverse();
    const Eigen::Matrix3d R_cam_map = T_cam_map.rotation();
    double squares = 0, seen = 0;
    for (std::size_t i = 0; i < lattice_.points.size(); ++i) {
      if (!view.pixels[i].allFinite()) continue;
      const Eigen::Vector3d point = T_cam_map * lattice_.points[i];
      Matrix23d by_point;
      const auto pixel = camera.project(point, &by_point);
      const auto by_numbers = camera.by_numbers(point);
      if (!pixel || !by_numbers) return false;
      const Eigen::Vector2d error = view.pixels[i] - *pixel;
      squares += error.squaredNorm();
      ++seen;
      const Matrix26d J = by_pose(by_point, R_cam_map, point);
      out->H.topLeftCorner(n, n) += weight_ * by_numbers->transpose() * *by_numbers;
      out->H.block(0, place, n, 6) += weight_ * by_numbers->transpose() * J;
      out->H.block(place, place, 6, 6) += weight_ * J.transpose() * J;
      out->b.head(n) += weight_ * by_numbers->transpose() * error;
      out->b.segment(place, 6) += weight_ * J.transpose() * error;
      out->cost += weight_ * error.squaredNorm();
    }
    out->H.block(place, 0, 6, n) = out->H.block(0, place, n, 6).transpose();
    view.rms_px = std::sqrt(squares / std::max(1.0, seen));
    return true;
  }

  const CameraIntrinsics given_;
  const Eigen::MatrixXd prior_;
  const BoardLattice& lattice_;
  std::vector<BoardView>& views_;
  Eigen::VectorXd numbers_;
  double weight_ = 1;  ///< of a point, 1 / px^2
  NormalEquations last_;
};

/// Plane (x, z) of the board to (x, y, 1) of the camera, up to its scale.
Eigen::Matrix3d homography_of(const std::vector<Eigen::Vector2d>& plane,
                              const std::vector<Eigen::Vector2d>& seen) {
  Eigen::MatrixXd A(2 * static_cast<Eigen::Index>(plane.size()), 9);
  for (std::size_t i = 0; i < plane.size(); ++i) {
    const Eigen::RowVector3d p(plane[i].x(), plane[i].y(), 1);
    const auto row = 2 * static_cast<Eigen::Index>(i);
    A.row(row) << p, Eigen::RowVector3d::Zero(), -seen[i].x() * p;
    A.row(row + 1) << Eigen::RowVector3d::Zero(), p, -seen[i].y() * p;
  }
  const Eigen::VectorXd h = Eigen::JacobiSVD<Eigen::MatrixXd>(A, Eigen::ComputeFullV).matrixV().col(8);
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(h.data());
}

}  // namespace

std::optional<Pose> pose_before_board(const Camera& camera, const BoardLattice& lattice,
                                      const LatticePixels& pixels) {
  std::vector<Eigen::Vector2d> plane, seen;
  const double scale = lattice.points.front().norm();  // the equations are well conditioned in that unit
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (!pixels[i].allFinite()) continue;
    const auto ray = camera.unproject(pixels[i]);
    if (!ray || !(ray->z() > 0.1)) continue;
    plane.emplace_back(lattice.points[i].x() / scale, lattice.points[i].z() / scale);
    seen.push_back(ray->head<2>() / ray->z());
  }
  if (plane.size() < 4) return {};
  Eigen::Matrix3d H = homography_of(plane, seen);
  H *= 2 / (H.col(0).norm() + H.col(1).norm());
  if (H(2, 2) < 0) H = -H;
  // Columns: the board's x and z, and its middle; its y completes them.
  Eigen::Matrix3d axes;
  axes << H.col(0), -H.col(0).cross(H.col(1)), H.col(1);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(axes, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d R = svd.matrixU() * svd.matrixV().transpose();
  if (!(R.determinant() > 0) || !R.allFinite()) return {};
  return Pose{Eigen::Quaterniond(R), scale * H.col(2)}.inverse();
}

std::optional<Pose> best_pose_before_board(const Camera& camera, const BoardLattice& lattice,
                                           const LatticePixels& pixels) {
  auto pose = pose_before_board(camera, lattice, pixels);
  constexpr int kSteps = 10;
  for (int step = 0; pose && step < kSteps; ++step) {
    const Pose T_cam_map = pose->inverse();
    const Eigen::Matrix3d R_cam_map = T_cam_map.rotation();
    Matrix6d H = Matrix6d::Zero();
    Vector6d b = Vector6d::Zero();
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      if (!pixels[i].allFinite()) continue;
      const Eigen::Vector3d point = T_cam_map * lattice.points[i];
      Matrix23d by_point;
      const auto pixel = camera.project(point, &by_point);
      if (!pixel) return {};
      const Matrix26d J = by_pose(by_point, R_cam_map, point);
      H += J.transpose() * J;
      b += J.transpose() * (pixels[i] - *pixel);
    }
    pose = pose->plus(H.ldlt().solve(b));
    if (!pose->p.allFinite() || !pose->q.coeffs().allFinite()) return {};
  }
  return pose;
}

Expected<BoardCamera> fit_board_camera(const CameraIntrinsics& given, const Eigen::MatrixXd& covariance,
                                       const BoardLattice& lattice, std::vector<BoardView>* views) {
  const auto camera = make_camera(given);
  if (!camera) return camera.error();
  const auto pose = [&](BoardView& view) {
    const auto found = pose_before_board(**camera, lattice, view.pixels);
    if (found) view.T_map_cam = *found;
    return !found;
  };
  std::erase_if(*views, pose);
  const Error few{"the board", text("is whole in ", views->size(), " pictures of the events only"),
                  "record it whole, from several sides, for some seconds"};
  if (views->size() < kLeastViews) return few;
  BoardAdjustment adjustment(given, covariance, lattice, views);
  const Error none{"the board", "its pictures fit no camera", "check its sizes and the focal length"};
  if (!adjustment.solve()) return none;
  const auto wrong = [](const BoardView& view) { return view.rms_px > kOutlier_px; };
  if (std::ranges::any_of(*views, wrong)) {
    std::erase_if(*views, wrong);
    if (views->size() < kLeastViews || !adjustment.solve()) return none;
  }
  return BoardCamera{adjustment.numbers(), adjustment.sigma(), adjustment.rms_px()};
}

}  // namespace evpose
