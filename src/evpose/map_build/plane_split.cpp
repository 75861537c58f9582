// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/plane_split.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "evpose/map_build/median.h"
#include "evpose/map_build/moments.h"

namespace evpose::map_build {
namespace {

constexpr double kCellPoints = 20;   // about so many in a cell
constexpr double kFewestInCell = 8;  // below, a cell says nothing
constexpr double kFewestCells = 9;   // of a part that becomes a plane
constexpr double kStandsOff = 3;     // sigma of a cell's mean: from which on it is of another surface
constexpr double kUneven_m = 4e-3;   // by which surfaces are uneven and still one
constexpr double kFirstWidth = 0.8, kLastWidth = 0.4;  // noise: of the weights of the larger surface's fit
constexpr int kRounds = 12;
constexpr std::size_t kBegins = 16;  // cells around which the fit begins
constexpr double kBeginShare = 0.2;  // of the plane's extent: how far around

using Place = std::pair<int, int>;

struct Cell {
  Place place;
  double count = 0;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();  ///< along the plane's two axes, and over it
};

/// Height over the plane as a + b x + c y.
using Form = Eigen::Vector3d;
double off(const Form& form, const Cell& cell) {
  return cell.mean.z() - form[0] - form[1] * cell.mean.x() - form[2] * cell.mean.y();
}

class LayeredPlane {
 public:
  LayeredPlane(const SurfacePoints& surface, const std::vector<std::uint32_t>& points);
  /// Points of the largest part that stands off the larger surface; empty: all lie on one.
  std::vector<std::uint32_t> largest_part_beside(double least_points) const;

 private:
  struct Fit {
    Form form;
    double weight;  ///< sum over the cells
  };
  template <class WeightOf>
  std::optional<Fit> fitted(const WeightOf& weight_of) const;
  std::optional<Form> larger_surface() const;
  double sigma_m(const Cell& cell) const { return noise_m_ / std::sqrt(cell.count); }

  double noise_m_;
  std::map<Place, std::vector<std::uint32_t>> points_;  ///< of each place
  std::vector<Cell> cells_;  ///< in the order of their places; those with enough points
};

LayeredPlane::LayeredPlane(const SurfacePoints& surface, const std::vector<std::uint32_t>& points)
    : noise_m_(surface.scale.noise_m) {
  Moments moments;
  std::vector<float> spacing;
  for (const std::uint32_t i : points) {
    moments.add(surface.position[i].cast<double>());
    spacing.push_back(surface.spacing_m[i]);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(moments.covariance());
  const Eigen::Vector3d centre = moments.mean();
  const Eigen::Vector3d u = solver.eigenvectors().col(2), v = solver.eigenvectors().col(1), n = u.cross(v);
  const double edge_m = std::sqrt(kCellPoints) * static_cast<double>(median(spacing));
  for (const std::uint32_t i : points) {
    const Eigen::Vector3d x = surface.position[i].cast<double>() - centre;
    const Eigen::Vector2d at(u.dot(x), v.dot(x));
    points_[{static_cast<int>(std::floor(at.x() / edge_m)), static_cast<int>(std::floor(at.y() / edge_m))}]
        .push_back(i);
  }
  for (const auto& [place, own] : points_) {
    const auto count = static_cast<double>(own.size());
    if (count < kFewestInCell) continue;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const std::uint32_t i : own) {
      const Eigen::Vector3d x = surface.position[i].cast<double>() - centre;
      sum += Eigen::Vector3d(u.dot(x), v.dot(x), n.dot(x));
    }
    cells_.push_back({place, count, sum / count});
  }
}

/// Weighted by `weight_of(cell)`.
template <class WeightOf>
std::optional<LayeredPlane::Fit> LayeredPlane::fitted(const WeightOf& weight_of) const {
  // The lower triangle of the normal matrix, number by number: the loop that the time goes into.
  double one = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0, z = 0, xz = 0, yz = 0;
  for (const Cell& cell : cells_) {
    const double weight = weight_of(cell);
    const Eigen::Vector3d& at = cell.mean;
    const double wx = weight * at.x(), wy = weight * at.y(), wz = weight * at.z();
    one += weight;
    x += wx;
    y += wy;
    xx += wx * at.x();
    xy += wy * at.x();
    yy += wy * at.y();
    z += wz;
    xz += wz * at.x();
    yz += wz * at.y();
  }
  Eigen::Matrix3d squares;
  squares << one, x, y, x, xx, xy, y, xy, yy;
  const Eigen::LDLT<Eigen::Matrix3d> solver(squares);
  if (solver.info() != Eigen::Success) return {};
  const Form form = solver.solve(Eigen::Vector3d(z, xz, yz));
  if (!form.allFinite()) return {};
  return Fit{form, one};
}

/// A fit to all of a layered plane leans through both layers and stays there. So it begins around many
/// places, and its weights fall off ever more narrowly; what gathers most weight is the larger surface.
std::optional<Form> LayeredPlane::larger_surface() const {
  Eigen::AlignedBox2d box;
  for (const Cell& cell : cells_) box.extend(cell.mean.head<2>());
  const double near_m = kBeginShare * box.diagonal().norm();
  std::optional<Fit> best;
  std::size_t number = 0;
  const std::size_t stride = std::max<std::size_t>(1, cells_.size() / kBegins);
  for (const Cell& begin : cells_) {
    if (number++ % stride != stride / 2) continue;
    const Eigen::Vector2d middle = begin.mean.head<2>();
    std::optional<Fit> fit = fitted(
        [&](const Cell& cell) { return (cell.mean.head<2>() - middle).norm() < near_m ? cell.count : 0; });
    for (int round = 0; fit && round < kRounds; ++round) {
      const double share = round / (kRounds - 1.0);
      const double width_m = noise_m_ * kFirstWidth * std::pow(kLastWidth / kFirstWidth, share);
      const Form form = fit->form;
      fit = fitted([&](const Cell& cell) {
        const double z = off(form, cell) / width_m;
        return cell.count / ((1 + z * z) * (1 + z * z));
      });
    }
    if (fit && (!best || fit->weight > best->weight)) best = fit;
  }
  if (!best) return {};
  return best->form;
}

std::vector<std::uint32_t> LayeredPlane::largest_part_beside(double least_points) const {
  if (static_cast<double>(cells_.size()) < 2 * kFewestCells) return {};
  const std::optional<Form> form = larger_surface();
  if (!form) return {};
  // Cells that stand off on one side and touch.
  std::map<Place, int> beside;
  for (const Cell& cell : cells_)
    if (const double d = off(*form, cell); std::abs(d) > std::hypot(kStandsOff * sigma_m(cell), kUneven_m))
      beside[cell.place] = d > 0 ? 1 : -1;
  std::vector<std::uint32_t> largest;
  while (!beside.empty()) {
    const int side = beside.begin()->second;
    std::vector<Place> part{beside.begin()->first};
    beside.erase(beside.begin());
    for (std::size_t next = 0; next < part.size(); ++next)
      for (int dx = -1; dx <= 1; ++dx)
        for (int dy = -1; dy <= 1; ++dy) {
          const auto found = beside.find({part[next].first + dx, part[next].second + dy});
          if (found == beside.end() || found->second != side) continue;
          part.push_back(found->first);
          beside.erase(found);
        }
    if (static_cast<double>(part.size()) < kFewestCells) continue;
    std::vector<std::uint32_t> points;
    for (const Place& place : part) {
      const auto& own = points_.at(place);
      points.insert(points.end(), own.begin(), own.end());
    }
    if (points.size() > largest.size()) largest = std::move(points);
  }
  if (static_cast<double>(largest.size()) < least_points) largest.clear();
  return largest;
}

}  // namespace

std::int32_t split_layered_planes(const SurfacePoints& surface, double least_points, std::int32_t planes,
                                  std::vector<std::int32_t>& label) {
  std::vector<std::vector<std::uint32_t>> members(static_cast<std::size_t>(planes));
  for (std::uint32_t i = 0; i < label.size(); ++i)
    if (label[i] >= 0) members[static_cast<std::size_t>(label[i])].push_back(i);
  for (std::size_t plane = 0; plane < members.size(); ++plane) {
    std::vector<std::uint32_t> part = LayeredPlane(surface, members[plane]).largest_part_beside(least_points);
    if (part.empty()) continue;
    const auto number = static_cast<std::int32_t>(members.size());
    for (const std::uint32_t i : part) label[i] = number;
    std::erase_if(members[plane], [&](std::uint32_t i) { return label[i] == number; });
    std::sort(part.begin(), part.end());
    members.push_back(std::move(part));  // which may be layered itself
    --plane;                             // and so may be the rest
  }
  return static_cast<std::int32_t>(members.size());
}

}  // namespace evpose::map_build
