// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/boundaries.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "evpose/map_build/section_fit.h"
#include "evpose/map_build/strips.h"

namespace evpose::map_build {
namespace {

constexpr double kMovedByBlur = 0.3;
constexpr double kWindow = 2.5;            // noise: half width of what is taken for one surface
constexpr double kReachNoise = 4;          // noise: of what is looked at around an edge
constexpr double kFewestHanging = 8;       // points of a second face
constexpr double kLeastHanging = 0.3;      // ... and its density, as a share of the plane's
constexpr double kMostUnexplained = 0.1;   // share of the points at an edge that no surface there explains
constexpr double kMostDepthSigma = 0.3;    // noise: of the far edge of a narrow face
constexpr double kLeastDepth = 1.5;        // noise: of a face whose edges are told apart ...
constexpr double kMostDepth = 3.5;         // ... and of one too narrow for a plane of its own
constexpr double kLeastGain = 10;          // of log likelihood, by a second face
constexpr double kHigh = 1.2;              // noise: few of the plane's points are further from it
constexpr double kDenser = 1.5;            // ... and over the plane's density
constexpr double kExcess = 3;              // sigma: of points at the edge over chance
constexpr std::size_t kMostPoints = 1200;  // for one edge
constexpr double kUneven = 0.1;            // noise: that many points do not average away
constexpr double kMostRest = 0.12;         // density beyond a free edge, as a share of that within

double side_of_the_rest(const SurfacePoints& surface, const FittedPlane& plane);

class BoundaryFinder {
 public:
  BoundaryFinder(const SurfacePoints& surface, const Neighbours& tree, const FittedPlane& plane,
                 const Outline& outline, const std::vector<Piece>& creases, const BoundaryConfig& config)
      : surface_(surface),
        tree_(tree),
        plane_(plane),
        frame_(plane),
        outline_(outline),
        creases_(creases),
        config_(config) {
    free_side_ = side_of_the_rest(surface, plane);
  }

  Boundaries find(std::int32_t number) const;

 private:
  struct Edge {
    Eigen::Vector2d middle, along, out;  ///< in the plane's frame
    double half_length;
    /// Outwards, and turned by a slope; the surface is on the left.
    void shift(double place, double slope) {
      middle += place * out;
      along = (along + slope * out).normalized();
      out = {along.y(), -along.x()};
    }
  };
  std::vector<Eigen::Vector3d> local_points(const Edge& edge, double reach) const;
  struct OwnPoints {
    std::vector<Eigen::Vector3d> points;  ///< along, outwards, over the plane
    bool one_side = false;                ///< only those on one side of the plane
  };
  OwnPoints own_points(const std::vector<Eigen::Vector3d>& local, double half_width) const;
  static StepFit likeliest(const std::vector<Eigen::Vector3d>& points, double half_length, double half_width,
                           double shear, std::span<const double> blurs);
  std::optional<SectionFit> second_face(const Edge& edge) const;
  bool explained(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const;
  bool goes_on(const Piece& piece) const;
  bool covered(const Piece& piece) const;
  StepFit settle(Edge& edge) const;
  std::optional<Piece> far_edge(const Piece& near, const SectionFit& section) const;
  void fit(const Eigen::Vector2d& a, const Eigen::Vector2d& b, std::int32_t number,
           std::vector<Piece>& out) const;

  const SurfacePoints& surface_;
  const Neighbours& tree_;
  const FittedPlane& plane_;
  PlaneFrame frame_;
  const Outline& outline_;
  const std::vector<Piece>& creases_;
  const BoundaryConfig& config_;
  double free_side_ = 0;
};

/// Half or more of the side lies along a crease.
bool BoundaryFinder::explained(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const {
  const double reach = 1.5 * outline_.cell_m + 2 * surface_.scale.noise_m;
  constexpr int kProbes = 8;
  int near = 0;
  for (int k = 0; k < kProbes; ++k) {
    const Eigen::Vector3d x = frame_.lift(a + (b - a) * ((k + 0.5) / kProbes));
    near += std::any_of(creases_.begin(), creases_.end(),
                        [&](const Piece& piece) { return distance(piece, x) < reach; })
                ? 1
                : 0;
  }
  return near >= kProbes / 2;
}

/// Points in the plane beyond the edge: it is none, only a change of density or of the plane's number.
bool BoundaryFinder::goes_on(const Piece& piece) const {
  constexpr int kProbes = 12;
  int hit = 0;
  std::uint32_t index = 0;
  float square = 0;
  const double reach = std::max(2.5 * plane_.spacing_m, 2 * surface_.scale.noise_m);
  for (int k = 0; k < kProbes; ++k) {
    const Eigen::Vector3d x =
        piece.begin + (piece.end - piece.begin) * ((k + 0.5) / kProbes) + 1.6 * reach * piece.normal_a;
    if (tree_.nearest(x.cast<float>(), {&index, 1}, {&square, 1}) == 1 &&
        std::sqrt(static_cast<double>(square)) < reach)
      ++hit;
  }
  return hit > kProbes / 2;
}

/// Something stands before the plane beyond the edge, on the side that the plane was seen from: the surface
/// is not over there, it is merely hidden. Only told of planes that have nearly everything on one side, like
/// walls.
bool BoundaryFinder::covered(const Piece& piece) const {
  if (free_side_ == 0) return false;
  constexpr int kProbes = 8, kHeights = 6;
  constexpr double kHighest_m = 0.45;
  int hit = 0;
  std::uint32_t index = 0;
  float square = 0;
  const double reach = std::max(2 * plane_.spacing_m, 0.04), lowest = 2 * reach;
  for (int k = 0; k < kProbes; ++k) {
    const Eigen::Vector3d beyond =
        piece.begin + (piece.end - piece.begin) * ((k + 0.5) / kProbes) + 1.5 * reach * piece.normal_a;
    for (int h = 0; h < kHeights; ++h) {
      const Eigen::Vector3d x =
          beyond + free_side_ * (lowest + (kHighest_m - lowest) * h / (kHeights - 1)) * plane_.normal;
      if (tree_.nearest(x.cast<float>(), {&index, 1}, {&square, 1}) == 1 &&
          std::sqrt(static_cast<double>(square)) < reach) {
        ++hit;
        break;
      }
    }
  }
  return hit > kProbes / 2;
}

/// Side of the plane that nearly all other points of the cloud lie on; 0 if there is none.
double side_of_the_rest(const SurfacePoints& surface, const FittedPlane& plane) {
  constexpr double kAway_m = 0.1, kNearlyAll = 0.9;
  double above = 0, below = 0;
  const std::size_t step = std::max<std::size_t>(1, surface.size() / 4000);
  for (std::size_t i = 0; i < surface.size(); i += step) {
    const double d = plane.distance(surface.position[i].cast<double>());
    above += d > kAway_m ? 1 : 0;
    below += d < -kAway_m ? 1 : 0;
  }
  if (above > kNearlyAll * (above + below)) return 1;
  return below > kNearlyAll * (above + below) ? -1 : 0;
}

/// All points of the cloud near an edge in its coordinates: along it, outwards, over the plane.
std::vector<Eigen::Vector3d> BoundaryFinder::local_points(const Edge& edge, double reach) const {
  const Eigen::Vector3d begin = frame_.lift(edge.middle - edge.half_length * edge.along);
  const Eigen::Vector3d end = frame_.lift(edge.middle + edge.half_length * edge.along);
  std::vector<Eigen::Vector3d> out = points_around(surface_, tree_, begin, end, reach);
  for (Eigen::Vector3d& x : out) {
    const Eigen::Vector2d flat = frame_.flat(x) - edge.middle;
    x = {edge.along.dot(flat), edge.out.dot(flat), plane_.distance(x)};
  }
  return out;
}

/// Points of the plane beside an edge. A narrow face that hangs from the edge lies on one side of the plane,
/// and its points near the edge pass for the plane's; those on the other side are the plane's own. Told from
/// the points too high for most of the plane's: they stand at the edge in excess, on that side only.
BoundaryFinder::OwnPoints BoundaryFinder::own_points(const std::vector<Eigen::Vector3d>& local,
                                                     double half_width) const {
  const double noise = surface_.scale.noise_m;
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
StepFit BoundaryFinder::likeliest(const std::vector<Eigen::Vector3d>& points, double half_length,
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
std::optional<SectionFit> BoundaryFinder::second_face(const Edge& edge) const {
  const double noise = surface_.scale.noise_m;
  const SectionWindow window = section_window(edge.half_length, noise, plane_.rms_m, plane_.spacing_m);
  const SectionFit section =
      fit_section(local_points(edge, std::hypot(window.half_width, window.half_height)), window);
  const bool likelier = section.side != 0 && section.gain >= kLeastGain;
  const double on_face = section.face * 2 * edge.half_length * section.depth;
  const bool dense = on_face >= kFewestHanging && section.face >= kLeastHanging * section.plane;
  if (likelier && (!dense || section.rest_share > kMostUnexplained)) return {};
  return likelier ? section : SectionFit{};
}

/// Moves the edge to where the plane's density falls off; not converged where that is too soft for an edge.
StepFit BoundaryFinder::settle(Edge& edge) const {
  const double noise = surface_.scale.noise_m, half_width = 2.5 * outline_.cell_m;
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
  best.converged = best.blur_m <= config_.most_blur_noise * softest;
  return best;
}

/// Of a second face too narrow for a plane of its own.
std::optional<Piece> BoundaryFinder::far_edge(const Piece& near, const SectionFit& section) const {
  const double noise = surface_.scale.noise_m;
  if (section.side == 0 || !section.ends || section.sigma_depth > kMostDepthSigma * noise) return {};
  if (section.depth < kLeastDepth * noise || section.depth > kMostDepth * noise) return {};
  Piece far = near;
  far.begin += section.side * section.depth * plane_.normal;
  far.end += section.side * section.depth * plane_.normal;
  far.normal_b = section.side * plane_.normal;
  if (section.beyond > section.under) far.normal_a = -near.normal_a;
  far.sigma_m = std::sqrt(near.sigma_m * near.sigma_m + section.sigma_depth * section.sigma_depth / 2);
  return far;
}

void BoundaryFinder::fit(const Eigen::Vector2d& a, const Eigen::Vector2d& b, std::int32_t number,
                         std::vector<Piece>& out) const {
  Edge edge{0.5 * (a + b), (b - a).normalized(), Eigen::Vector2d::Zero(), 0.5 * (b - a).norm()};
  edge.shift(0, 0);
  const double noise = surface_.scale.noise_m;
  const StepFit best = settle(edge);
  if (!best.converged) return;
  double across = std::hypot(best.sigma_place, 0.5 * edge.half_length * best.sigma_slope);
  double moved = kMovedByBlur * best.blur_m, height = 0;  // what blurs a free edge also moves it
  const double uneven = std::max(kUneven * noise, plane_.uneven_m);
  const std::optional<SectionFit> section = second_face(edge);
  if (!section) return;
  const int side = section->side;
  if (side != 0) {
    height = section->height;
    across = std::hypot(section->sigma_place, uneven);
    moved = std::hypot(section->sigma_height, uneven);
    edge.shift(section->place, section->slope);
  } else if (best.rest > kMostRest) {
    return;
  }
  const auto lifted = [&](double t, double over) -> Eigen::Vector3d {
    return frame_.lift(edge.middle + t * edge.half_length * edge.along) + over * plane_.normal;
  };
  Piece piece;
  piece.plane_a = number;
  piece.kind = side != 0 ? ContourKind::crease : ContourKind::boundary;
  piece.begin = lifted(-1, height);
  piece.end = lifted(1, height);
  piece.normal_a = edge.out.x() * frame_.first + edge.out.y() * frame_.second;
  if (side != 0) piece.normal_b = -side * plane_.normal;
  const double off = std::hypot(plane_.sigma_at(0.5 * (piece.begin + piece.end)), uneven);
  piece.sigma_m = std::sqrt((across * across + moved * moved + off * off) / 2);
  if (across > config_.most_sigma_m || goes_on(piece) || covered(piece)) return;
  const double reach = std::max(2.5 * plane_.spacing_m, 2 * noise);
  if (side != 0 && stands_before(tree_, piece, reach, reach)) return;
  out.push_back(piece);
  if (const auto far = far_edge(piece, *section)) out.push_back(*far);
}

Boundaries BoundaryFinder::find(std::int32_t number) const {
  Boundaries out;
  for (const Ring& ring : outline_.rings) {
    for (std::size_t k = 0; k < ring.coarse.size(); ++k) {
      const Eigen::Vector2d &a = ring.coarse[k], &b = ring.coarse[(k + 1) % ring.coarse.size()];
      const double length = (b - a).norm();
      if (explained(a, b)) continue;
      const std::size_t before = out.pieces.size();
      if (length >= std::max(config_.least_length_m, 3 * outline_.cell_m)) fit(a, b, number, out.pieces);
      if (out.pieces.size() == before) out.shadow_m += length;
    }
  }
  return out;
}

}  // namespace

Boundaries find_boundaries(const SurfacePoints& surface, const Neighbours& tree, const FittedPlane& plane,
                           std::int32_t number, const Outline& outline, const std::vector<Piece>& creases,
                           const BoundaryConfig& config) {
  return BoundaryFinder(surface, tree, plane, outline, creases, config).find(number);
}

}  // namespace evpose::map_build
