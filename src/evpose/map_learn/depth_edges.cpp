// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/depth_edges.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

#include "evpose/map_learn/contour_neighbours.h"
#include "evpose/map_learn/flight_events.h"
#include "evpose/map_learn/space_sweep.h"
#include "evpose/tracker/contour_selection.h"

namespace evpose::map_learn {
namespace {

constexpr TimeNs kMaskEvery = 10 * kNsPerMs;  // between two drawings of the map's contours
constexpr double kSpan_s = 0.01;              // over which their motion is taken; of no use here
constexpr int kBeside_px = 3;                 // to each side of a contour: its events are not swept
constexpr double kWay = 0.1;                  // of a sweep, in typical depths
constexpr TimeNs kLongest = 2 * kNsPerS;
constexpr double kLeastParallax_cells = 12;  // of a thing at the typical depth over a sweep
constexpr double kWidth_cells = 500;         // of a reference view, at most: 70 MB with all slices
constexpr double kGrazing = 0.4;             // sine of the angle to the line of sight: less tells no depth
constexpr int kLeastSlices = 8, kMostSlices = 96;
constexpr double kNear = 0.5, kFar = 1.3;  // of a sweep, in depths of the nearest and farthest twentieth
constexpr std::size_t kMostEvents = 500;   // of a packet: 2 million a second

/// Sweeps along a flight, one after the other.
class FlightSweeper {
 public:
  FlightSweeper(const TrackJob& job, const Trajectory& trajectory)
      : job_(job),
        trajectory_(trajectory),
        camera_(*job.setup.camera),
        rays_(pixel_rays(camera_)),
        tangents_(largest_tangents(rays_)),
        focal_cells_(std::min(camera_.focal_px(), kWidth_cells / (2 * tangents_.x()))),
        index_(*job.map),
        segments_(cut_into_segments(*job.map)),
        contours_(index_, segments_, camera_, camera_, job.setup.T_body_cam, job.config.tracker.visible,
                  job.config.tracker.event_registration.map_sigma_m, false) {}

  void take(TimeNs t, const Pose& T_map_cam, std::span<const Event> events);
  std::vector<SweptPiece> pieces() {
    end_view();
    return std::move(pieces_);
  }
  double cell_m(double depth_m) const { return depth_m / focal_cells_; }

 private:
  void follow(TimeNs t);
  void draw_mask(const FusionState& state);
  void begin_view(TimeNs t);
  void end_view();

  const TrackJob& job_;
  const Trajectory& trajectory_;
  const Camera& camera_;
  std::vector<Eigen::Vector3d> rays_;
  Eigen::Vector2d tangents_;
  double focal_cells_;
  ContourIndex index_;
  ContourSegments segments_;
  ContourSelection contours_;
  std::size_t next_state_ = 0;
  std::optional<TimeNs> drawn_;
  std::vector<bool> mask_;  ///< pixels near contours of the map

  std::optional<TimeNs> view_end_;
  std::optional<SpaceSweep> sweep_;  ///< none: too little parallax until the view's end
  Pose T_map_view_, T_view_map_;
  int view_ = 0;
  std::vector<SweptPiece> pieces_;
};

void FlightSweeper::follow(TimeNs t) {
  for (; next_state_ < trajectory_.size() && trajectory_[next_state_].t <= t; ++next_state_)
    contours_.choose(trajectory_[next_state_].nav.T_map_body);
  if (drawn_ && t - *drawn_ < kMaskEvery) return;
  drawn_ = t;
  draw_mask(state_at(trajectory_, t));
}

void FlightSweeper::draw_mask(const FusionState& state) {
  const ImageSize size = camera_.size();
  contours_.project(state, kSpan_s);
  mask_.assign(rays_.size(), false);
  for (const ContourSample& sample : contours_.samples()) {
    const int u = static_cast<int>(std::lround(sample.pixel.x())),
              v = static_cast<int>(std::lround(sample.pixel.y()));
    for (int y = std::max(0, v - kBeside_px); y <= std::min(size.height - 1, v + kBeside_px); ++y)
      for (int x = std::max(0, u - kBeside_px); x <= std::min(size.width - 1, u + kBeside_px); ++x)
        mask_[static_cast<std::size_t>(y) * static_cast<std::size_t>(size.width) +
              static_cast<std::size_t>(x)] = true;
  }
}

/// A view lasts until the camera has gone some way; its reference is where it is in the middle of it.
void FlightSweeper::begin_view(TimeNs t) {
  std::vector<double> depths;
  for (const ContourSample& sample : contours_.samples()) depths.push_back(sample.depth_m);
  view_end_ = t + kMaskEvery;  // nothing of the map in view
  if (depths.empty()) return;
  std::sort(depths.begin(), depths.end());
  const double typical = depths[depths.size() / 2];
  const auto position = [&](TimeNs at) {
    return (state_at(trajectory_, at).nav.T_map_body * job_.setup.T_body_cam).p;
  };
  const Eigen::Vector3d from = position(t);
  while (*view_end_ - t < kLongest && *view_end_ < trajectory_.back().t &&
         (position(*view_end_) - from).norm() < kWay * typical)
    *view_end_ += kMaskEvery;
  T_map_view_ = state_at(trajectory_, t + (*view_end_ - t) / 2).nav.T_map_body * job_.setup.T_body_cam;
  T_view_map_ = T_map_view_.inverse();
  const double way = std::max((position(*view_end_) - T_map_view_.p).norm(), (from - T_map_view_.p).norm());
  if (2 * way * focal_cells_ < kLeastParallax_cells * typical) return;
  SpaceSweep::View view{tangents_, focal_cells_};
  view.nearest_m = kNear * depths[depths.size() / 20];
  view.farthest_m = kFar * depths[depths.size() - 1 - depths.size() / 20];
  const double parallax_cells = way * focal_cells_ * (1 / view.nearest_m - 1 / view.farthest_m);
  view.slices = std::clamp(static_cast<int>(std::lround(parallax_cells)), kLeastSlices, kMostSlices);
  sweep_.emplace(view);
}

void FlightSweeper::end_view() {
  if (!sweep_) return;
  for (const SweptLine& line : sweep_->take_lines()) {
    const Eigen::Vector3d middle = 0.5 * (line.a + line.b), along = (line.b - line.a).normalized();
    const double depth = middle.z();
    if (along.cross(middle.normalized()).norm() < kGrazing) continue;
    pieces_.push_back({T_map_view_ * line.a, T_map_view_ * line.b,
                       T_map_view_.rotation() * middle.normalized(), cell_m(depth),
                       depth * depth * line.inverse_depth_sigma, line.significance, view_});
  }
  sweep_.reset();
  ++view_;
}

void FlightSweeper::take(TimeNs t, const Pose& T_map_cam, std::span<const Event> events) {
  follow(t);
  if (!view_end_ || t >= *view_end_) {
    end_view();
    begin_view(t);
  }
  if (!sweep_) return;
  const Pose T_view_cam = T_view_map_ * T_map_cam;
  const Eigen::Matrix3d R = T_view_cam.rotation();
  const std::size_t every = events.size() / kMostEvents + 1,
                    width = static_cast<std::size_t>(camera_.size().width);
  for (std::size_t i = 0; i < events.size(); i += every) {
    const std::size_t pixel =
        static_cast<std::size_t>(events[i].y) * width + static_cast<std::size_t>(events[i].x);
    if (mask_[pixel] || rays_[pixel].z() == 0) continue;
    if (const Eigen::Vector3d ray = R * rays_[pixel]; ray.z() > 0) sweep_->add(T_view_cam.p, ray);
  }
}

constexpr double kSameDirection = 0.97;  // cosine between two views' pieces of one edge
constexpr double kAgree = 9;             // chi-square, two directions

Eigen::Vector3d direction(const SweptPiece& p) { return (p.b - p.a).normalized(); }

/// The plane across a piece, in which others are compared with it.
struct Across {
  Eigen::Vector3d along;
  Eigen::Matrix<double, 3, 2> axes;

  explicit Across(const SweptPiece& p) : along(direction(p)) {
    axes.col(0) = (p.ray - along.dot(p.ray) * along).normalized();
    axes.col(1) = along.cross(axes.col(0));
  }
  /// From a point to where a piece's line passes through the plane at it.
  Eigen::Vector2d offset(const Eigen::Vector3d& from, const SweptPiece& piece) const {
    const Eigen::Vector3d way = direction(piece);
    const Eigen::Vector3d there = piece.a + along.dot(from - piece.a) / along.dot(way) * way;
    return axes.transpose() * (there - from);
  }
  Eigen::Matrix2d covariance(const SweptPiece& p) const {
    const Eigen::Vector2d depth = p.along_ray_sigma_m * (axes.transpose() * p.ray);
    return depth * depth.transpose() + p.across_sigma_m * p.across_sigma_m * Eigen::Matrix2d::Identity();
  }
};

bool agree(const SweptPiece& p, const SweptPiece& q) {
  if (std::abs(direction(p).dot(direction(q))) < kSameDirection) return false;
  const Across across(p);
  const Eigen::Vector3d middle = 0.5 * (p.a + p.b);
  if (std::abs(across.along.dot(0.5 * (q.a + q.b) - middle)) >
      0.5 * ((p.b - p.a).norm() + (q.b - q.a).norm()))
    return false;
  const Eigen::Vector2d d = across.offset(middle, q);
  return d.dot((across.covariance(p) + across.covariance(q)).inverse() * d) < kAgree;
}

/// The piece where all of them together put it.
SweptPiece fused(SweptPiece piece, const std::vector<SweptPiece>& all, const std::vector<std::size_t>& same) {
  const Across across(piece);
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
  Eigen::Vector2d pull_a = Eigen::Vector2d::Zero(), pull_b = pull_a;
  for (const std::size_t i : same) {
    const Eigen::Matrix2d weight = across.covariance(all[i]).inverse();
    information += weight;
    pull_a += weight * across.offset(piece.a, all[i]);
    pull_b += weight * across.offset(piece.b, all[i]);
  }
  const Eigen::Matrix2d known = information.inverse();
  piece.a += across.axes * (known * pull_a);
  piece.b += across.axes * (known * pull_b);
  piece.along_ray_sigma_m = std::sqrt(known(0, 0)) / across.axes.col(0).dot(piece.ray);
  return piece;
}

constexpr double kPointSpacing_m = 0.01;
constexpr double kFromContour_m = 8e-3;  // from a contour of the map that runs beside it
constexpr double kViewChange = 0.25;     // rad by which other views see an error along the ray

std::vector<ContourPoint> points_of(const SweptPiece& piece, const Eigen::Vector3d& anchor,
                                    std::int32_t contour) {
  const double length = (piece.b - piece.a).norm();
  const int count = std::max(2, static_cast<int>(length / kPointSpacing_m));
  ContourPoint p;
  p.tangent = direction(piece).cast<float>();
  p.normal = direction(piece).cross(piece.ray).normalized().cast<float>();
  p.length = static_cast<float>(length / count);
  p.sigma = static_cast<float>(std::hypot(0.5 * piece.across_sigma_m, kViewChange * piece.along_ray_sigma_m));
  p.kind = ContourKind::boundary;
  p.contour = contour;
  std::vector<ContourPoint> out;
  for (int i = 0; i < count; ++i) {
    p.position = (piece.a + (i + 0.5) / count * (piece.b - piece.a) - anchor).cast<float>();
    out.push_back(p);
  }
  return out;
}

constexpr float kOfRound = 1.3F, kRoundError_m = 0.01F;  // of a body's radius and beside it
constexpr float kUpright = 0.95F, kBesideAxis_m = 0.1F;

std::vector<ContourPoint> axes_of_round_bodies(const ContourMap& map) {
  std::vector<ContourPoint> out;
  std::copy_if(map.points.begin(), map.points.end(), std::back_inserter(out),
               [](const ContourPoint& p) { return p.kind == ContourKind::cylinder_axis; });
  return out;
}

/// The side of a round body is elsewhere from another place.
bool is_side_of_round_body(const ContourPoint& p, const std::vector<ContourPoint>& axes) {
  return std::any_of(axes.begin(), axes.end(), [&](const ContourPoint& axis) {
    if (std::abs(axis.tangent.dot(p.tangent)) < kUpright) return false;
    const Eigen::Vector3f d = p.position - axis.position;
    const float along = d.dot(axis.tangent);
    return std::abs(along) < kBesideAxis_m &&
           (d - along * axis.tangent).norm() < kOfRound * axis.sigma + kRoundError_m;
  });
}

}  // namespace

std::vector<SweptPiece> shared_pieces(std::vector<SweptPiece> pieces) {
  std::stable_sort(pieces.begin(), pieces.end(),
                   [](const SweptPiece& p, const SweptPiece& q) { return p.significance > q.significance; });
  std::vector<bool> taken(pieces.size(), false);
  std::vector<SweptPiece> out;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    if (taken[i]) continue;
    std::vector<std::size_t> same{i};
    bool elsewhere = false;
    for (std::size_t j = 0; j < pieces.size(); ++j)
      if (j != i && !taken[j] && agree(pieces[i], pieces[j])) {
        same.push_back(j);
        elsewhere = elsewhere || pieces[j].view != pieces[i].view;
      }
    if (!elsewhere) continue;
    out.push_back(fused(pieces[i], pieces, same));
    for (const std::size_t j : same) taken[j] = true;
  }
  return out;
}

Expected<std::vector<ContourPoint>> find_depth_edges(const TrackJob& job, const Trajectory& trajectory,
                                                     std::int32_t first_contour,
                                                     const std::function<bool(double)>& progress) {
  FlightSweeper sweeper(job, trajectory);
  const auto ok = for_each_packet(job, trajectory, 1, progress,
                                  [&](TimeNs t, const Pose& T_map_cam, std::span<const Event> events) {
                                    sweeper.take(t, T_map_cam, events);
                                  });
  if (!ok) return ok.error();
  const ContourNeighbours neighbours(*job.map);
  const std::vector<ContourPoint> axes = axes_of_round_bodies(*job.map);
  std::vector<ContourPoint> out;
  for (const SweptPiece& piece : shared_pieces(sweeper.pieces())) {
    const auto points = points_of(piece, job.map->anchor, first_contour);
    const auto beside = std::count_if(points.begin(), points.end(), [&](const ContourPoint& p) {
      const double within_m = std::max(kFromContour_m, piece.across_sigma_m);
      return neighbours.beside(p.position, p.tangent, static_cast<float>(within_m)) ||
             is_side_of_round_body(p, axes);
    });
    if (2 * beside > static_cast<std::ptrdiff_t>(points.size())) continue;
    out.insert(out.end(), points.begin(), points.end());
    ++first_contour;
  }
  return out;
}

}  // namespace evpose::map_learn
