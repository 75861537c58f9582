// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/eval/map_score.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <span>

#include "evpose/io/maps/point_grid.h"
#include "evpose/map/point_cloud.h"

namespace evpose {
namespace {

constexpr float kLink_m = 0.035F;            // true points so near to each other, in line, are of one edge
constexpr float kSameEdge_m = 0.003F;        // if they are so near across it
constexpr double kOutlierSigma = 3.5;        // one in 450 by chance
constexpr float kFurthestParallel_m = 0.3F;  // parallel edges further apart do not disturb each other

std::vector<Eigen::Vector3f> positions(const ContourMap& map, const Eigen::Vector3d& anchor) {
  std::vector<Eigen::Vector3f> out;
  out.reserve(map.points.size());
  for (std::size_t i = 0; i < map.points.size(); ++i) out.push_back((map.position(i) - anchor).cast<float>());
  return out;
}

/// Number of the straight edge that each point is part of.
std::vector<std::uint32_t> edges_of(const ContourMap& map, const std::vector<Eigen::Vector3f>& at) {
  std::vector<std::uint32_t> parent(at.size());
  std::iota(parent.begin(), parent.end(), 0U);
  const auto root = [&](std::uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  const PointGrid grid(at, kLink_m);
  for (std::uint32_t i = 0; i < at.size(); ++i) {
    const Eigen::Vector3f& t = map.points[i].tangent;
    grid.for_candidates(at[i], [&](std::uint32_t j) {
      const Eigen::Vector3f d = at[j] - at[i];
      if (j <= i || d.norm() > kLink_m || std::abs(t.dot(map.points[j].tangent)) < 0.98F) return;
      if ((d - t * t.dot(d)).norm() < kSameEdge_m) parent[root(j)] = root(i);
    });
  }
  std::vector<std::uint32_t> out(at.size());
  for (std::uint32_t i = 0; i < at.size(); ++i) out[i] = root(i);
  return out;
}

/// Distance of the nearest point of another edge that runs parallel beside each point; infinite beyond
/// kFurthestParallel_m.
std::vector<float> parallel_distances(const ContourMap& map, const std::vector<Eigen::Vector3f>& at,
                                      const std::vector<std::uint32_t>& edge) {
  const PointGrid grid(at, kFurthestParallel_m);
  std::vector<float> out(at.size(), INFINITY);
  for (std::uint32_t i = 0; i < at.size(); ++i) {
    const Eigen::Vector3f& t = map.points[i].tangent;
    grid.for_candidates(at[i], [&](std::uint32_t j) {
      if (edge[j] == edge[i] || std::abs(t.dot(map.points[j].tangent)) < 0.95F) return;
      const Eigen::Vector3f d = at[j] - at[i];
      const float along = t.dot(d), across = (d - along * t).norm();
      if (std::abs(along) < kLink_m && across < kFurthestParallel_m && across > kSameEdge_m)
        out[i] = std::min(out[i], across);
    });
  }
  return out;
}

double distance_m(const std::vector<Eigen::Vector3d>& places, const Eigen::Vector3d& x) {
  double least = INFINITY;
  for (const auto& place : places) least = std::min(least, (place - x).squaredNorm());
  return std::sqrt(least);
}

void count(std::span<RecallClass> classes, double value, double weight, double across_m) {
  std::size_t k = classes.size() - 1;
  while (k > 0 && value < classes[k].from) --k;
  classes[k].true_m += weight;
  classes[k].recall_5mm += across_m <= 0.005 ? weight : 0;
  classes[k].recall_10mm += across_m <= 0.010 ? weight : 0;
}
void finish(std::span<RecallClass> classes) {
  for (RecallClass& c : classes)
    if (c.true_m > 0) c.recall_5mm /= c.true_m, c.recall_10mm /= c.true_m;
}

/// A contour of one map beside a point of the other.
struct Match {
  double across_m = INFINITY, angle_rad = 0;
};

class Matcher {
 public:
  Matcher(const ContourMap& map, const std::vector<Eigen::Vector3f>& at, const MapScoreConfig& config)
      : map_(map), at_(at), config_(config), grid_(at, static_cast<float>(config.reach_m)) {}

  Match nearest(const Eigen::Vector3f& x, const Eigen::Vector3f& tangent) const {
    Match best;
    grid_.for_candidates(x, [&](std::uint32_t j) {
      const Eigen::Vector3f& t = map_.points[j].tangent;
      const double angle = std::acos(std::min(1.0, static_cast<double>(std::abs(t.dot(tangent)))));
      if (angle > config_.direction_rad) return;
      const Eigen::Vector3f d = x - at_[j];
      const double along = std::abs(static_cast<double>(t.dot(d)));
      const double across = static_cast<double>((d - t * t.dot(d)).norm());
      if (along <= config_.reach_m && across <= config_.reach_m && across < best.across_m)
        best = {across, angle};
    });
    return best;
  }

 private:
  const ContourMap& map_;
  const std::vector<Eigen::Vector3f>& at_;
  const MapScoreConfig& config_;
  PointGrid grid_;
};

/// Values with weights, to be asked for quantiles.
struct Weighted {
  std::vector<std::pair<double, double>> values;
  double quantile(double share) {
    std::sort(values.begin(), values.end());
    double sum = 0, so_far = 0;
    for (const auto& v : values) sum += v.second;
    for (const auto& v : values)
      if ((so_far += v.second) >= share * sum) return v.first;
    return 0;
  }
  double mean() const {
    double sum = 0, weight = 0;
    for (const auto& v : values) sum += v.first * v.second, weight += v.second;
    return weight > 0 ? sum / weight : 0;
  }
};

struct Tally {
  KindScore score;
  Weighted distance, direction, ratio;

  void built(const ContourPoint& p, const Match& match) {
    const auto weight = static_cast<double>(p.length);
    score.built_m += weight;
    score.precision_5mm += match.across_m <= 0.005 ? weight : 0;
    score.precision_10mm += match.across_m <= 0.010 ? weight : 0;
    if (!std::isfinite(match.across_m)) return;
    distance.values.emplace_back(match.across_m, weight);
    direction.values.emplace_back(match.angle_rad, weight);
    // Two directions across the contour share the error.
    if (p.sigma > 0)
      ratio.values.emplace_back(0.5 * std::pow(match.across_m / static_cast<double>(p.sigma), 2), weight);
  }
  void truth(double weight, const Match& match) {
    score.true_m += weight;
    score.recall_5mm += match.across_m <= 0.005 ? weight : 0;
    score.recall_10mm += match.across_m <= 0.010 ? weight : 0;
  }
  KindScore finish() {
    constexpr double kDegree = 180 / std::numbers::pi;
    if (score.built_m > 0) score.precision_5mm /= score.built_m, score.precision_10mm /= score.built_m;
    if (score.true_m > 0) score.recall_5mm /= score.true_m, score.recall_10mm /= score.true_m;
    score.p50_mm = 1e3 * distance.quantile(0.5);
    score.p95_mm = 1e3 * distance.quantile(0.95);
    score.mean_mm = 1e3 * distance.mean();
    score.direction_mean_deg = kDegree * direction.mean();
    score.direction_p95_deg = kDegree * direction.quantile(0.95);
    score.sigma_ratio = std::sqrt(ratio.mean());
    // Across a contour errors have two directions: half of their squares are below 2 ln 2.
    score.sigma_bulk = std::sqrt(ratio.quantile(0.5) / std::numbers::ln2);
    double far = 0, whole = 0;
    for (const auto& [square, weight] : ratio.values) {
      whole += weight;
      far += 2 * square > kOutlierSigma * kOutlierSigma ? weight : 0;
    }
    score.outliers = whole > 0 ? far / whole : 0;
    return score;
  }
};

/// Tallies of all contours, and of creases and boundaries by themselves.
struct Tallies {
  Tally all, crease, boundary;

  Tally* of_kind(ContourKind kind) {
    return kind == ContourKind::crease ? &crease : kind == ContourKind::boundary ? &boundary : nullptr;
  }
};

/// The contours that registration may use: edges of surfaces.
ContourMap edges_only(const ContourMap& map) {
  ContourMap out;
  out.anchor = map.anchor;
  for (const ContourPoint& p : map.points)
    if (!is_view_dependent(p.kind)) out.points.push_back(p);
  return out;
}

/// Which places a cloud shows; without a cloud all of them count as seen.
class SeenPlaces {
 public:
  SeenPlaces(const PointCloud* cloud, const Eigen::Vector3d& anchor, const MapScoreConfig& config)
      : points_(points_of(cloud, anchor)),
        // Of a sparse cloud six points of the two surfaces lie further around.
        radius_(std::max(static_cast<float>(config.seen_radius_m), 5 * typical_spacing(points_))),
        grid_(points_, radius_),
        needed_(cloud != nullptr ? config.seen_points : 0) {}

  bool shows(const Eigen::Vector3f& x) const {
    if (needed_ <= 0) return true;
    int near = 0;
    grid_.for_candidates(x, [&](std::uint32_t j) { near += (points_[j] - x).norm() <= radius_ ? 1 : 0; });
    return near >= needed_;
  }

 private:
  static std::vector<Eigen::Vector3f> points_of(const PointCloud* cloud, const Eigen::Vector3d& anchor) {
    std::vector<Eigen::Vector3f> out;
    if (cloud != nullptr)
      for (const auto& p : cloud->points)
        out.push_back((cloud->anchor - anchor + p.cast<double>()).cast<float>());
    return out;
  }

  std::vector<Eigen::Vector3f> points_;
  float radius_;
  PointGrid grid_;
  int needed_;
};

/// Length of the edge that each point is part of.
std::vector<double> edge_lengths(const ContourMap& map, const std::vector<std::uint32_t>& edges) {
  std::vector<double> of_root(edges.size(), 0), out(edges.size());
  for (std::size_t i = 0; i < edges.size(); ++i)
    of_root[edges[i]] += static_cast<double>(map.points[i].length);
  for (std::size_t i = 0; i < edges.size(); ++i) out[i] = of_root[edges[i]];
  return out;
}

/// Holds the true contours that count against the built ones.
void judge_recall(const ContourMap& truth, const std::vector<Eigen::Vector3f>& at, const Matcher& in_built,
                  const SeenPlaces& seen, const MapScoreConfig& config, Tallies& tallies, MapScore& out) {
  const auto edges = edges_of(truth, at);
  const auto lengths = edge_lengths(truth, edges);
  const auto parallel = parallel_distances(truth, at, edges);
  for (std::size_t i = 0; i < at.size(); ++i) {
    const ContourPoint& p = truth.points[i];
    const auto weight = static_cast<double>(p.length);
    if (lengths[i] < config.long_m) {
      out.short_m += weight;
      continue;
    }
    if (!seen.shows(at[i])) {
      out.unseen_m += weight;
      continue;
    }
    const Match match = in_built.nearest(at[i], p.tangent);
    tallies.all.truth(weight, match);
    count(out.by_length, lengths[i], weight, match.across_m);
    count(out.by_parallel_edge, static_cast<double>(parallel[i]), weight, match.across_m);
    if (!config.flown.empty())
      count(out.by_distance_flown, distance_m(config.flown, truth.position(i)), weight, match.across_m);
    if (Tally* tally = tallies.of_kind(p.kind)) tally->truth(weight, match);
  }
}

}  // namespace

MapScore score_map(const ContourMap& judged, const ContourMap& truth, const PointCloud* cloud,
                   const MapScoreConfig& config) {
  const ContourMap built = edges_only(judged);
  const auto of_built = positions(built, truth.anchor), of_truth = positions(truth, truth.anchor);
  const Matcher in_truth(truth, of_truth, config), in_built(built, of_built, config);
  Tallies tallies;
  for (std::size_t i = 0; i < of_built.size(); ++i) {
    const ContourPoint& p = built.points[i];
    const Match match = in_truth.nearest(of_built[i], p.tangent);
    tallies.all.built(p, match);
    if (Tally* tally = tallies.of_kind(p.kind)) tally->built(p, match);
  }
  const SeenPlaces seen(cloud, truth.anchor, config);
  MapScore out;
  judge_recall(truth, of_truth, in_built, seen, config, tallies, out);
  finish(out.by_length);
  finish(out.by_parallel_edge);
  finish(out.by_distance_flown);
  out.all = tallies.all.finish();
  out.crease = tallies.crease.finish();
  out.boundary = tallies.boundary.finish();
  return out;
}

}  // namespace evpose
