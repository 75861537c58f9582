// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/residual_field.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

constexpr int kColumns = 16;     // of cells over the image's width
constexpr int kRings = 10;       // from the middle of the image to its corner
constexpr int kLeastSeen = 30;   // contours of a cell or a ring
constexpr double kLeast = 0.05;  // of both directions, in a cell: smaller to larger share of information
constexpr int kGrid = 21;        // places along the width at which two models are compared

}  // namespace

ResidualField::ResidualField(ImageSize size)
    : size_(size),
      columns_(kColumns),
      rows_(std::max(1, kColumns * size.height / std::max(1, size.width))),
      cells_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)),
      rings_(kRings) {}

void ResidualField::add(std::span<const ContourOffset> contours, const Camera& camera,
                        const Pose& T_body_cam) {
  const Eigen::Vector2d middle(0.5 * (size_.width - 1), 0.5 * (size_.height - 1));
  const Pose T_cam_body = T_body_cam.inverse();
  for (const ContourOffset& c : contours) {
    const auto pixel = camera.project(T_cam_body * c.point_body);
    if (!pixel || !size_.contains(*pixel)) continue;
    // The offset is that by which the contour should move against the normal.
    const double offset = -c.offset_px;
    const auto column = static_cast<int>(pixel->x() * columns_ / size_.width),
               row = static_cast<int>(pixel->y() * rows_ / size_.height);
    Cell& cell = cells_[static_cast<std::size_t>(row * columns_ + column)];
    cell.information += c.weight * c.normal_px * c.normal_px.transpose();
    cell.vector += c.weight * offset * c.normal_px;
    ++cell.seen;
    const Eigen::Vector2d out = *pixel - middle;
    const double radius = out.norm(), share = radius / middle.norm();
    if (!(radius > 0)) continue;
    Ring& ring = rings_[std::min<std::size_t>(kRings - 1, static_cast<std::size_t>(share * kRings))];
    const double cosine = c.normal_px.dot(out) / radius;
    ring.weight += c.weight;
    ring.offset += c.weight * cosine * offset;
    ring.squared_cosine += c.weight * cosine * cosine;
    ring.square += c.weight * offset * offset;
    ++ring.seen;
  }
}

std::vector<FieldArrow> ResidualField::arrows() const {
  std::vector<FieldArrow> out;
  for (int row = 0; row < rows_; ++row)
    for (int column = 0; column < columns_; ++column) {
      const Cell& cell = cells_[static_cast<std::size_t>(row * columns_ + column)];
      if (cell.seen < kLeastSeen) continue;
      const Eigen::Vector2d shares =
          Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(cell.information).eigenvalues();
      if (!(shares(0) > kLeast * shares(1))) continue;
      out.push_back({{(column + 0.5) * size_.width / columns_, (row + 0.5) * size_.height / rows_},
                     cell.information.ldlt().solve(cell.vector)});
    }
  return out;
}

std::vector<RadiusBin> ResidualField::by_radius() const {
  std::vector<RadiusBin> out;
  const double reach = 0.5 * std::hypot(size_.width - 1, size_.height - 1) / kRings;
  for (int k = 0; k < kRings; ++k) {
    const Ring& ring = rings_[static_cast<std::size_t>(k)];
    if (ring.seen < kLeastSeen || !(ring.squared_cosine > 0)) continue;
    out.push_back({(k + 0.5) * reach, ring.offset / ring.squared_cosine, std::sqrt(ring.square / ring.weight),
                   ring.seen});
  }
  return out;
}

double ResidualField::coverage() const {
  const auto seen = std::ranges::count_if(cells_, [](const Cell& c) { return c.seen >= kLeastSeen; });
  return static_cast<double>(seen) / static_cast<double>(cells_.size());
}

std::vector<FieldArrow> model_difference(const Camera& from, const Camera& to) {
  const ImageSize size = to.size();
  struct Ray {
    Eigen::Vector2d pixel;
    Eigen::Vector3d ray;
  };
  std::vector<Ray> rays;
  const double step = static_cast<double>(size.width - 1) / (kGrid - 1);
  // The same on either side of the middle.
  for (double y = 0.5 * std::fmod(size.height - 1, step); y <= size.height - 1; y += step)
    for (int i = 0; i < kGrid; ++i)
      if (const auto ray = to.unproject({i * step, y})) rays.push_back({{i * step, y}, *ray});
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  std::vector<FieldArrow> out;
  constexpr int kPasses = 5;  // Gauss-Newton on a smooth problem
  for (int pass = 0; pass <= kPasses; ++pass) {
    Eigen::Matrix3d H = 1e-9 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    out.clear();
    for (const auto& [pixel, ray] : rays) {
      const Eigen::Vector3d turned = turn * ray;
      Matrix23d by_point;
      const auto seen = from.project(turned, &by_point);
      if (!seen) continue;
      const Eigen::Vector2d off = *seen - pixel;
      const Eigen::Matrix<double, 2, 3> by_turn = -by_point * so3::hat(turned);
      H += by_turn.transpose() * by_turn;
      b -= by_turn.transpose() * off;
      out.push_back({pixel, off});
    }
    turn = (so3::exp(H.ldlt().solve(b)) * turn).normalized();
  }
  return out;
}

double rms_px(std::span<const FieldArrow> arrows) {
  double sum = 0;
  for (const FieldArrow& a : arrows) sum += a.offset_px.squaredNorm();
  return arrows.empty() ? 0 : std::sqrt(sum / static_cast<double>(arrows.size()));
}

}  // namespace evpose
