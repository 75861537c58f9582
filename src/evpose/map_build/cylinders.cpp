// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/cylinders.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "evpose/map_build/arcs.h"
#include "evpose/map_build/neighbours.h"

namespace evpose::map_build {
namespace {

constexpr std::array<double, 2> kSeedRadii_m = {0.25, 0.5};
constexpr std::size_t kFewestAtSeed = 20, kMostAtSeed = 400;
constexpr double kElongated = 0.1;     // second over first spread of a pole's stretch
constexpr double kBent = 0.06;         // least spread of a bent surface's normals across its axis
constexpr double kStraight = 0.05;     // most spread of a bent surface's normals along its axis
constexpr double kGate = 3;            // noise: of a cylinder's points
constexpr double kClear_m = 0.05;      // around a body: most of the points there are its own
constexpr double kOwnShare = 0.7;      // of the points around a body: its own
constexpr double kSlab_m = 0.1;        // step along the axis
constexpr double kPoleWidth_m = 0.03;  // rms of a pole's points from its axis
constexpr double kPoleNoise = 2;       // noise: the same, where that is more
constexpr double kLeastLength_m = 0.3;
constexpr double kSlender = 5;                  // length over radius of a pole
constexpr double kLeastRadius = 2;              // noise: thinner bodies are poles
constexpr double kMostRadius_m = 1.5;           // larger bodies are vaults
constexpr double kMostRms = 1.5;                // noise: of points across a cylinder
constexpr int kAngles = 24, kFewestAngles = 6;  // sectors of the circle, and those with points
constexpr std::size_t kFewestPoints = 40;

struct Axis {
  Eigen::Vector3d origin, direction;
  double at(const Eigen::Vector3d& x) const { return direction.dot(x - origin); }
  Eigen::Vector3d off(const Eigen::Vector3d& x) const {
    return x - origin - direction * direction.dot(x - origin);
  }
};

/// An axis with the distance of the surface from it; 0: a pole.
struct Model {
  Axis axis;
  double radius_m = 0;
};

class CylinderFinder {
 public:
  CylinderFinder(const SurfacePoints& surface, const Neighbours& tree, const Planes& planes,
                 const std::vector<bool>& curved)
      : surface_(surface), tree_(tree), free_(surface.size(), 0) {
    for (std::size_t i = 0; i < free_.size(); ++i) {
      const std::int32_t label = planes.label[i];
      free_[i] = label < 0 || curved[static_cast<std::size_t>(label)] ? 1 : 0;
    }
  }
  std::vector<Cylinder> find();

 private:
  Eigen::Vector3d at(std::uint32_t i) const { return surface_.position[i].cast<double>(); }
  std::vector<std::uint32_t> free_around(const Eigen::Vector3d& x, double radius_m) const;
  std::optional<Model> pole_at(const std::vector<std::uint32_t>& points) const;
  std::optional<Model> bar_at(const std::vector<std::uint32_t>& points) const;
  std::optional<Model> around(const Axis& axis, const std::vector<std::uint32_t>& points) const;
  std::optional<Model> column_at(const std::vector<std::uint32_t>& points) const;
  std::optional<Model> refined(const Model& start, const std::vector<std::uint32_t>& points) const;
  struct Stretch {
    std::vector<std::uint32_t> points;
    double first = 0, last = 0;  ///< along the axis
  };
  Stretch points_along(const Model& model) const;
  std::optional<Cylinder> cylinder(Model model, std::vector<std::uint32_t>& points) const;
  double gate_m(const Model& model) const {
    const double noise = kGate * surface_.scale.noise_m;
    return model.radius_m > 0 ? noise : std::max(noise, 2 * kPoleWidth_m);
  }

  const SurfacePoints& surface_;
  const Neighbours& tree_;
  std::vector<std::uint8_t> free_;
};

std::vector<std::uint32_t> CylinderFinder::free_around(const Eigen::Vector3d& x, double radius_m) const {
  std::vector<std::uint32_t> near;
  tree_.within(x.cast<float>(), static_cast<float>(radius_m), near);
  std::erase_if(near, [&](std::uint32_t i) { return free_[i] == 0; });
  std::sort(near.begin(), near.end());
  if (near.size() > kMostAtSeed) {
    const std::size_t step = near.size() / kMostAtSeed + 1;
    std::size_t kept = 0;
    for (std::size_t k = 0; k < near.size(); k += step) near[kept++] = near[k];
    near.resize(kept);
  }
  return near;
}

/// One large eigenvalue.
std::optional<Model> CylinderFinder::pole_at(const std::vector<std::uint32_t>& points) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const std::uint32_t i : points) sum += at(i);
  const Eigen::Vector3d middle = sum / static_cast<double>(points.size());
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  for (const std::uint32_t i : points) squares += (at(i) - middle) * (at(i) - middle).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(squares);
  if (axes.eigenvalues()[1] > kElongated * axes.eigenvalues()[2]) return {};
  return Model{{middle, axes.eigenvectors().col(2)}, 0};
}

/// A bar along a pole's axis, wide enough for its radius to show.
std::optional<Model> CylinderFinder::bar_at(const std::vector<std::uint32_t>& points) const {
  const auto pole = pole_at(points);
  return pole ? around(pole->axis, points) : std::nullopt;
}

/// The cylinder around an axis of which the direction is known.
std::optional<Model> CylinderFinder::around(const Axis& axis,
                                            const std::vector<std::uint32_t>& points) const {
  const Eigen::Vector3d u = axis.direction.unitOrthogonal(), v = axis.direction.cross(u);
  std::vector<CurvePlace> places;
  for (const std::uint32_t i : points) {
    const Eigen::Vector3d d = at(i) - axis.origin;
    places.push_back({{u.dot(d), v.dot(d)}, surface_.scale.noise_m});
  }
  const auto circle = fit_circle(places);
  if (!circle || circle->radius_m > kMostRadius_m) return {};
  if (circle->radius_m < kLeastRadius * surface_.scale.noise_m) return {};
  const Eigen::Vector3d centre = axis.origin + circle->centre.x() * u + circle->centre.y() * v;
  return refined({{centre, axis.direction}, circle->radius_m}, points);
}

/// Normals all across one direction, and spread over an angle around it.
std::optional<Model> CylinderFinder::column_at(const std::vector<std::uint32_t>& points) const {
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  for (const std::uint32_t i : points) {
    const Eigen::Vector3d n = surface_.normal[i].cast<double>();
    squares += n * n.transpose() / static_cast<double>(points.size());
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(squares);
  if (axes.eigenvalues()[0] > kStraight || axes.eigenvalues()[1] < kBent) return {};
  return around({at(points.front()), axes.eigenvectors().col(0)}, points);
}

/// Axis and radius by robust least squares of the distances from the surface.
std::optional<Model> CylinderFinder::refined(const Model& start,
                                             const std::vector<std::uint32_t>& points) const {
  Model model = start;
  const double noise = surface_.scale.noise_m;
  constexpr int kRounds = 12;
  for (int round = 0; round < kRounds; ++round) {
    const Eigen::Vector3d u = model.axis.direction.unitOrthogonal(), v = model.axis.direction.cross(u);
    Eigen::Matrix<double, 5, 5> squares = Eigen::Matrix<double, 5, 5>::Zero();
    Eigen::Matrix<double, 5, 1> right = Eigen::Matrix<double, 5, 1>::Zero();
    for (const std::uint32_t i : points) {
      const Eigen::Vector3d off = model.axis.off(at(i));
      const double t = model.axis.at(at(i)), distance = off.norm();
      // A pole's axis is where its points are; two directions across it instead of one.
      const double r = distance - model.radius_m, weight = 1 / std::pow(1 + r * r / (9 * noise * noise), 2);
      const auto add = [&](const Eigen::Vector3d& out, double residual, double by_radius) {
        Eigen::Matrix<double, 5, 1> row;
        row << out.dot(u), out.dot(v), t * out.dot(u), t * out.dot(v), by_radius;
        squares += weight * row * row.transpose();
        right += weight * residual * row;
      };
      if (model.radius_m > 0) {
        if (distance > 1e-9) add(off / distance, r, 1);
      } else {
        add(u, off.dot(u), 0), add(v, off.dot(v), 0);
      }
    }
    squares.diagonal().array() += 1e-9;
    const Eigen::Matrix<double, 5, 1> move = squares.ldlt().solve(right);
    if (!move.allFinite() || std::abs(move[2]) + std::abs(move[3]) > 0.5) return {};
    model.axis.origin += move[0] * u + move[1] * v;
    model.axis.direction = (model.axis.direction + move[2] * u + move[3] * v).normalized();
    if (model.radius_m > 0) model.radius_m += move[4];
    if (start.radius_m > 0 && !(model.radius_m > 0 && model.radius_m < kMostRadius_m)) return {};
    if (move.norm() < 1e-6) break;
  }
  return model;
}

/// Its points, slab by slab along the axis from the origin on, for as long as there are enough and little
/// else is around.
CylinderFinder::Stretch CylinderFinder::points_along(const Model& model) const {
  const double gate = gate_m(model), reach = model.radius_m + gate + kClear_m;
  const double around = std::max(std::numbers::pi / 2 * model.radius_m, 0.01);
  const double enough =
      std::max(2.0, 0.3 * kSlab_m * around / (surface_.scale.spacing_m * surface_.scale.spacing_m));
  Stretch out;
  std::vector<std::uint32_t> near, slab;
  for (const int way : {-1, 1}) {
    int empty = 0;
    for (int k = 0; empty < 2 && k < 1000; ++k) {
      const double middle = way * (k + 0.5) * kSlab_m;
      const Eigen::Vector3d centre = model.axis.origin + middle * model.axis.direction;
      tree_.within(centre.cast<float>(), static_cast<float>(std::hypot(reach, 0.5 * kSlab_m)), near);
      std::sort(near.begin(), near.end());
      slab.clear();
      double all = 0;
      for (const std::uint32_t i : near) {
        const double t = model.axis.at(at(i));
        if (t < middle - 0.5 * kSlab_m || t >= middle + 0.5 * kSlab_m) continue;
        const double distance = model.axis.off(at(i)).norm();
        if (distance > reach) continue;
        all += 1;
        if (free_[i] != 0 && std::abs(distance - model.radius_m) <= gate) slab.push_back(i);
      }
      const auto own = static_cast<double>(slab.size());
      if (own < enough || own < kOwnShare * all) {
        ++empty;
        continue;
      }
      empty = 0;
      out.points.insert(out.points.end(), slab.begin(), slab.end());
    }
  }
  if (out.points.empty()) return out;
  // Slabs are coarser than points: to the last ones.
  out.first = INFINITY, out.last = -INFINITY;
  for (const std::uint32_t i : out.points) {
    const double t = model.axis.at(at(i));
    out.first = std::min(out.first, t), out.last = std::max(out.last, t);
  }
  return out;
}

/// Follows and fits in turns; `points` are its own then.
std::optional<Cylinder> CylinderFinder::cylinder(Model model, std::vector<std::uint32_t>& points) const {
  const double noise = surface_.scale.noise_m;
  Stretch along;
  // A short stretch tells the direction badly: each round follows further.
  constexpr int kRounds = 6;
  std::size_t before = 0;
  for (int round = 0; round < kRounds; ++round) {
    along = points_along(model);
    if (along.points.size() < kFewestPoints) return {};
    if (round > 1 && 50 * along.points.size() < 51 * before) break;
    before = along.points.size();
    const auto better = refined(model, along.points);
    if (!better) return {};
    // The origin back into the middle: the next round goes out from there.
    const double middle = 0.5 * (along.first + along.last);
    model = *better;
    model.axis.origin += middle * model.axis.direction;
    along.first -= middle, along.last -= middle;
  }
  Eigen::Index largest = 0;
  model.axis.direction.cwiseAbs().maxCoeff(&largest);
  if (model.axis.direction[largest] < 0) {
    model.axis.direction = -model.axis.direction;
    std::swap(along.first, along.last);
    along.first = -along.first, along.last = -along.last;
  }
  Cylinder out;
  out.begin = model.axis.origin + along.first * model.axis.direction;
  out.end = model.axis.origin + along.last * model.axis.direction;
  out.is_pole = model.radius_m == 0;
  out.points = along.points.size();
  const Eigen::Vector3d u = model.axis.direction.unitOrthogonal(), v = model.axis.direction.cross(u);
  std::array<int, kAngles> sectors{};
  double squares = 0;
  for (const std::uint32_t i : along.points) {
    const Eigen::Vector3d off = model.axis.off(at(i));
    squares += std::pow(off.norm() - model.radius_m, 2);
    const double share = std::atan2(off.dot(v), off.dot(u)) / (2 * std::numbers::pi) + 0.5;
    ++sectors[static_cast<std::size_t>(std::clamp(static_cast<int>(share * kAngles), 0, kAngles - 1))];
  }
  out.rms_m = std::sqrt(squares / static_cast<double>(out.points));
  out.radius_m = out.is_pole ? out.rms_m : model.radius_m;
  if (out.length_m() < std::max(kLeastLength_m, (out.is_pole ? kSlender : 1) * out.radius_m)) return {};
  if (out.is_pole ? out.rms_m > std::max(kPoleWidth_m, kPoleNoise * noise) : out.rms_m > kMostRms * noise)
    return {};
  const double typical = static_cast<double>(out.points) / kAngles;
  const auto filled = std::count_if(sectors.begin(), sectors.end(),
                                    [&](int count) { return count > std::max(0.3 * typical, 1.0); });
  if (!out.is_pole && filled < kFewestAngles) return {};
  points = std::move(along.points);
  return out;
}

std::vector<Cylinder> CylinderFinder::find() {
  std::vector<Cylinder> out;
  std::vector<std::uint8_t> examined(free_.size(), 0);
  std::vector<std::uint32_t> near;
  // Points come in the order of a Z-curve: seeds that differ lie apart.
  for (std::uint32_t seed = 0; seed < free_.size(); ++seed) {
    if (free_[seed] == 0 || examined[seed] != 0) continue;
    bool found = false;
    for (const double radius_m : kSeedRadii_m) {
      const auto points = free_around(at(seed), radius_m);
      if (points.size() < kFewestAtSeed) continue;
      for (const auto& model : {column_at(points), bar_at(points), pole_at(points)}) {
        std::vector<std::uint32_t> own;
        const auto cylinder = model ? this->cylinder(*model, own) : std::nullopt;
        if (!cylinder) continue;
        for (const std::uint32_t i : own) free_[i] = 0;
        out.push_back(*cylinder);
        found = true;
        break;
      }
      if (found) break;
    }
    if (found) continue;
    tree_.within(surface_.position[seed], static_cast<float>(0.4 * kSeedRadii_m.front()), near);
    for (const std::uint32_t i : near) examined[i] = 1;
  }
  return out;
}

}  // namespace

std::vector<Cylinder> find_cylinders(const SurfacePoints& surface, const Neighbours& tree,
                                     const Planes& planes, const std::vector<bool>& curved) {
  return CylinderFinder(surface, tree, planes, curved).find();
}

}  // namespace evpose::map_build
