// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/board_finder.h"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "evpose/calibrate/event_slices.h"
#include "evpose/calibrate/line_lattice.h"
#include "evpose/core/log.h"
#include "evpose/registration/pose_search.h"

namespace evpose {
namespace {

constexpr TimeNs kPause = 50 * kNsPerMs;    // between looks that found nothing
constexpr TimeNs kBetween = 12 * kNsPerMs;  // from the look that found it to the one that tells the velocity
constexpr std::size_t kSearchPoints = 900;
constexpr std::size_t kRefined = 10;            // poses of the best shifts
constexpr double kReach_px = 8;                 // of the refinement
constexpr double kLeastScore = 0.5;             // mean log likelihood ratio of the contours
constexpr double kLeastMargin = 0.1;            // to the best pose that is another one
constexpr double kLoose_m = 1, kLoose_rad = 1;  // sigma of a pose that is refined
constexpr double kDiffers = 0.4;                // of a square: another shift
constexpr double kLeastFlow_px_s = 30;          // at which polarity tells the contrast

/// Distinct values, sorted.
std::vector<double> distinct(const std::set<long>& rounded, double unit_m) {
  std::vector<double> out;
  for (const long v : rounded) {
    const double at_m = unit_m * static_cast<double>(v);
    if (out.empty() || at_m - out.back() > 3 * unit_m) out.push_back(at_m);
  }
  return out;
}

bool is_even(const std::vector<double>& places, double spacing_m) {
  for (std::size_t i = 1; i < places.size(); ++i)
    if (std::abs(places[i] - places[i - 1] - spacing_m) > 1e-3 * spacing_m) return false;
  return places.size() >= 3;
}

/// A look at the board.
struct Look {
  TimeNs t = 0;
  Pose T_map_cam;
  double score = -1e9;
};

Matrix6d loose_information() {
  Vector6d sigma;
  sigma << Eigen::Vector3d::Constant(kLoose_m), Eigen::Vector3d::Constant(kLoose_rad);
  return sigma.cwiseAbs2().cwiseInverse().asDiagonal();
}

class Finder {
 public:
  Finder(const ContourMap& map, const LineBoard& board, const Camera& camera)
      : map_(map), board_(board), camera_(camera), field_(camera.size()) {
    const std::size_t step = std::max<std::size_t>(1, map.points.size() / kSearchPoints);
    for (std::size_t i = 0; i < map.points.size(); i += step) {
      points_.push_back({map.position(i), map.points[i].tangent.cast<double>()});
      shown_.push_back(i);
    }
  }

  std::optional<Look> find(std::span<const FilteredEvent> events);
  Look follow(std::span<const FilteredEvent> events, const Pose& from);
  /// Mean agreement of the polarities with the map's contrast, -1 to 1, while the camera moves like this.
  double polarity(std::span<const FilteredEvent> events, const Pose& T_map_cam,
                  const Eigen::Vector3d& velocity, const Eigen::Vector3d& rate_cam) const;
  /// The same lines with the board turned by 180 degrees.
  Pose turned(const Pose& T_map_cam) const;

 private:
  SearchView view() const { return {field_, camera_, identity_, points_}; }
  std::optional<Pose> pose_of(std::span<const NumberedLine> along_u, std::span<const NumberedLine> along_v,
                              const Pose& T_map_lattice) const;

  const ContourMap& map_;
  const LineBoard& board_;
  const Camera& camera_;
  EdgeField field_;
  const Pose identity_;
  std::vector<SearchPoint> points_;
  std::vector<std::size_t> shown_;  ///< of the map: those of points_
};

/// From the crossings of numbered lines: homography between the lattice and the rays, then the pose.
std::optional<Pose> Finder::pose_of(std::span<const NumberedLine> along_u,
                                    std::span<const NumberedLine> along_v, const Pose& T_map_lattice) const {
  Eigen::MatrixXd A(2 * along_u.size() * along_v.size(), 9);
  Eigen::Index row = 0;
  for (const NumberedLine& a : along_u)
    for (const NumberedLine& b : along_v) {
      const auto ray = camera_.unproject(crossing(a.line, b.line));
      if (!ray || !(ray->z() > 0)) continue;
      const Eigen::Vector3d m = *ray / ray->z();
      const Eigen::RowVector3d at(board_.spacing_m * a.number, board_.spacing_m * b.number, 1);
      A.row(row++) << at, Eigen::RowVector3d::Zero(), -m.x() * at;
      A.row(row++) << Eigen::RowVector3d::Zero(), at, -m.y() * at;
    }
  if (row < 8) return {};
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(A.topRows(row), Eigen::ComputeFullV);
  const Eigen::VectorXd h = svd.matrixV().col(8);
  Eigen::Matrix3d H;
  H << h.segment<3>(0).transpose(), h.segment<3>(3).transpose(), h.segment<3>(6).transpose();
  if (H(2, 2) < 0) H = -H;
  const double scale = 0.5 * (H.col(0).norm() + H.col(1).norm());
  if (!(scale > 0)) return {};
  Eigen::Matrix3d R;
  R.leftCols<2>() = H.leftCols<2>() / scale;
  R.col(2) = R.col(0).cross(R.col(1));
  const Eigen::JacobiSVD<Eigen::Matrix3d> nearest(R, Eigen::ComputeFullU | Eigen::ComputeFullV);
  R = nearest.matrixU() * nearest.matrixV().transpose();
  if (R.determinant() < 0) return {};
  const Pose T_cam_lattice{Eigen::Quaterniond(R).normalized(), H.col(2) / scale};
  return T_map_lattice * T_cam_lattice.inverse();
}

std::optional<Look> Finder::find(std::span<const FilteredEvent> events) {
  const ImageSize size = camera_.size();
  const std::vector<EventLine> lines = find_event_lines(events, size);
  const Eigen::Vector2d middle(0.5 * size.width, 0.5 * size.height);
  const auto rightwards = number_lines(lines, Eigen::Vector2d::UnitX(), middle);
  const auto upwards = number_lines(lines, -Eigen::Vector2d::UnitY(), middle);
  log_detail(text("lines ", lines.size(), ", numbered ", rightwards.size(), " and ", upwards.size()));
  if (rightwards.empty() || upwards.empty()) return {};
  field_.build(events);
  Eigen::Matrix3d axes;
  axes << board_.right, board_.up, board_.right.cross(board_.up);
  Eigen::Matrix3d quarter;
  quarter << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  std::vector<Look> looks;
  for (const bool turned : {false, true}) {
    const int across = turned ? board_.rows : board_.columns, high = turned ? board_.columns : board_.rows;
    const Eigen::Quaterniond q(turned ? Eigen::Matrix3d(axes * quarter) : axes);
    // Where the lattice's origin may lie: the numbered lines have to find room on the board.
    for (int i = 0; i + rightwards.back().number <= across; ++i)
      for (int j = 0; j + upwards.back().number <= high; ++j) {
        const Eigen::Vector3d shift = q * Eigen::Vector3d(i, j, 0);
        const Eigen::Vector3d corner =
            turned ? Eigen::Vector3d(board_.corner + board_.spacing_m * board_.columns * board_.right)
                   : board_.corner;
        const auto pose = pose_of(rightwards, upwards, {q, corner + board_.spacing_m * shift});
        if (pose) looks.push_back({0, *pose, score_pose(view(), *pose, EdgeSpread::coarse)});
      }
  }
  std::ranges::stable_sort(looks, std::ranges::greater(), &Look::score);
  looks.resize(std::min(looks.size(), kRefined));
  for (Look& look : looks) look = follow(events, look.T_map_cam);
  std::ranges::stable_sort(looks, std::ranges::greater(), &Look::score);
  if (looks.empty() || looks.front().score < kLeastScore) return {};
  const Look best = looks.front();
  for (const Look& other : looks) {
    const bool same = (other.T_map_cam.p - best.T_map_cam.p).norm() < kDiffers * board_.spacing_m;
    if (!same && other.score > best.score - kLeastMargin) return {};
  }
  return best;
}

Look Finder::follow(std::span<const FilteredEvent> events, const Pose& from) {
  field_.build(events);
  const PoseGuess refined = refine_pose(view(), from, loose_information(), kReach_px);
  return {0, refined.T_map_body, refined.score};
}

double Finder::polarity(std::span<const FilteredEvent> events, const Pose& T_map_cam,
                        const Eigen::Vector3d& velocity, const Eigen::Vector3d& rate_cam) const {
  const ImageSize size = camera_.size();
  std::vector<int> net(static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height));
  const auto place = [&](int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(size.width) + static_cast<std::size_t>(x);
  };
  for (const FilteredEvent& e : events) net[place(e.x, e.y)] += e.on ? 1 : -1;
  const Pose T_cam_map = T_map_cam.inverse();
  double agree = 0, all = 0;
  for (std::size_t k = 0; k < points_.size(); ++k) {
    const ContourPoint& p = map_.points[shown_[k]];
    const Eigen::Vector3d at = T_cam_map * points_[k].position;
    Matrix23d J;
    const auto pixel = camera_.project(at, &J);
    constexpr int kBeside_px = 2;
    if (p.contrast == 0 || !pixel || !size.contains(*pixel, kBeside_px + 1)) continue;
    const Eigen::Vector3d moves = -(T_cam_map.q * velocity) - rate_cam.cross(at);
    const Eigen::Vector2d along = J * (T_cam_map.q * p.tangent.cast<double>()),
                          out = J * (T_cam_map.q * p.normal.cast<double>());
    Eigen::Vector2d n = Eigen::Vector2d(-along.y(), along.x()).normalized();
    if (n.dot(out) < 0) n = -n;
    const double flow = n.dot(J * moves);
    if (std::abs(flow) < kLeastFlow_px_s) continue;
    // What is bright beyond the edge comes as the edge withdraws.
    const int expected = (flow < 0 ? 1 : -1) * p.contrast;
    for (int dy = -kBeside_px; dy <= kBeside_px; ++dy)
      for (int dx = -kBeside_px; dx <= kBeside_px; ++dx) {
        const int here = net[place(static_cast<int>(std::lround(pixel->x())) + dx,
                                   static_cast<int>(std::lround(pixel->y())) + dy)];
        agree += expected * here;
        all += std::abs(here);
      }
  }
  return all > 0 ? agree / all : 0;
}

Pose Finder::turned(const Pose& T_map_cam) const {
  const Eigen::Vector3d middle =
      board_.corner + 0.5 * board_.spacing_m * (board_.columns * board_.right + board_.rows * board_.up);
  const Eigen::Quaterniond half(Eigen::AngleAxisd(M_PI, board_.right.cross(board_.up)));
  return Pose{half, middle - half * middle} * T_map_cam;
}

/// The state from two looks; the later one is where tracking starts.
StartState state_of(const Look& first, const Look& second, const Pose& T_body_cam) {
  const double dt_s = to_seconds(second.t - first.t);
  const Pose T_cam_body = T_body_cam.inverse();
  const Pose from = first.T_map_cam * T_cam_body, to = second.T_map_cam * T_cam_body;
  StartState out;
  out.t = second.t;
  out.T_map_body = to;
  out.velocity = (to.p - from.p) / dt_s;
  out.angular_rate_body = so3::log(from.q.conjugate() * to.q) / dt_s;
  return out;
}

}  // namespace

std::optional<LineBoard> line_board(const ContourMap& map) {
  if (map.points.empty() || map.planes.size() != 1) return {};
  constexpr double kUnit_m = 1e-5;
  const Eigen::Vector3d towards = map.planes.front().normal.cast<double>();
  // Up is the board's own, as near to z as there is.
  Eigen::Vector3d up = map.points.front().tangent.cast<double>();
  if (std::abs(up.z()) < std::abs(map.points.front().normal.cast<double>().z()))
    up = map.points.front().normal.cast<double>();
  if (up.z() < 0) up = -up;
  const Eigen::Vector3d right = up.cross(towards);
  std::set<long> columns, rows;
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const ContourPoint& p = map.points[i];
    const Eigen::Vector3d tangent = p.tangent.cast<double>(), at = map.position(i);
    constexpr double kParallel = 0.999;
    if (std::abs(tangent.dot(up)) > kParallel)
      columns.insert(std::lround(right.dot(at) / kUnit_m));
    else if (std::abs(tangent.dot(right)) > kParallel)
      rows.insert(std::lround(up.dot(at) / kUnit_m));
    else
      return {};
  }
  const std::vector<double> u = distinct(columns, kUnit_m), v = distinct(rows, kUnit_m);
  if (u.size() < 3 || v.size() < 3) return {};
  const double spacing_m = u[1] - u[0];
  if (!is_even(u, spacing_m) || !is_even(v, spacing_m)) return {};
  const double depth = towards.dot(map.position(0));
  return LineBoard{u[0] * right + v[0] * up + depth * towards,
                   right,
                   up,
                   spacing_m,
                   static_cast<int>(u.size()) - 1,
                   static_cast<int>(v.size()) - 1};
}

Expected<StartState> find_board(const Recording& recording, const ContourMap& map, const LineBoard& board,
                                const Camera& camera) {
  auto reader = open_events(recording);
  if (!reader) return reader.error();
  EventSlices slices(**reader, camera.size());
  Finder finder(map, board, camera);
  TimeNs from = recording.first_ns;
  int looks = 0;
  while (true) {
    const auto more = slices.next(from);
    if (!more) return more.error();
    if (!*more) break;
    from = slices.end() + kPause;
    if (slices.sparse()) continue;
    ++looks;
    auto first = finder.find(slices.events());
    if (!first) continue;
    first->t = slices.middle();
    const auto again = slices.next(slices.end() + kBetween);
    if (!again) return again.error();
    if (!*again) break;
    Look second = finder.follow(slices.events(), first->T_map_cam);
    second.t = slices.middle();
    if (second.score < kLeastScore) continue;
    const StartState seen = state_of(*first, second, {});
    const double agreement =
        finder.polarity(slices.events(), second.T_map_cam, seen.velocity, seen.angular_rate_body);
    log_detail(text("board found, score ", second.score, ", agreement of the polarities ", agreement));
    if (agreement < 0)
      for (Look* look : {&*first, &second}) look->T_map_cam = finder.turned(look->T_map_cam);
    return state_of(*first, second, recording.T_cam_body.inverse());
  }
  return Error{
      recording.folder, text("the board was not found in ", looks, " looks at the events"),
      "check its size and the focal length; move so that all of it is in view, both across and along "
      "its lines; or give the pose with --init"};
}

}  // namespace evpose
