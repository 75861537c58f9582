// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/edge_fit.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "evpose/map_build/strips.h"

namespace evpose::map_build {
namespace {

constexpr double kMovedByBlur = 0.3;
constexpr double kWindow = 2.5;            // noise: half width of what is taken for one surface
constexpr double kReachNoise = 4;          // noise: of what is looked at around an edge
constexpr double kFewestHanging = 8;       // points of a second face
constexpr double kLeastHanging = 0.3;      // density of a second face, as a share of the plane's
constexpr double kMostUnexplained = 0.1;   // share of the points at an edge that no surface there explains
constexpr double kLeastGain = 10;          // of log likelihood, by a second face
constexpr double kHigh = 1.2;              // noise: few of the plane's points are further from it
constexpr double kDenser = 1.5;            // density over the plane's that tells of a second face
constexpr double kExcess = 3;              // sigma: of points at the edge over chance
constexpr std::size_t kMostPoints = 1200;  // for one edge
constexpr double kUneven = 0.1;            // noise: that many points do not average away
constexpr double kMostRest = 0.12;         // density beyond a free edge, as a share of that within

}  // namespace

Edge Edge::between(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d along = (b - a).normalized();
  return {0.5 * (a + b), along, {along.y(), -along.x()}, 0.5 * (b - a).norm()};
}

void Edge::shift(double place, double slope) {
  middle += place * out;
  if (bend != 0) {
    bend = 1 / (1 / bend + place);
    return;
  }
  along = (along + slope * out).normalized();
  out = {along.y(), -along.x()};
}

Eigen::Vector2d Edge::local(const Eigen::Vector2d& p) const {
  const Eigen::Vector2d d = p - middle;
  if (bend == 0) return {along.dot(d), out.dot(d)};
  const double radius = 1 / std::abs(bend), side = bend > 0 ? 1 : -1;
  const Eigen::Vector2d from_centre = d + out / bend;
  return {radius * std::atan2(along.dot(from_centre), side * out.dot(from_centre)),
          side * (from_centre.squaredNorm() - radius * radius) / (2 * radius)};
}

Eigen::Vector2d Edge::along_at(double t) const {
  return std::cos(bend * t) * along - std::sin(bend * t) * out;
}

Eigen::Vector2d Edge::at(double t) const {
  if (bend == 0) return middle + t * along;
  return middle + std::sin(bend * t) / bend * along + (std::cos(bend * t) - 1) / bend * out;
}

EdgeFitter::EdgeFitter(const SurfacePoints& surface, const Neighbours& tree, const FittedPlane& plane,
                       double cell_m, double most_blur_noise)
    : surface_(surface),
      tree_(tree),
      plane_(plane),
      frame_(plane),
      cell_m_(cell_m),
      most_blur_noise_(most_blur_noise),
      noise_m_(noise_on(surface, plane)) {}

/// All points of the cloud near an edge in its coordinates: along it, outwards, over the plane.
std::vector<Eigen::Vector3d> EdgeFitter::local_points(const Edge& edge, double reach) const {
  constexpr double kMostTurn_rad = 0.3;  // of an arc's part that is taken for its chord
  const double turn = std::abs(edge.bend) * 2 * edge.half_length;
  const int parts = std::max(1, static_cast<int>(std::ceil(turn / kMostTurn_rad)));
  const double half = edge.half_length / parts;
  std::vector<Eigen::Vector3d> out;
  for (int k = 0; k < parts; ++k) {
    const double t = edge.half_length * ((2 * k + 1.0) / parts - 1);
    const Eigen::Vector2d middle = edge.at(t), along = edge.along_at(t);
    // What lies further out than the arc is longer than its chord.
    const double longer = half * (1 + std::abs(edge.bend) * reach),
                 sagitta = 0.5 * half * half * std::abs(edge.bend);
    const std::vector<Eigen::Vector3d> around =
        points_around(surface_, tree_, frame_.lift(middle - longer * along),
                      frame_.lift(middle + longer * along), reach + sagitta);
    for (const Eigen::Vector3d& x : around) {
      const Eigen::Vector2d local = edge.local(frame_.flat(x));
      if (edge.bend == 0 || (local.x() >= t - half && local.x() < t + half))
        out.emplace_back(local.x(), local.y(), plane_.distance(x));
    }
  }
  return out;
}

/// Points of the plane beside an edge. A narrow face that hangs from the edge lies on one side of the plane,
/// and its points near the edge pass for the plane's; those on the other side are the plane's own. Told from
/// the points too high for most of the plane's: they stand at the edge in excess, on that side only.
EdgeFitter::OwnPoints EdgeFitter::own_points(const std::vector<Eigen::Vector3d>& local,
                                             double half_width) const {
  const double noise = noise_m_;
  OwnPoints out;
  std::vector<Eigen::Vector3d> half[2];
  double at_edge[2] = {0, 0}, within[2] = {0, 0};
  for (const auto& p : local) {
    if (std::abs(p.z()) > kWindow * noise || std::abs(p.y()) > half_width) continue;
    const int side = p.z() > 0 ? 1 : 0;
    out.points.push_back(p);
    half[side].push_back(p);
    if (std::abs(p.z()) < kHigh * noise || p.y() > kWindow * noise) continue;
    (p.y() > -kWindow * noise ? at_edge : within)[side] += 1;
  }
  const double expected = within[0] + within[1] > 0 ? within[1] / (within[0] + within[1]) : 0.5;
  const double edge = at_edge[0] + at_edge[1];
  const double sigma = std::sqrt(std::max(edge * expected * (1 - expected), 1.0));
  const double excess = at_edge[1] - edge * expected;
  const int fuller = excess > 0 ? 1 : 0;
  // More than the plane would have if it went on: seen askew it ends later on one side, but is no denser.
  const double plane_has =
      within[fuller] / std::max(half_width - kWindow * noise, noise) * 2 * kWindow * noise;
  if (std::abs(excess) > kExcess * sigma && at_edge[fuller] > kDenser * plane_has) {
    out.points = std::move(half[1 - fuller]);
    out.one_side = true;
  }
  if (out.points.size() > kMostPoints) {
    const std::size_t step = out.points.size() / kMostPoints + 1;
    std::size_t kept = 0;
    for (std::size_t k = 0; k < out.points.size(); k += step) out.points[kept++] = out.points[k];
    out.points.resize(kept);
  }
  return out;
}

/// The likeliest step for some softnesses; seen askew, noise along the ray shifts points outwards as it lifts
/// them: `shear` is metres outwards per metre of height.
StepFit EdgeFitter::likeliest(const std::vector<Eigen::Vector3d>& points, double half_length,
                              double half_width, double shear, std::span<const double> blurs) {
  std::vector<Eigen::Vector2d> flat;
  flat.reserve(points.size());
  for (const auto& p : points) flat.emplace_back(p.x(), p.y() - shear * p.z());
  StepFit best;
  best.log_likelihood = -INFINITY;
  for (const double blur : blurs) {
    const StepFit step = fit_step(flat, half_length, half_width, blur);
    if (step.converged && step.log_likelihood > best.log_likelihood) best = step;
  }
  return best;
}

/// The second face that begins at the edge, and where that puts it; `side` is 0 if there is none. Nothing if
/// there is something that is no face, or more than faces: what ends where is open.
std::optional<EdgeProfileFit> EdgeFitter::second_face(const Edge& edge) const {
  const double noise = noise_m_;
  const EdgeProfileWindow window =
      edge_profile_window(edge.half_length, noise, plane_.rms_m, plane_.spacing_m);
  const EdgeProfileFit profile =
      fit_edge_profile(local_points(edge, std::hypot(window.half_width, window.half_height)), window);
  const bool likelier = profile.side != 0 && profile.gain >= kLeastGain;
  const double on_face = profile.face * 2 * edge.half_length * profile.depth;
  const bool dense = on_face >= kFewestHanging && profile.face >= kLeastHanging * profile.plane;
  if (likelier && (!dense || profile.rest_share > kMostUnexplained)) return {};
  return likelier ? profile : EdgeProfileFit{};
}

/// Moves the edge to where the plane's density falls off.
StepFit EdgeFitter::move_to_density_step(Edge& edge) const {
  const double noise = noise_m_, half_width = 2.5 * cell_m_;
  const double softest = std::max(noise, 0.3 * plane_.spacing_m);
  StepFit best;
  for (int round = 0; round < 2; ++round) {
    const OwnPoints own =
        own_points(local_points(edge, std::hypot(half_width, kReachNoise * noise)), half_width);
    // The softness of the edge: that which makes the points likeliest.
    const std::array<double, 5> blurs = {0.25 * softest, 0.5 * softest, softest, 2 * softest, 4 * softest};
    best = likeliest(own.points, edge.half_length, half_width, 0, blurs);
    if (!best.converged) return best;
    if (round == 1 && !own.one_side)
      for (const double shear : {-1.0, -0.5, 0.5, 1.0}) {
        const std::array<double, 2> sharper = {best.blur_m, 0.6 * best.blur_m};
        const StepFit step = likeliest(own.points, edge.half_length, half_width, shear, sharper);
        if (step.converged && step.log_likelihood > best.log_likelihood) best = step;
      }
    edge.shift(best.place, best.slope);
  }
  return best;
}

FittedEdge EdgeFitter::fit(const Edge& edge) const {
  FittedEdge out;
  out.edge = edge;
  const double noise = noise_m_;
  const StepFit best = move_to_density_step(out.edge);
  if (!best.converged) return out;
  if (best.blur_m > most_blur_noise_ * std::max(noise, 0.3 * plane_.spacing_m)) {
    out.verdict = FittedEdge::Verdict::soft;
    return out;
  }
  out.across_m = std::hypot(best.sigma_place, 0.5 * edge.half_length * best.sigma_slope);
  out.moved_m = kMovedByBlur * best.blur_m;  // what blurs a free edge also moves it
  const std::optional<EdgeProfileFit> profile = second_face(out.edge);
  if (!profile || (profile->side == 0 && best.rest > kMostRest)) return out;
  out.profile = *profile;
  if (profile->side != 0) {
    const double uneven = std::max(kUneven * noise, plane_.uneven_m);
    out.across_m = std::hypot(profile->sigma_place, uneven);
    out.moved_m = std::hypot(profile->sigma_height, uneven);
    out.edge.shift(profile->place, profile->slope);
  }
  out.verdict = FittedEdge::Verdict::sharp;
  return out;
}

}  // namespace evpose::map_build
