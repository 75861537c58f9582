// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/boundaries.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "evpose/core/parallel.h"
#include "evpose/map_build/arcs.h"
#include "evpose/map_build/beyond_edge.h"
#include "evpose/map_build/edge_fit.h"
#include "evpose/map_build/strips.h"

namespace evpose::map_build {
namespace {

constexpr double kMostDepthSigma = 0.3;  // noise: of the far edge of a narrow face
constexpr double kLeastDepth = 1.5;      // noise: of a face whose edges are told apart
constexpr double kMostDepth = 3.5;       // noise: of a face too narrow for a plane of its own
constexpr double kUneven = 0.1;          // noise: that many points do not average away
constexpr double kArcPart_m = 0.02;      // straight segments that an arc is written in
constexpr int kFewestChunks = 3;         // of an arc, each fitted on its own
constexpr double kLeastGain = 4;         // of log likelihood, by an arc over lines
constexpr double kMostChunkSigma = 3;    // of a chunk's place, over that of an arc

/// What became of a part of an outline.
struct Traced {
  std::vector<LineSegment> segments;
  double left_out_m = 0;
};

class BoundaryFinder {
 public:
  BoundaryFinder(const BoundaryInput& input, std::size_t number, const BoundaryConfig& config)
      : tree_(input.tree),
        views_(input.views),
        plane_(input.planes.planes[number]),
        number_(static_cast<std::int32_t>(number)),
        noise_m_(noise_on(input.surface, plane_)),
        outline_(input.outlines[number]),
        creases_(input.creases[number]),
        config_(config),
        fitter_(input.surface, input.tree, plane_, outline_.cell_m, config.most_blur_noise),
        beyond_(input.surface, input.tree, plane_, input.views) {}

  std::vector<LineSegment> find_arcs_of(const Ring& ring) const;
  Traced trace_side(const Ring& ring, std::size_t number, const std::vector<LineSegment>& arcs) const;

 private:
  const PlaneFrame& frame() const { return fitter_.frame(); }
  double sigma_m(const FittedEdge& fitted, const Eigen::Vector3d& at) const;
  double least_side_m() const { return std::max(config_.least_length_m, 3 * outline_.cell_m); }
  bool runs_along(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                  const std::vector<LineSegment>& segments) const;
  std::pair<Eigen::Vector2d, Eigen::Vector2d> longest_part_without(const std::vector<LineSegment>& arcs,
                                                                   const Eigen::Vector2d& a,
                                                                   const Eigen::Vector2d& b) const;
  bool is_edge(const FittedEdge& fitted, const LineSegment& segment) const;
  std::optional<LineSegment> far_edge(const LineSegment& near, const EdgeProfileFit& profile) const;
  std::vector<LineSegment> segments_along(const FittedEdge& fitted) const;
  double chunk_m() const { return std::max(config_.least_length_m, 2.5 * outline_.cell_m); }
  std::vector<FittedEdge> fit_chunks(const Circle& circle, double from_rad, double to_rad, int chunks) const;
  std::vector<LineSegment> fit_arc(const Ring& ring, const ArcStretch& stretch) const;

  const Neighbours& tree_;
  std::span<const View> views_;
  const FittedPlane& plane_;
  std::int32_t number_;
  double noise_m_;  ///< of the plane's points
  const Outline& outline_;
  const std::vector<LineSegment>& creases_;
  const BoundaryConfig& config_;
  EdgeFitter fitter_;
  BeyondEdge beyond_;
};

/// Half or more of the side lies along segments that were found.
bool BoundaryFinder::runs_along(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                                const std::vector<LineSegment>& segments) const {
  const double reach = 1.5 * outline_.cell_m + 2 * noise_m_;
  constexpr int kProbes = 8;
  int near = 0;
  for (int k = 0; k < kProbes; ++k) {
    const Eigen::Vector3d x = frame().lift(a + (b - a) * ((k + 0.5) / kProbes));
    near += std::any_of(segments.begin(), segments.end(),
                        [&](const LineSegment& segment) { return distance(segment, x) < reach; })
                ? 1
                : 0;
  }
  return near >= kProbes / 2;
}

/// The longest part of a side that no arc runs along.
std::pair<Eigen::Vector2d, Eigen::Vector2d> BoundaryFinder::longest_part_without(
    const std::vector<LineSegment>& arcs, const Eigen::Vector2d& a, const Eigen::Vector2d& b) const {
  if (arcs.empty()) return {a, b};
  constexpr int kParts = 32;
  int first = 0, count = 0;
  for (int begin = 0; begin < kParts;) {
    int end = begin;
    while (end < kParts && !runs_along(a + (b - a) * end / kParts, a + (b - a) * (end + 1) / kParts, arcs))
      ++end;
    if (end - begin > count) first = begin, count = end - begin;
    begin = end + 1;
  }
  return {a + (b - a) * first / kParts, a + (b - a) * (first + count) / kParts};
}

/// Of a second face too narrow for a plane of its own.
std::optional<LineSegment> BoundaryFinder::far_edge(const LineSegment& near,
                                                    const EdgeProfileFit& profile) const {
  const double noise = noise_m_;
  if (profile.side == 0 || !profile.ends || profile.sigma_depth > kMostDepthSigma * noise) return {};
  if (profile.depth < kLeastDepth * noise || profile.depth > kMostDepth * noise) return {};
  LineSegment far = near;
  far.begin += profile.side * profile.depth * plane_.normal;
  far.end += profile.side * profile.depth * plane_.normal;
  far.normal_b = profile.side * plane_.normal;
  if (profile.beyond > profile.under) far.normal_a = -near.normal_a;
  far.sigma_m = std::sqrt(near.sigma_m * near.sigma_m + profile.sigma_depth * profile.sigma_depth / 2);
  return far;
}

double BoundaryFinder::sigma_m(const FittedEdge& fitted, const Eigen::Vector3d& at) const {
  const double uneven = std::max(kUneven * noise_m_, plane_.uneven_m);
  const double off = std::hypot(plane_.sigma_at(at), uneven);
  return std::sqrt((fitted.across_m * fitted.across_m + fitted.moved_m * fitted.moved_m + off * off) / 2);
}

/// A straight edge is one segment; an arc many, each touching it in its middle.
std::vector<LineSegment> BoundaryFinder::segments_along(const FittedEdge& fitted) const {
  const Edge& edge = fitted.edge;
  const int side = fitted.profile.side;
  const int parts =
      edge.bend == 0 ? 1 : std::max(1, static_cast<int>(std::ceil(2 * edge.half_length / kArcPart_m)));
  std::vector<LineSegment> out;
  for (int k = 0; k < parts; ++k) {
    const double t = edge.half_length * ((2 * k + 1.0) / parts - 1);
    const Eigen::Vector2d along = edge.along_at(t);
    const Eigen::Vector2d across(along.y(), -along.x()), half = edge.half_length / parts * along;
    const auto lifted = [&](const Eigen::Vector2d& p) -> Eigen::Vector3d {
      return frame().lift(p) + (side != 0 ? fitted.profile.height : 0) * plane_.normal;
    };
    LineSegment segment;
    segment.plane_a = number_;
    segment.kind = side != 0 ? ContourKind::crease : ContourKind::boundary;
    segment.begin = lifted(edge.at(t) - half);
    segment.end = lifted(edge.at(t) + half);
    segment.normal_a = across.x() * frame().first + across.y() * frame().second;
    if (side != 0) segment.normal_b = -side * plane_.normal;
    segment.sigma_m = sigma_m(fitted, 0.5 * (segment.begin + segment.end));
    out.push_back(segment);
  }
  return out;
}

/// `segment`: where it would be, straight.
bool BoundaryFinder::is_edge(const FittedEdge& fitted, const LineSegment& segment) const {
  if (fitted.verdict != FittedEdge::Verdict::sharp || beyond_.surface_continues(segment)) return false;
  const double reach = beyond_.reach_m();
  return fitted.profile.side == 0 || !stands_before(tree_, segment, reach, reach);
}

Traced BoundaryFinder::trace_side(const Ring& ring, std::size_t number,
                                  const std::vector<LineSegment>& arcs) const {
  const Eigen::Vector2d &from = ring.coarse[number], &to = ring.coarse[(number + 1) % ring.coarse.size()];
  if (runs_along(from, to, creases_)) return {};
  const auto [a, b] = longest_part_without(arcs, from, to);
  Traced left_out{{}, (b - a).norm()};
  if (left_out.left_out_m < least_side_m()) return left_out;
  const auto shadow = [&](LineSegment segment) {
    segment.kind = ContourKind::shadow;
    segment.sigma_m = outline_.cell_m;
    segment.normal_b.setZero();
    return Traced{{segment}, 0};
  };
  FittedEdge fitted;
  fitted.edge = Edge::between(a, b);
  const LineSegment as_traced = segments_along(fitted).front();
  if (beyond_.hidden_from_views(as_traced)) return shadow(as_traced);
  fitted = fitter_.fit(fitted.edge);
  if (fitted.verdict == FittedEdge::Verdict::soft) return shadow(as_traced);
  const LineSegment segment = segments_along(fitted).front();
  if (fitted.across_m > config_.most_sigma_m || !is_edge(fitted, segment)) return left_out;
  if (views_.empty() && beyond_.something_stands_before(segment)) return shadow(segment);
  Traced out{{segment}, 0};
  if (const auto far = far_edge(segment, fitted.profile)) out.segments.push_back(*far);
  return out;
}

/// The arc of a circle from one angle to another; `inside`: +1 where the surface is inside the circle, or -1.
Edge arc_edge(const Circle& circle, double from_rad, double to_rad, double inside) {
  const double middle = 0.5 * (from_rad + to_rad);
  const Eigen::Vector2d outwards(std::cos(middle), std::sin(middle)), out = inside * outwards;
  return {circle.centre + circle.radius_m * outwards,
          {-out.y(), out.x()},
          out,
          0.5 * std::abs(to_rad - from_rad) * circle.radius_m,
          inside / circle.radius_m};
}

/// Angle of a place on a circle, within half a turn of another.
double angle_near(const Circle& circle, const Eigen::Vector2d& place, double other_rad) {
  const Eigen::Vector2d d = place - circle.centre;
  return other_rad + std::remainder(std::atan2(d.y(), d.x()) - other_rad, 2 * std::numbers::pi);
}

int nearest_side(const std::vector<Eigen::Vector2d>& corners, const Eigen::Vector2d& place) {
  double least = INFINITY;
  std::size_t nearest = 0;
  for (std::size_t s = 0; s < corners.size(); ++s) {
    const Eigen::Vector2d &a = corners[s], &b = corners[(s + 1) % corners.size()];
    const double share = std::clamp((place - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
    const double off = (place - a - share * (b - a)).norm();
    if (off < least) least = off, nearest = s;
  }
  return static_cast<int>(nearest);
}

/// Fits the chunks of an arc one by one; those that are edges.
std::vector<FittedEdge> BoundaryFinder::fit_chunks(const Circle& circle, double from_rad, double to_rad,
                                                   int chunks) const {
  std::vector<FittedEdge> out;
  const double step = (to_rad - from_rad) / chunks, inside = step > 0 ? 1 : -1;
  for (int k = 0; k < chunks; ++k) {
    const FittedEdge chunk =
        fitter_.fit(arc_edge(circle, from_rad + k * step, from_rad + (k + 1) * step, inside));
    FittedEdge straight = chunk;
    straight.edge.bend = 0;
    const LineSegment segment = segments_along(straight).front();
    if (chunk.across_m > kMostChunkSigma * config_.most_sigma_m || !is_edge(chunk, segment)) continue;
    if (views_.empty() ? beyond_.something_stands_before(segment) : beyond_.hidden_from_views(segment))
      continue;
    out.push_back(chunk);
  }
  return out;
}

/// The part of a stretch that an arc explains better than the straight sides of the ring.
std::vector<LineSegment> BoundaryFinder::fit_arc(const Ring& ring, const ArcStretch& stretch) const {
  const double first = angle_near(stretch.circle, ring.steps[stretch.first], 0);
  double last = first;
  for (std::size_t k = 1; k < stretch.count; ++k)
    last = angle_near(stretch.circle, ring.steps[(stretch.first + k) % ring.steps.size()], last);
  const int chunks = static_cast<int>(std::abs(last - first) * stretch.circle.radius_m / chunk_m());
  if (chunks < kFewestChunks) return {};
  const std::vector<FittedEdge> fitted = fit_chunks(stretch.circle, first, last, chunks);
  if (2 * static_cast<int>(fitted.size()) < std::max(2 * kFewestChunks, chunks)) return {};
  // Each chunk tells two places of the curve; the nearest straight side is the line they would be on.
  std::vector<CurvePlace> places;
  std::vector<int> line_of;
  for (const FittedEdge& chunk : fitted)
    for (const double t : {-0.5, 0.5}) {
      const Eigen::Vector2d place = chunk.edge.at(t * chunk.edge.half_length);
      places.push_back({place, std::sqrt(2.0) * chunk.across_m});
      line_of.push_back(nearest_side(ring.coarse, place));
    }
  const auto run = likeliest_arc(places, line_of, 2 * static_cast<std::size_t>(kFewestChunks));
  if (!run || run->gain < kLeastGain) return {};
  // All points along the run once more, together: a short chunk is drawn inwards by having few.
  const auto of_run = std::span(fitted).subspan(run->first / 2, run->count / 2);
  const double from = angle_near(run->circle, of_run.front().edge.middle, first);
  double to = from;
  for (const FittedEdge& chunk : of_run) to = angle_near(run->circle, chunk.edge.middle, to);
  const double inside = last > first ? 1 : -1;
  const double half = std::min(of_run.front().edge.half_length / run->circle.radius_m,
                               std::numbers::pi - 0.5 * std::abs(to - from));
  const FittedEdge whole =
      fitter_.fit(arc_edge(run->circle, from - inside * half, to + inside * half, inside));
  if (whole.verdict != FittedEdge::Verdict::sharp || whole.across_m > config_.most_sigma_m) return {};
  std::vector<LineSegment> out = segments_along(whole);
  std::erase_if(out, [&](const LineSegment& segment) {
    const Eigen::Vector2d at = frame().flat(0.5 * (segment.begin + segment.end));
    // Where its chunk was no edge, the arc has a gap.
    const bool is_edge = std::any_of(of_run.begin(), of_run.end(), [&](const FittedEdge& chunk) {
      return std::abs(chunk.edge.local(at).x()) <= chunk.edge.half_length;
    });
    return !is_edge || runs_along(frame().flat(segment.begin), frame().flat(segment.end), creases_);
  });
  return out;
}

std::vector<LineSegment> BoundaryFinder::find_arcs_of(const Ring& ring) const {
  std::vector<LineSegment> out;
  for (const ArcStretch& stretch : find_arcs(ring.steps, outline_.cell_m, kFewestChunks * chunk_m()))
    for (LineSegment& segment : fit_arc(ring, stretch)) {
      segment.chain = static_cast<std::int32_t>(stretch.first);
      out.push_back(segment);
    }
  return out;
}

}  // namespace

std::vector<Boundaries> find_boundaries(const BoundaryInput& input, const BoundaryConfig& config,
                                        ThreadPool& pool) {
  const std::size_t planes = input.planes.planes.size();
  std::vector<std::optional<BoundaryFinder>> finders(planes);
  pool.for_chunks(planes, 8, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p)
      if (!input.unfit[p]) finders[p].emplace(input, p, config);
  });
  // Large planes have most of the outlines: the work is shared out by rings, then by sides.
  struct Task {
    std::size_t plane, ring, side;
  };
  std::vector<Task> rings, sides;
  std::vector<std::vector<std::vector<LineSegment>>> arcs(planes);
  for (std::size_t p = 0; p < planes; ++p) {
    if (!finders[p]) continue;
    arcs[p].resize(input.outlines[p].rings.size());
    for (std::size_t r = 0; r < input.outlines[p].rings.size(); ++r) {
      rings.push_back({p, r, 0});
      for (std::size_t s = 0; s < input.outlines[p].rings[r].coarse.size(); ++s) sides.push_back({p, r, s});
    }
  }
  pool.for_chunks(rings.size(), 1, [&](std::size_t k, std::size_t, std::size_t) {
    const auto& [p, r, s] = rings[k];
    arcs[p][r] = finders[p]->find_arcs_of(input.outlines[p].rings[r]);
  });
  std::vector<Traced> traced(sides.size());
  pool.for_chunks(sides.size(), 4, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const auto& [p, r, s] = sides[k];
      traced[k] = finders[p]->trace_side(input.outlines[p].rings[r], s, arcs[p][r]);
    }
  });
  std::vector<Boundaries> out(planes);
  std::int32_t chains = 0;
  for (const auto& [p, r, s] : rings) {
    std::int32_t in_ring = -1;
    for (LineSegment segment : arcs[p][r]) {
      chains += segment.chain != in_ring ? 1 : 0;
      in_ring = segment.chain;
      segment.chain = chains;
      out[p].segments.push_back(segment);
    }
  }
  for (std::size_t k = 0; k < sides.size(); ++k) {
    Boundaries& of = out[sides[k].plane];
    of.segments.insert(of.segments.end(), traced[k].segments.begin(), traced[k].segments.end());
    of.left_out_m += traced[k].left_out_m;
  }
  return out;
}

}  // namespace evpose::map_build
