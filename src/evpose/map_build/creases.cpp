// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/creases.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "evpose/core/parallel.h"
#include "evpose/map_build/neighbours.h"
#include "evpose/map_build/section_fit.h"
#include "evpose/map_build/strips.h"

namespace evpose::map_build {
namespace {

constexpr double kBinSpacings = 2.5;    // length and depth of a bin of support, in point spacings
constexpr double kCovered = 0.35;       // least share of a bin that its points stand for
constexpr double kAmbiguous = 1.5;      // noise: so near to the line a point may be of either plane
constexpr double kFacetSin = 0.87;      // of the angle between facets of a column, pipe or vault, at most
constexpr double kFacetWidth_m = 0.25;  // of such facets, at most
constexpr int kLargestGap = 2;          // bins without support that a piece bridges

using PlanePair = std::pair<std::int32_t, std::int32_t>;

/// Pairs of planes with points beside each other, and the middle of those points.
struct Contact {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
};

std::map<PlanePair, Contact> find_contacts(const SurfacePoints& surface, const Planes& planes) {
  std::map<PlanePair, Contact> contacts;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    const std::int32_t own = planes.label[i];
    if (own < 0) continue;
    for (int k = 0; k < SurfacePoints::kLinks; ++k) {
      const std::int32_t other =
          planes.label[surface.links[i * SurfacePoints::kLinks + static_cast<std::size_t>(k)]];
      if (other < 0 || other == own) continue;
      Contact& contact = contacts[std::minmax(own, other)];
      contact.sum += surface.position[i].cast<double>();
      ++contact.count;
    }
  }
  return contacts;
}

/// A line in two planes, with what lies beside it.
struct Line {
  Eigen::Vector3d origin, direction;
  double at(const Eigen::Vector3d& x) const { return direction.dot(x - origin); }
};

Line intersection(const FittedPlane& a, const FittedPlane& b, const Eigen::Vector3d& near) {
  Line line;
  line.direction = a.normal.cross(b.normal).normalized();
  // The point of both planes nearest to `near`.
  Eigen::Matrix3d rows;
  rows << a.normal.transpose(), b.normal.transpose(), line.direction.transpose();
  const Eigen::Vector3d right(-a.d, -b.d, line.direction.dot(near));
  line.origin = rows.partialPivLu().solve(right);
  return line;
}

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

/// Extent of a plane's points across a line, if they were spread evenly.
double width_across(const SurfacePoints& surface, const FittedPlane& plane, const Line& line) {
  const Eigen::Vector3d across = line.direction.cross(plane.normal);
  double sum = 0;
  for (const std::uint32_t i : plane.points) {
    const double d = across.dot(surface.position[i].cast<double>() - plane.centre);
    sum += d * d;
  }
  return std::sqrt(12 * sum / static_cast<double>(plane.points.size()));
}

class CreaseFinder {
 public:
  CreaseFinder(const SurfacePoints& surface, const Neighbours& tree, const Planes& planes,
               const CreaseConfig& config)
      : surface_(surface), tree_(tree), planes_(planes), config_(config) {}

  std::vector<Piece> pieces_of(const PlanePair& pair, const Contact& contact,
                               const std::vector<std::int32_t>& thirds) const;

 private:
  bool contradicted(const Piece& piece) const;
  double snapped(const Line& line, double t, double reach_m, const PlanePair& pair,
                 const std::vector<std::int32_t>& thirds) const;

  const SurfacePoints& surface_;
  const Neighbours& tree_;
  const Planes& planes_;
  const CreaseConfig& config_;
};

double CreaseFinder::snapped(const Line& line, double t, double reach_m, const PlanePair& pair,
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
bool goes_on(const std::vector<Eigen::Vector3d>& points, const SectionWindow& window, double height_m) {
  constexpr double kFar = 0.6, kAsMany = 0.4;
  double beyond = 0, before = 0;
  for (const auto& p : points) {
    if (std::abs(p.z()) > height_m || std::abs(p.y()) > window.half_width) continue;
    beyond += p.y() > kFar * window.half_width ? 1 : 0;
    before += p.y() < -kFar * window.half_width ? 1 : 0;
  }
  return beyond > kAsMany * before;
}

/// The section across it, explained by faces at right angles, has its edge elsewhere: before books the fronts
/// of their boards go on.
bool CreaseFinder::contradicted(const Piece& piece) const {
  constexpr double kRightAngle = 0.94, kLeastGain = 10, kMostSigmas = 3, kMostNoise = 0.5, kInPlane = 2.5;
  const double noise = surface_.scale.noise_m;
  if (piece.normal_a.cross(piece.normal_b).norm() < kRightAngle) return false;
  const Eigen::Vector3d along = piece.tangent(), middle = 0.5 * (piece.begin + piece.end);
  for (const auto& [number, out, other] : {std::tuple(piece.plane_a, piece.normal_a, piece.normal_b),
                                           std::tuple(piece.plane_b, piece.normal_b, piece.normal_a)}) {
    const FittedPlane& plane = planes_.planes[static_cast<std::size_t>(number)];
    const SectionWindow window = section_window(0.5 * piece.length_m(), noise, plane.rms_m, plane.spacing_m);
    std::vector<Eigen::Vector3d> points = points_around(surface_, tree_, piece.begin, piece.end,
                                                        std::hypot(window.half_width, window.half_height));
    const Eigen::Vector3d over = along.cross(out);
    for (Eigen::Vector3d& p : points) p = {along.dot(p - middle), out.dot(p - middle), over.dot(p - middle)};
    if (goes_on(points, window, kInPlane * plane.rms_m)) continue;
    const SectionFit section = fit_section(points, window);
    const int side = over.dot(other) > 0 ? -1 : 1;  // the other face goes from the edge against `other`
    if (section.side != side || section.gain < kLeastGain) continue;
    if (std::abs(section.place) > kMostNoise * noise + kMostSigmas * section.sigma_place) return true;
  }
  return false;
}

std::vector<Piece> CreaseFinder::pieces_of(const PlanePair& pair, const Contact& contact,
                                           const std::vector<std::int32_t>& thirds) const {
  const FittedPlane& a = planes_.planes[static_cast<std::size_t>(pair.first)];
  const FittedPlane& b = planes_.planes[static_cast<std::size_t>(pair.second)];
  const double sine = a.normal.cross(b.normal).norm();
  const Line line = intersection(a, b, contact.sum / contact.count);
  // Narrow strips that turn a little are as likely facets of a rounded body as faces with an edge between
  // them.
  if (sine < kFacetSin &&
      std::max(width_across(surface_, a, line), width_across(surface_, b, line)) < kFacetWidth_m)
    return {};
  const double gap_m = kAmbiguous * surface_.scale.noise_m / std::max(sine, 0.3);
  const double widest = kBinSpacings * std::max(a.spacing_m, b.spacing_m) * 2 + gap_m;
  const NearLine near_a = near_line(surface_, a, line, widest), near_b = near_line(surface_, b, line, widest);
  std::vector<double> spacing = near_a.spacing;
  spacing.insert(spacing.end(), near_b.spacing.begin(), near_b.spacing.end());
  if (spacing.size() < 8) return {};
  std::nth_element(spacing.begin(), spacing.begin() + static_cast<std::ptrdiff_t>(spacing.size() / 2),
                   spacing.end());
  const double bin_m = kBinSpacings * spacing[spacing.size() / 2];
  const Support in_a = support_of(near_a, bin_m, gap_m), in_b = support_of(near_b, bin_m, gap_m);
  const double area = bin_m * bin_m;
  std::set<int> bins;
  for (const auto& side : in_a.covered)
    for (const auto& [bin, covered] : side)
      if (in_a.holds(bin, area) && in_b.holds(bin, area)) bins.insert(bin);
  std::vector<Piece> out;
  for (auto bin = bins.begin(); bin != bins.end();) {
    const int first = *bin;
    int last = first, held = 0;
    int sides_a = 0, sides_b = 0;
    for (; bin != bins.end() && *bin <= last + 1 + kLargestGap; ++bin, ++held) {
      last = *bin;
      sides_a += in_a.side(last, area) == 1 ? 1 : -1;
      sides_b += in_b.side(last, area) == 1 ? 1 : -1;
    }
    double t0 = first * bin_m, t1 = (last + 1) * bin_m;
    if (t1 - t0 < std::max(config_.least_length_m, 2 * bin_m) || held < 2) continue;
    const double reach_m = bin_m + gap_m;
    t0 = snapped(line, t0, reach_m, pair, thirds);
    t1 = snapped(line, t1, reach_m, pair, thirds);
    if (t1 - t0 < config_.least_length_m) continue;
    // The surface lies on the side of its points: out of it points the other.
    const Eigen::Vector3d out_a = line.direction.cross(a.normal) * (sides_a > 0 ? -1 : 1);
    const Eigen::Vector3d out_b = line.direction.cross(b.normal) * (sides_b > 0 ? -1 : 1);
    const Eigen::Vector3d begin = line.origin + t0 * line.direction, end = line.origin + t1 * line.direction;
    const std::vector<Eigen::Vector3d> around =
        points_around(surface_, tree_, begin, end,
                      strip_reach_m(surface_.scale.noise_m, sine, spacing[spacing.size() / 2]));
    const StripFit strip_a = fit_strip(around, {begin, end, -out_a, a, b, sine, spacing[spacing.size() / 2]},
                                       surface_.scale.noise_m);
    const StripFit strip_b = fit_strip(around, {begin, end, -out_b, b, a, sine, spacing[spacing.size() / 2]},
                                       surface_.scale.noise_m);
    Piece piece;
    piece.kind = ContourKind::crease;
    piece.plane_a = pair.first;
    piece.plane_b = pair.second;
    // Both surfaces moved to where they are beside the line: n_a . x = height a, n_b . x = height b.
    Eigen::Matrix3d rows;
    rows << a.normal.transpose(), b.normal.transpose(), line.direction.transpose();
    const Eigen::Matrix3d solve = rows.inverse();
    const auto moved = [&](double t, double from_middle) -> Eigen::Vector3d {
      return line.origin + t * line.direction +
             solve * Eigen::Vector3d(strip_a.offset_m + strip_a.slope * from_middle,
                                     strip_b.offset_m + strip_b.slope * from_middle, 0);
    };
    piece.begin = moved(t0, 0.5 * (t0 - t1));
    piece.end = moved(t1, 0.5 * (t1 - t0));
    piece.normal_a = out_a;
    piece.normal_b = out_b;
    piece.sigma_m = std::hypot(strip_a.sigma_m, strip_b.sigma_m) / (std::sqrt(2.0) * sine);
    const auto reach_on = [&](const FittedPlane& plane) {
      return std::max(2.5 * plane.spacing_m, 2 * surface_.scale.noise_m);
    };
    if (piece.sigma_m > config_.most_sigma_m || stands_before(tree_, piece, reach_on(a), reach_on(b)) ||
        contradicted(piece))
      continue;
    out.push_back(piece);
  }
  return out;
}

}  // namespace

std::vector<Piece> find_creases(const SurfacePoints& surface, const Neighbours& tree, const Planes& planes,
                                const std::vector<bool>& unfit, const CreaseConfig& config,
                                ThreadPool& pool) {
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
  std::vector<std::vector<Piece>> found(candidates.size());
  pool.for_chunks(candidates.size(), 4, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const auto& [pair, contact] = candidates[k];
      std::vector<std::int32_t> thirds = beside[static_cast<std::size_t>(pair.first)];
      const auto& more = beside[static_cast<std::size_t>(pair.second)];
      thirds.insert(thirds.end(), more.begin(), more.end());
      found[k] = finder.pieces_of(pair, contact, thirds);
    }
  });
  std::vector<Piece> out;
  for (const auto& pieces : found) out.insert(out.end(), pieces.begin(), pieces.end());
  return out;
}

namespace {

/// Narrow planes that touch at a small angle, as facets of a column do, however few points each has.
void mark_facets(const SurfacePoints& surface, const Planes& planes, std::vector<bool>& curved) {
  constexpr double kLeastSin = 0.1, kMostSin = 0.75;
  constexpr int kFewestContacts = 12;
  for (const auto& [pair, contact] : find_contacts(surface, planes)) {
    const auto first = static_cast<std::size_t>(pair.first), second = static_cast<std::size_t>(pair.second);
    const FittedPlane &a = planes.planes[first], &b = planes.planes[second];
    const double sine = a.normal.cross(b.normal).norm();
    if (contact.count < kFewestContacts || sine < kLeastSin || sine > kMostSin) continue;
    const Line line = intersection(a, b, contact.sum / contact.count);
    if (std::max(width_across(surface, a, line), width_across(surface, b, line)) > kFacetWidth_m) continue;
    curved[first] = curved[second] = true;
  }
}

}  // namespace

std::vector<bool> find_curved(const SurfacePoints& surface, const Planes& planes) {
  std::vector<bool> out(planes.planes.size(), false);
  for (std::size_t p = 0; p < planes.planes.size(); ++p) {
    const FittedPlane& plane = planes.planes[p];
    const Eigen::Vector3d u = plane.normal.unitOrthogonal(), v = plane.normal.cross(u);
    // Height over the plane as a quadratic form: 1, x, y, x^2, xy, y^2.
    Eigen::Matrix<double, 6, 6> squares = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
    Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
    for (const std::uint32_t i : plane.points) {
      const Eigen::Vector3d x = surface.position[i].cast<double>() - plane.centre;
      const double a = u.dot(x), b = v.dot(x), height = plane.normal.dot(x);
      Eigen::Matrix<double, 6, 1> row;
      row << 1, a, b, a * a, a * b, b * b;
      squares += row * row.transpose();
      right += height * row;
      spread += Eigen::Vector2d(a, b) * Eigen::RowVector2d(a, b);
    }
    spread /= static_cast<double>(plane.points.size());
    const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> solver(squares);
    const Eigen::Matrix<double, 6, 1> form = solver.solve(right);
    if (solver.info() != Eigen::Success || !form.allFinite()) continue;
    Eigen::Matrix2d hessian;
    hessian << 2 * form[3], form[4], form[4], 2 * form[5];
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> bend(hessian);
    const int k = std::abs(bend.eigenvalues()[1]) > std::abs(bend.eigenvalues()[0]) ? 1 : 0;
    const Eigen::Vector2d axis = bend.eigenvectors().col(k);
    // A strip of width w has the spread w / sqrt(12).
    const double width = std::sqrt(12 * axis.dot(spread * axis));
    const double turn = std::abs(bend.eigenvalues()[k]) * width;
    // The curvature's own error: that of a parabola over a strip, 12 sqrt(5) noise / (sqrt(n) w^2).
    const double sigma_turn =
        12 * std::sqrt(5.0) * plane.rms_m / (std::sqrt(static_cast<double>(plane.points.size())) * width);
    out[p] = turn > 0.2 && turn > 4 * sigma_turn;
  }
  mark_facets(surface, planes, out);
  return out;
}

}  // namespace evpose::map_build
