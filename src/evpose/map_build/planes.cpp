// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/planes.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "evpose/map_build/median.h"
#include "evpose/map_build/moments.h"
#include "evpose/map_build/plane_split.h"

namespace evpose::map_build {
namespace {

constexpr double kFewestPoints = 40;   // of a plane, however small the patches
constexpr double kInnerShare = 0.2;    // of a plane's points, that lie away from other planes
constexpr double kParallel = 0.98;     // cosine of the angle between two layers of a surface
constexpr double kLayerSlack = 4;      // noise^2: of a layer about the plane through several
constexpr double kMostLean_rad = 0.5;  // of a layer from the surface it belongs to
constexpr double kBendNoise = 1.2;     // rms distance from the planes beside it, in units of the noise

struct Fit {
  Eigen::Vector3d centre, normal;
  Eigen::Vector3d values;  ///< variances along `axes`, ascending
  Eigen::Matrix3d axes;
  double distance(const Eigen::Vector3d& x) const { return normal.dot(x - centre); }
};

Fit fit(const Moments& m) {
  Fit out;
  out.centre = m.mean();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.compute(m.covariance());
  out.values = solver.eigenvalues().cwiseMax(0);
  out.axes = solver.eigenvectors();
  out.normal = out.axes.col(0);
  return out;
}

class RegionGrowing {
 public:
  RegionGrowing(const SurfacePoints& surface, const PlaneConfig& config)
      : surface_(surface),
        config_(config),
        cos_(static_cast<float>(std::cos(config.angle_rad))),
        least_points_(std::max(kFewestPoints, config.least_patches * surface.scale.neighbours)),
        label_(surface.size(), -1) {}

  void grow_all();
  void dissolve_bends();
  void merge_coplanar();
  void adopt_bends();
  void split_layers();
  void relabel_to_nearest();
  void refit();
  Planes result();

 private:
  Eigen::Vector3d at(std::uint32_t i) const { return surface_.position[i].cast<double>(); }
  const std::uint32_t* links(std::uint32_t i) const {
    return &surface_.links[static_cast<std::size_t>(i) * SurfacePoints::kLinks];
  }
  double gate_m(std::uint32_t i) const { return config_.gate_sigma * surface_.noise_at(i); }
  void grow(std::uint32_t seed);
  std::vector<double> noise_of_regions() const;
  void renumber(const std::vector<std::int32_t>& part_of);

  const SurfacePoints& surface_;
  const PlaneConfig& config_;
  float cos_;
  double least_points_;
  std::vector<std::int32_t> label_;  ///< -2: tried and left as a seed
  std::vector<Moments> moments_;
  std::vector<std::uint32_t> region_;
};

void RegionGrowing::grow_all() {
  std::vector<std::uint32_t> order(surface_.size());
  std::iota(order.begin(), order.end(), 0U);
  // The flattest half is enough to start from: every plane has points of it.
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return surface_.curvature[a] < surface_.curvature[b];
  });
  for (const std::uint32_t seed : order)
    if (label_[seed] == -1 && surface_.normal[seed].squaredNorm() > 0) grow(seed);
  for (auto& label : label_) label = std::max(label, -1);
}

void RegionGrowing::grow(std::uint32_t seed) {
  const auto number = static_cast<std::int32_t>(moments_.size());
  // The first patch: the seed's plane through its neighbours' middle.
  Moments moments;
  moments.add(at(seed));
  for (int k = 0; k < SurfacePoints::kLinks; ++k) moments.add(at(links(seed)[k]));
  Fit plane;
  plane.centre = moments.mean();
  plane.normal = surface_.normal[seed].cast<double>();
  moments = Moments();
  region_.assign(1, seed);
  label_[seed] = number;
  moments.add(at(seed));
  double refit_at = least_points_ / 2;
  for (std::size_t next = 0; next < region_.size(); ++next) {
    const std::uint32_t* near = links(region_[next]);
    for (int k = 0; k < SurfacePoints::kLinks; ++k) {
      const std::uint32_t q = near[k];
      if (label_[q] >= 0) continue;
      const Eigen::Vector3f& normal = surface_.normal[q];
      if (std::abs(normal.dot(plane.normal.cast<float>())) < cos_) continue;
      if (std::abs(plane.distance(at(q))) > gate_m(q)) continue;
      label_[q] = number;
      region_.push_back(q);
      moments.add(at(q));
    }
    if (moments.count >= refit_at) {
      plane = fit(moments);
      refit_at = 1.5 * moments.count;
    }
  }
  bool keep = moments.count >= least_points_;
  if (keep) {
    plane = fit(moments);
    // Flat means: wider than thick both ways.
    keep = plane.values[1] > 6 * plane.values[0];
  }
  if (!keep) {
    for (const std::uint32_t i : region_) label_[i] = -1;
    label_[seed] = -2;
    return;
  }
  // Points that the region's first, rougher planes let in.
  Moments kept;
  for (const std::uint32_t i : region_) {
    if (std::abs(plane.distance(at(i))) <= gate_m(i))
      kept.add(at(i));
    else
      label_[i] = -1;
  }
  moments_.push_back(kept);
}

/// A bend between two planes looks flat to patches that reach into both. What lies in the planes beside it,
/// but for the noise, is no plane of its own.
void RegionGrowing::dissolve_bends() {
  const std::size_t count = moments_.size();
  std::vector<std::vector<std::uint32_t>> members(count);
  for (std::uint32_t i = 0; i < label_.size(); ++i)
    if (label_[i] >= 0) members[static_cast<std::size_t>(label_[i])].push_back(i);
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return members[a].size() < members[b].size(); });
  std::vector<bool> dissolved(count, false);
  std::vector<Fit> planes;
  for (const Moments& m : moments_) planes.push_back(fit(m));
  for (const std::size_t region : order) {
    std::map<std::size_t, int> beside;
    for (const std::uint32_t i : members[region])
      for (int k = 0; k < SurfacePoints::kLinks; ++k) {
        const std::int32_t other = label_[links(i)[k]];
        if (other >= 0 && members[static_cast<std::size_t>(other)].size() > members[region].size())
          ++beside[static_cast<std::size_t>(other)];
      }
    if (beside.empty()) continue;
    double sum = 0, allowed = 0;
    for (const std::uint32_t i : members[region]) {
      double least = INFINITY;
      for (const auto& [other, links_between] : beside)
        least = std::min(least, std::abs(planes[other].distance(at(i))));
      sum += least * least;
      allowed += std::pow(kBendNoise * surface_.noise_at(i), 2);
    }
    if (sum > allowed) continue;
    dissolved[region] = true;
    for (const std::uint32_t i : members[region]) label_[i] = -1;
  }
  std::vector<std::int32_t> kept(count);
  for (std::size_t i = 0; i < count; ++i) kept[i] = dissolved[i] ? -1 : static_cast<std::int32_t>(i);
  renumber(kept);
}

/// Keeps the regions that are part of themselves; `part_of` names the region that each one's points go to. No
/// point may have a region that goes to none (-1).
void RegionGrowing::renumber(const std::vector<std::int32_t>& part_of) {
  std::vector<std::int32_t> number(part_of.size(), -1);
  std::vector<Moments> kept;
  for (std::size_t i = 0; i < part_of.size(); ++i)
    if (part_of[i] == static_cast<std::int32_t>(i)) {
      number[i] = static_cast<std::int32_t>(kept.size());
      kept.push_back(moments_[i]);
    }
  for (auto& label : label_)
    if (label >= 0) label = number[static_cast<std::size_t>(part_of[static_cast<std::size_t>(label)])];
  moments_ = std::move(kept);
}

/// Regions that touch and lie in one plane become one.
void RegionGrowing::merge_coplanar() {
  // Largest first; a union of regions is fitted anew before the next is judged.
  const std::size_t count = moments_.size();
  std::vector<std::int32_t> parent(count);
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](std::int32_t a) {
    while (parent[static_cast<std::size_t>(a)] != a) a = parent[static_cast<std::size_t>(a)];
    return a;
  };
  const std::vector<double> noise = noise_of_regions();
  std::map<std::pair<std::int32_t, std::int32_t>, int> touching;
  for (std::uint32_t i = 0; i < label_.size(); ++i) {
    if (label_[i] < 0) continue;
    for (int k = 0; k < SurfacePoints::kLinks; ++k) {
      const std::int32_t other = label_[links(i)[k]];
      if (other > label_[i]) ++touching[{label_[i], other}];
    }
  }
  std::vector<std::pair<std::pair<std::int32_t, std::int32_t>, int>> pairs(touching.begin(), touching.end());
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
  for (const auto& [pair, links_between] : pairs) {
    const std::int32_t a = root(pair.first), b = root(pair.second);
    if (a == b) continue;
    Moments& ma = moments_[static_cast<std::size_t>(a)];
    const Moments& mb = moments_[static_cast<std::size_t>(b)];
    const Fit fa = fit(ma), fb = fit(mb);
    Moments both = ma;
    both.add(mb);
    const Fit fab = fit(both);
    // Each part must lie in the joint plane as well as in its own, but for a fraction of the noise; a layer
    // of a surface seen in steps lies in its own plane without any, and may lean by a step over its width.
    const bool layers = !surface_.noise_m.empty();
    const double noise_m = std::max(noise[static_cast<std::size_t>(a)], noise[static_cast<std::size_t>(b)]);
    const double slack = (layers ? kLayerSlack : 0.25) * noise_m * noise_m;
    const double lean_rad =
        layers ? noise_m / std::sqrt(fa.values[1]) + noise_m / std::sqrt(fb.values[1]) : 0;
    const auto thickness = [&](const Moments& m) {
      const double off = fab.distance(m.mean());
      return fab.normal.dot(m.covariance() * fab.normal) + off * off;
    };
    const double angle_cos = std::abs(fa.normal.dot(fb.normal));
    const bool small = std::min(ma.count, mb.count) < 4 * least_points_;
    const double merge_rad = (small ? 4 * config_.merge_rad : config_.merge_rad) + lean_rad;
    if (angle_cos < std::cos(std::min(merge_rad, kMostLean_rad))) continue;
    if (thickness(ma) > fa.values[0] + slack || thickness(mb) > fb.values[0] + slack) continue;
    ma = both;
    parent[static_cast<std::size_t>(b)] = a;
  }
  std::vector<std::int32_t> roots(count);
  for (std::size_t i = 0; i < count; ++i) roots[i] = root(static_cast<std::int32_t>(i));
  renumber(roots);
}

/// Points beside a bend go to the nearer plane, whichever grew first.
void RegionGrowing::relabel_to_nearest() {
  std::vector<Fit> planes;
  for (const Moments& m : moments_) planes.push_back(fit(m));
  std::vector<std::int32_t> nearest = label_;
  for (std::uint32_t i = 0; i < label_.size(); ++i) {
    if (label_[i] < 0) continue;
    double least = std::abs(planes[static_cast<std::size_t>(label_[i])].distance(at(i)));
    for (int k = 0; k < SurfacePoints::kLinks; ++k) {
      const std::int32_t other = label_[links(i)[k]];
      if (other < 0 || other == nearest[i]) continue;
      // Of two layers the noise takes points to the wrong one.
      if (std::abs(planes[static_cast<std::size_t>(other)].normal.dot(
              planes[static_cast<std::size_t>(label_[i])].normal)) > kParallel)
        continue;
      const double distance = std::abs(planes[static_cast<std::size_t>(other)].distance(at(i)));
      if (distance < least) least = distance, nearest[i] = other;
    }
  }
  label_ = std::move(nearest);
}

/// Mean over each region's points.
std::vector<double> RegionGrowing::noise_of_regions() const {
  if (surface_.noise_m.empty()) return std::vector<double>(moments_.size(), surface_.scale.noise_m);
  std::vector<double> sum(moments_.size(), 0), count(moments_.size(), 0);
  for (std::uint32_t i = 0; i < label_.size(); ++i)
    if (label_[i] >= 0) {
      sum[static_cast<std::size_t>(label_[i])] += surface_.noise_at(i);
      count[static_cast<std::size_t>(label_[i])] += 1;
    }
  for (std::size_t r = 0; r < sum.size(); ++r) sum[r] /= std::max(count[r], 1.0);
  return sum;
}

void RegionGrowing::split_layers() {
  if (!surface_.noise_m.empty()) return;  // steps of depth make layers of any surface
  const std::int32_t count =
      split_layered_planes(surface_, least_points_, static_cast<std::int32_t>(moments_.size()), label_);
  moments_.assign(static_cast<std::size_t>(count), {});
  for (std::uint32_t i = 0; i < label_.size(); ++i)
    if (label_[i] >= 0) moments_[static_cast<std::size_t>(label_[i])].add(at(i));
}

/// Planes through the points that have only points of the same plane around them. Beside a bend the noise
/// mixes the points of two faces, and faces of a pillar would lean by a degree.
void RegionGrowing::refit() {
  std::vector<Moments> all(moments_.size()), inner(moments_.size());
  for (std::uint32_t i = 0; i < label_.size(); ++i) {
    if (label_[i] < 0) continue;
    const auto own = static_cast<std::size_t>(label_[i]);
    all[own].add(at(i));
    const std::uint32_t* near = links(i);
    if (std::all_of(near, near + SurfacePoints::kLinks,
                    [&](std::uint32_t q) { return label_[q] == label_[i]; }))
      inner[own].add(at(i));
  }
  for (std::size_t p = 0; p < moments_.size(); ++p) {
    const bool enough = inner[p].count >= std::max(kFewestPoints, kInnerShare * all[p].count);
    if (enough) moments_[p] = inner[p];
  }
}

Planes RegionGrowing::result() {
  Planes out;
  out.label = label_;
  out.planes.resize(moments_.size());
  for (std::uint32_t i = 0; i < label_.size(); ++i)
    if (label_[i] >= 0) out.planes[static_cast<std::size_t>(label_[i])].points.push_back(i);
  for (std::size_t p = 0; p < out.planes.size(); ++p) {
    FittedPlane& plane = out.planes[p];
    const Fit f = fit(moments_[p]);
    plane.normal = f.normal;
    plane.centre = f.centre;
    plane.d = -f.normal.dot(f.centre);
    plane.rms_m = std::sqrt(f.values[0]);
    const double n = moments_[p].count;
    // Neighbours share registration and calibration errors: a plane is never known better than a part of the
    // noise that many points cannot average away.
    const double floor = std::pow(0.03 * noise_on(surface_, plane), 2);
    plane.offset_variance = f.values[0] / n + floor;
    for (int k = 1; k < 3; ++k)
      plane.tilt_covariance += f.axes.col(k) * f.axes.col(k).transpose() * (f.values[0] / (n * f.values[k]));
    std::vector<float> spacing;
    const std::size_t step = std::max<std::size_t>(1, plane.points.size() / 1000);
    for (std::size_t i = 0; i < plane.points.size(); i += step)
      spacing.push_back(surface_.spacing_m[plane.points[i]]);
    if (!spacing.empty()) plane.spacing_m = static_cast<double>(median(spacing));
    plane.uneven_m = unevenness_m(surface_, plane);
  }
  return out;
}

/// Points in the bends go to the nearest plane beside them.
void RegionGrowing::adopt_bends() {
  std::vector<Fit> planes;
  for (const Moments& m : moments_) planes.push_back(fit(m));
  std::vector<std::pair<std::uint32_t, std::int32_t>> adopted;
  // As many rounds as a patch is wide in points.
  const int rounds = 2 + static_cast<int>(std::sqrt(surface_.scale.neighbours));
  for (int round = 0; round < rounds; ++round) {
    adopted.clear();
    for (std::uint32_t i = 0; i < label_.size(); ++i) {
      if (label_[i] >= 0) continue;
      double nearest = gate_m(i);
      std::int32_t best = -1;
      for (int k = 0; k < SurfacePoints::kLinks; ++k) {
        const std::int32_t other = label_[links(i)[k]];
        if (other < 0) continue;
        const double distance = std::abs(planes[static_cast<std::size_t>(other)].distance(at(i)));
        if (distance < nearest || (distance == nearest && best >= 0 && other < best))
          nearest = distance, best = other;
      }
      if (best >= 0) adopted.emplace_back(i, best);
    }
    if (adopted.empty()) break;
    for (const auto& [i, label] : adopted) label_[i] = label;
  }
}

}  // namespace

Planes find_planes(const SurfacePoints& surface, const PlaneConfig& config) {
  RegionGrowing growing(surface, config);
  growing.grow_all();
  growing.dissolve_bends();
  growing.merge_coplanar();
  growing.adopt_bends();
  growing.split_layers();
  for (int round = 0; round < 3; ++round) {
    growing.refit();
    growing.relabel_to_nearest();
  }
  growing.refit();
  return growing.result();
}

}  // namespace evpose::map_build
