// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/creases.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <tuple>

#include "evpose/core/parallel.h"
#include "evpose/map_build/corner_fill.h"
#include "evpose/map_build/edge_profile_fit.h"
#include "evpose/map_build/median.h"
#include "evpose/map_build/neighbours.h"
#include "evpose/map_build/plane_contacts.h"
#include "evpose/map_build/strips.h"

namespace evpose::map_build {
namespace {

constexpr double kBinSpacings = 2.5;      // length and depth of a bin of support, in point spacings
constexpr double kCovered = 0.35;         // least share of a bin that its points stand for
constexpr double kAmbiguous = 1.5;        // noise: so near to the line a point may be of either plane
constexpr double kFacetSin = 0.87;        // of the angle between facets of a column, pipe or vault, at most
constexpr std::size_t kFewestPoints = 8;  // near the line
constexpr double kMixed = 6;  // square of the noise per width: what points of its neighbours draw a face by
constexpr double kExpected = 12;    // points of a face in the strip that tells whether it reaches the line
constexpr double kReaching = 0.25;  // least share of them
constexpr int kLargestGap = 2;      // bins without support that a segment bridges

/// Area that a plane's points stand for, in bins along a line, on one side of it.
struct Support {
  std::map<int, double> covered[2];  ///< by bin: below and above the line, square metres

  bool holds(int bin, double area) const { return side(bin, area) >= 0; }
  int side(int bin, double area) const {
    for (int s = 0; s < 2; ++s) {
      const auto found = covered[s].find(bin);
      if (found != covered[s].end() && found->second >= kCovered * area) return s;
    }
    return -1;
  }
};

/// Points of a plane near a line: places along it, distances from it within the plane, spacings.
struct NearLine {
  std::vector<Eigen::Vector2d> place;
  std::vector<double> spacing;
};

NearLine near_line(const SurfacePoints& surface, const FittedPlane& plane, const Line& line, double reach_m) {
  NearLine out;
  const Eigen::Vector3f across = line.direction.cross(plane.normal).cast<float>();
  const Eigen::Vector3f origin = line.origin.cast<float>();
  for (const std::uint32_t i : plane.points) {
    const Eigen::Vector3f x = surface.position[i] - origin;
    const float d = across.dot(x);
    if (std::abs(d) > static_cast<float>(reach_m)) continue;
    out.place.emplace_back(line.direction.dot(x.cast<double>()), static_cast<double>(d));
    out.spacing.push_back(static_cast<double>(surface.spacing_m[i]));
  }
  return out;
}

Support support_of(const NearLine& near, double bin_m, double gap_m) {
  Support out;
  for (std::size_t k = 0; k < near.place.size(); ++k) {
    const double d = std::abs(near.place[k].y());
    if (d < gap_m || d > gap_m + bin_m) continue;
    const int bin = static_cast<int>(std::floor(near.place[k].x() / bin_m));
    out.covered[near.place[k].y() > 0 ? 1 : 0][bin] += near.spacing[k] * near.spacing[k];
  }
  return out;
}

/// Whether a face goes on to the line: as dense there as further off, on the side of the sign and between two
/// places.
bool reaches_line(const NearLine& near, double t0, double t1, double side, double gap_m, double bin_m,
                  double least_m) {
  std::vector<double> beyond_gap;
  double far = 0;
  for (const Eigen::Vector2d& place : near.place) {
    const double d = side * place.y() - gap_m;
    if (place.x() < t0 || place.x() > t1 || d < 0 || d > 2 * bin_m) continue;
    beyond_gap.push_back(d);
    far += d > bin_m ? 1 : 0;
  }
  if (far == 0) return true;  // no wider than that, so nothing to compare with
  const double per_m = far / bin_m, strip_m = std::max(kExpected / per_m, least_m);
  const auto there =
      std::count_if(beyond_gap.begin(), beyond_gap.end(), [&](double d) { return d < strip_m; });
  return static_cast<double>(there) >= kReaching * per_m * strip_m;
}

/// The line in which two planes meet, and where their points lie beside it.
struct Meeting {
  PlanePair pair;
  const FittedPlane& a;
  const FittedPlane& b;
  Line line;
  double sine = 0;       ///< of the angle between the planes
  double noise_m = 0;    ///< of the points where they touch
  double gap_m = 0;      ///< nearer to the line a point may be of either plane
  double spacing_m = 0;  ///< median, of the points near the line
  double bin_m = 0;
  double width_a_m = 0, width_b_m = 0;  ///< of the faces, across the line
  NearLine near_a = {}, near_b = {};
  Support in_a = {}, in_b = {};
};

class CreaseFinder {
 public:
  CreaseFinder(const SurfacePoints& surface, const Neighbours& tree, const Planes& planes,
               const CreaseConfig& config)
      : surface_(surface), tree_(tree), planes_(planes), config_(config) {}

  std::vector<LineSegment> segments_of(const PlanePair& pair, const Contact& contact,
                                       const std::vector<std::int32_t>& thirds) const;

 private:
  /// A part of the line, with the directions out of both surfaces.
  struct Stretch {
    double t0, t1;
    Eigen::Vector3d out_a, out_b;
  };
  std::optional<Meeting> meeting_of(const PlanePair& pair, const Contact& contact) const;
  std::vector<Stretch> stretches_of(const Meeting& m, const std::vector<std::int32_t>& thirds) const;
  LineSegment fit_segment(const Meeting& m, const Stretch& stretch) const;
  bool contradicted_by_profile(const LineSegment& segment) const;
  CornerFill fill_of(const Meeting& m, const LineSegment& segment) const;
  double snapped_to_third_plane(const Line& line, double t, double reach_m, const PlanePair& pair,
                                const std::vector<std::int32_t>& thirds) const;

  const SurfacePoints& surface_;
  const Neighbours& tree_;
  const Planes& planes_;
  const CreaseConfig& config_;
};

double CreaseFinder::snapped_to_third_plane(const Line& line, double t, double reach_m, const PlanePair& pair,
                                            const std::vector<std::int32_t>& thirds) const {
  double best = t, nearest = reach_m;
  for (const std::int32_t number : thirds) {
    if (number == pair.first || number == pair.second) continue;
    const FittedPlane& plane = planes_.planes[static_cast<std::size_t>(number)];
    const double slope = plane.normal.dot(line.direction);
    if (std::abs(slope) < 0.5) continue;
    const double meets = -plane.distance(line.origin) / slope;
    if (std::abs(meets - t) < nearest) nearest = std::abs(meets - t), best = meets;
  }
  return best;
}

/// The plane has as many points far beyond the edge as far before it: another face merely stands on it.
bool plane_continues(const std::vector<Eigen::Vector3d>& points, const EdgeProfileWindow& window,
                     double height_m) {
  constexpr double kFar = 0.6, kAsMany = 0.4;
  double beyond = 0, before = 0;
  for (const auto& p : points) {
    if (std::abs(p.z()) > height_m || std::abs(p.y()) > window.half_width) continue;
    beyond += p.y() > kFar * window.half_width ? 1 : 0;
    before += p.y() < -kFar * window.half_width ? 1 : 0;
  }
  return beyond > kAsMany * before;
}

/// The profile across it, explained by faces at right angles, has its edge elsewhere: before books the fronts
/// of their boards go on.
bool CreaseFinder::contradicted_by_profile(const LineSegment& segment) const {
  constexpr double kRightAngle = 0.94, kLeastFaceGain = 10, kMostSigmas = 3, kMostNoise = 0.5, kInPlane = 2.5;
  const double noise = surface_.noise_near(tree_, 0.5 * (segment.begin + segment.end));
  if (segment.normal_a.cross(segment.normal_b).norm() < kRightAngle) return false;
  const Eigen::Vector3d along = segment.tangent(), middle = 0.5 * (segment.begin + segment.end);
  for (const auto& [number, out, other] : {std::tuple(segment.plane_a, segment.normal_a, segment.normal_b),
                                           std::tuple(segment.plane_b, segment.normal_b, segment.normal_a)}) {
    const FittedPlane& plane = planes_.planes[static_cast<std::size_t>(number)];
    const EdgeProfileWindow window =
        edge_profile_window(0.5 * segment.length_m(), noise, plane.rms_m, plane.spacing_m);
    std::vector<Eigen::Vector3d> points = points_around(surface_, tree_, segment.begin, segment.end,
                                                        std::hypot(window.half_width, window.half_height));
    const Eigen::Vector3d over = along.cross(out);
    for (Eigen::Vector3d& p : points) p = {along.dot(p - middle), out.dot(p - middle), over.dot(p - middle)};
    if (plane_continues(points, window, kInPlane * plane.rms_m)) continue;
    const EdgeProfileFit profile = fit_edge_profile(points, window);
    const int side = over.dot(other) > 0 ? -1 : 1;  // the other face goes from the edge against `other`
    if (profile.side != side || profile.gain < kLeastFaceGain) continue;
    if (std::abs(profile.place) > kMostNoise * noise + kMostSigmas * profile.sigma_place) return true;
  }
  return false;
}

/// What stands in the corner, if the two are at right angles.
CornerFill CreaseFinder::fill_of(const Meeting& m, const LineSegment& segment) const {
  constexpr double kRightAngle = 0.94, kWindow_m = 0.24;
  if (m.sine < kRightAngle) return {};
  const Eigen::Vector3d middle = 0.5 * (segment.begin + segment.end);
  const double window = std::min({kWindow_m, m.width_a_m, m.width_b_m});
  const auto over = [](const FittedPlane& plane, const Eigen::Vector3d& out_of_other) -> Eigen::Vector3d {
    return plane.normal.dot(out_of_other) < 0 ? plane.normal : -plane.normal;
  };
  const Eigen::Vector3d over_a = over(m.a, segment.normal_b), over_b = over(m.b, segment.normal_a);
  std::vector<Eigen::Vector2d> heights;
  for (const Eigen::Vector3d& x :
       points_around(surface_, tree_, segment.begin, segment.end, std::sqrt(2.0) * window))
    heights.emplace_back(over_a.dot(x - middle), over_b.dot(x - middle));
  return corner_fill(heights, surface_.noise_near(tree_, middle), window);
}

std::optional<Meeting> CreaseFinder::meeting_of(const PlanePair& pair, const Contact& contact) const {
  const FittedPlane& a = planes_.planes[static_cast<std::size_t>(pair.first)];
  const FittedPlane& b = planes_.planes[static_cast<std::size_t>(pair.second)];
  Meeting out{pair, a, b, intersection(a, b, contact.sum / contact.count)};
  out.sine = a.normal.cross(b.normal).norm();
  out.width_a_m = width_across(surface_, a, out.line);
  out.width_b_m = width_across(surface_, b, out.line);
  // Narrow strips that turn a little are as likely facets of a rounded body as faces with an edge between
  // them.
  if (out.sine < kFacetSin && std::max(out.width_a_m, out.width_b_m) < kFacetWidth_m) return {};
  out.noise_m = surface_.noise_near(tree_, contact.sum / contact.count);
  out.gap_m = kAmbiguous * out.noise_m / std::max(out.sine, 0.3);
  const double widest = kBinSpacings * std::max(a.spacing_m, b.spacing_m) * 2 + out.gap_m;
  out.near_a = near_line(surface_, a, out.line, widest);
  out.near_b = near_line(surface_, b, out.line, widest);
  std::vector<double> spacing = out.near_a.spacing;
  spacing.insert(spacing.end(), out.near_b.spacing.begin(), out.near_b.spacing.end());
  if (spacing.size() < kFewestPoints) return {};
  out.spacing_m = median(spacing);
  out.bin_m = kBinSpacings * out.spacing_m;
  out.in_a = support_of(out.near_a, out.bin_m, out.gap_m);
  out.in_b = support_of(out.near_b, out.bin_m, out.gap_m);
  return out;
}

/// The stretches of the line with points of both planes beside them, the ends moved to where a third plane
/// meets them.
std::vector<CreaseFinder::Stretch> CreaseFinder::stretches_of(const Meeting& m,
                                                              const std::vector<std::int32_t>& thirds) const {
  const double area = m.bin_m * m.bin_m;
  std::set<int> bins;
  for (const auto& side : m.in_a.covered)
    for (const auto& [bin, covered] : side)
      if (m.in_a.holds(bin, area) && m.in_b.holds(bin, area)) bins.insert(bin);
  std::vector<Stretch> out;
  for (auto bin = bins.begin(); bin != bins.end();) {
    const int first = *bin;
    int last = first, held = 0;
    int sides_a = 0, sides_b = 0;
    for (; bin != bins.end() && *bin <= last + 1 + kLargestGap; ++bin, ++held) {
      last = *bin;
      sides_a += m.in_a.side(last, area) == 1 ? 1 : -1;
      sides_b += m.in_b.side(last, area) == 1 ? 1 : -1;
    }
    double t0 = first * m.bin_m, t1 = (last + 1) * m.bin_m;
    if (t1 - t0 < std::max(config_.least_length_m, 2 * m.bin_m) || held < 2) continue;
    if (!reaches_line(m.near_a, t0, t1, sides_a > 0 ? 1 : -1, m.gap_m, m.bin_m, m.noise_m) ||
        !reaches_line(m.near_b, t0, t1, sides_b > 0 ? 1 : -1, m.gap_m, m.bin_m, m.noise_m))
      continue;
    const double reach_m = m.bin_m + m.gap_m;
    t0 = snapped_to_third_plane(m.line, t0, reach_m, m.pair, thirds);
    t1 = snapped_to_third_plane(m.line, t1, reach_m, m.pair, thirds);
    if (t1 - t0 < config_.least_length_m) continue;
    // The surface lies on the side of its points: out of it points the other.
    out.push_back({t0, t1, m.line.direction.cross(m.a.normal) * (sides_a > 0 ? -1 : 1),
                   m.line.direction.cross(m.b.normal) * (sides_b > 0 ? -1 : 1)});
  }
  return out;
}

/// The segment where both surfaces meet, each fitted to the points beside the line.
LineSegment CreaseFinder::fit_segment(const Meeting& m, const Stretch& stretch) const {
  const auto& [t0, t1, out_a, out_b] = stretch;
  const Eigen::Vector3d begin = m.line.at(t0), end = m.line.at(t1);
  const double noise = surface_.noise_near(tree_, 0.5 * (begin + end));
  const std::vector<Eigen::Vector3d> around =
      points_around(surface_, tree_, begin, end, strip_reach_m(noise, m.sine, m.spacing_m));
  const StripFit strip_a = fit_strip(around, {begin, end, -out_a, m.a, m.b, m.sine, m.spacing_m}, noise);
  const StripFit strip_b = fit_strip(around, {begin, end, -out_b, m.b, m.a, m.sine, m.spacing_m}, noise);
  LineSegment segment;
  segment.kind = ContourKind::crease;
  segment.plane_a = m.pair.first;
  segment.plane_b = m.pair.second;
  // Both surfaces moved to where they are beside the line: n_a . x = height a, n_b . x = height b.
  Eigen::Matrix3d rows;
  rows << m.a.normal.transpose(), m.b.normal.transpose(), m.line.direction.transpose();
  const Eigen::Matrix3d solve = rows.inverse();
  const auto moved = [&](double t, double from_middle) -> Eigen::Vector3d {
    return m.line.origin + t * m.line.direction +
           solve * Eigen::Vector3d(strip_a.offset_m + strip_a.slope * from_middle,
                                   strip_b.offset_m + strip_b.slope * from_middle, 0);
  };
  segment.begin = moved(t0, 0.5 * (t0 - t1));
  segment.end = moved(t1, 0.5 * (t1 - t0));
  segment.normal_a = out_a;
  segment.normal_b = out_b;
  // Near its borders a face's points mix with those of its neighbours: the narrower it is, the more they draw
  // it.
  const double mixed = kMixed * noise * noise;
  const auto sigma_of = [&](const StripFit& strip, double width_m) {
    return std::hypot(strip.sigma_m, mixed / std::max(width_m, noise));
  };
  segment.sigma_m =
      std::hypot(sigma_of(strip_a, m.width_a_m), sigma_of(strip_b, m.width_b_m)) / (std::sqrt(2.0) * m.sine);
  return segment;
}

std::vector<LineSegment> CreaseFinder::segments_of(const PlanePair& pair, const Contact& contact,
                                                   const std::vector<std::int32_t>& thirds) const {
  const std::optional<Meeting> meeting = meeting_of(pair, contact);
  if (!meeting) return {};
  const auto reach_on = [&](const FittedPlane& plane) {
    return std::max(2.5 * plane.spacing_m, 2 * meeting->noise_m);
  };
  std::vector<LineSegment> out;
  for (const Stretch& stretch : stretches_of(*meeting, thirds)) {
    LineSegment segment = fit_segment(*meeting, stretch);
    if (segment.sigma_m > config_.most_sigma_m ||
        stands_before(tree_, segment, reach_on(meeting->a), reach_on(meeting->b)) ||
        contradicted_by_profile(segment))
      continue;
    segment.doubtful = fill_of(*meeting, segment).probability > 0.5;
    out.push_back(segment);
  }
  return out;
}

}  // namespace

std::vector<LineSegment> find_creases(const SurfacePoints& surface, const Neighbours& tree,
                                      const Planes& planes, const std::vector<bool>& unfit,
                                      const CreaseConfig& config, ThreadPool& pool) {
  const auto contacts = find_contacts(surface, planes);
  std::vector<std::vector<std::int32_t>> beside(planes.planes.size());
  std::vector<std::pair<PlanePair, Contact>> candidates;
  for (const auto& [pair, contact] : contacts) {
    if (contact.count < 4) continue;
    beside[static_cast<std::size_t>(pair.first)].push_back(pair.second);
    beside[static_cast<std::size_t>(pair.second)].push_back(pair.first);
    if (unfit[static_cast<std::size_t>(pair.first)] || unfit[static_cast<std::size_t>(pair.second)]) continue;
    const FittedPlane& a = planes.planes[static_cast<std::size_t>(pair.first)];
    const FittedPlane& b = planes.planes[static_cast<std::size_t>(pair.second)];
    if (a.normal.cross(b.normal).norm() < std::sin(config.least_angle_rad)) continue;
    candidates.emplace_back(pair, contact);
  }
  const CreaseFinder finder(surface, tree, planes, config);
  std::vector<std::vector<LineSegment>> found(candidates.size());
  pool.for_chunks(candidates.size(), 4, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const auto& [pair, contact] = candidates[k];
      std::vector<std::int32_t> thirds = beside[static_cast<std::size_t>(pair.first)];
      const auto& more = beside[static_cast<std::size_t>(pair.second)];
      thirds.insert(thirds.end(), more.begin(), more.end());
      found[k] = finder.segments_of(pair, contact, thirds);
    }
  });
  std::vector<LineSegment> out;
  for (const auto& segments : found) out.insert(out.end(), segments.begin(), segments.end());
  return out;
}

}  // namespace evpose::map_build
