// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/board_start.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "evpose/calibrate/event_image.h"
#include "evpose/camera/adjusted_camera.h"
#include "evpose/core/log.h"

namespace evpose {
namespace {

constexpr TimeNs kPictureEvery = 100 * kNsPerMs;  // pictures, at first: neighbours tell the velocity
constexpr std::size_t kClose = 15, kMostPictures = 60;
constexpr TimeNs kNeighbours = 3 * kPictureEvery / 2;
// Before, there are bands behind the edges alone, and the board is found in them beside where it is.
constexpr TimeNs kFirstPicture = 3 * kPictureEvery;
constexpr double kGravity_m_s2 = 9.81;
constexpr TimeNs kLeastOfGravity = 500 * kNsPerMs;

using Told = std::function<bool(double)>;

/// Times of pictures: some close to each other, the rest over the whole recording.
std::vector<TimeNs> picture_times(const Recording& recording) {
  std::vector<TimeNs> out;
  for (TimeNs t = recording.first_ns + kFirstPicture; t <= recording.last_ns && out.size() < kClose;
       t += kPictureEvery)
    out.push_back(t);
  if (out.empty()) return out;
  const TimeNs from = out.back(), rest = recording.last_ns - from;
  const TimeNs step = std::max(kPictureEvery, rest / TimeNs{kMostPictures - kClose});
  for (TimeNs t = from + step; t <= recording.last_ns; t += step) out.push_back(t);
  return out;
}

/// The views of one recording, before any pose is known; none where `progress` ends it.
Expected<std::optional<std::vector<BoardView>>> find_views(const Recording& recording, int number,
                                                           const BoardFinder& finder, const Told& progress) {
  auto reader = open_events(recording);
  if (!reader) return reader.error();
  EventImage image(recording.camera.size);
  const std::vector<TimeNs> times = picture_times(recording);
  std::vector<BoardView> out;
  EventPacket packet;
  for (auto next = times.begin(); next != times.end();) {
    const auto more = (*reader)->next(packet);
    if (!more) return more.error();
    if (!*more) break;
    image.add(packet);
    const TimeNs now = packet.time(packet.events.back());
    if (now < *next) continue;
    const bool lately = !out.empty() && now - out.back().t < kNeighbours;
    if (auto pixels = finder.find(image.at(now), image.size(), lately ? out.back().pixels : LatticePixels()))
      out.push_back({now, *std::move(pixels), {}, 0, number});
    while (next != times.end() && *next <= now) ++next;
    if (!progress(static_cast<double>(next - times.begin()) / static_cast<double>(times.size())))
      return std::optional<std::vector<BoardView>>();
  }
  return std::optional(std::move(out));
}

/// The velocity at a view by its neighbours, if there are any near it on both sides.
struct ViewMotion {
  Eigen::Vector3d velocity, rate_body;  ///< map frame, m/s; rad/s
};
std::optional<ViewMotion> motion_at(std::span<const BoardView> views, std::size_t k, const Pose& T_cam_body) {
  if (k == 0 || k + 1 >= views.size() || views[k + 1].t - views[k - 1].t > 2 * kNeighbours) return {};
  const Pose before = views[k - 1].T_map_cam * T_cam_body, after = views[k + 1].T_map_cam * T_cam_body;
  const double dt_s = to_seconds(views[k + 1].t - views[k - 1].t);
  return ViewMotion{(after.p - before.p) / dt_s, so3::log(before.q.conjugate() * after.q) / dt_s};
}

/// The first view that has a velocity, with its neighbours; else the first view.
BoardSighting sighting_of(const BoardLattice& lattice, std::span<const BoardView> views,
                          const Pose& T_cam_body) {
  for (std::size_t k = 1; k + 1 < views.size(); ++k)
    if (motion_at(views, k, T_cam_body)) return {lattice, {views[k - 1], views[k], views[k + 1]}};
  return {lattice, {views.front()}};
}

/// Longest stretch of views, from its first to its last with a velocity, that are near each other.
std::pair<std::size_t, std::size_t> longest_stretch(std::span<const BoardView> views,
                                                    const Pose& T_cam_body) {
  std::pair<std::size_t, std::size_t> best(0, 0);
  for (std::size_t from = 0, k = 0; k < views.size(); ++k) {
    if (!motion_at(views, k, T_cam_body))
      from = k + 1;
    else if (k - from > best.second - best.first)
      best = {from, k};
  }
  return best;
}

/// What the accelerometer holds up against over a stretch of views, less the change of velocity. Zero where
/// no stretch is long enough.
Expected<Eigen::Vector3d> gravity_of(const Recording& recording, std::span<const BoardView> views) {
  const auto [from, to] = longest_stretch(views, recording.T_cam_body);
  if (views[to].t - views[from].t < kLeastOfGravity) return Eigen::Vector3d(0, 0, 0);
  auto imu = open_imu(recording);
  if (!imu) return imu.error();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double count = 0;
  ImuSample sample;
  while (true) {
    const auto more = imu->next(sample);
    if (!more) return more.error();
    if (!*more || sample.t > views[to].t) break;
    if (sample.t <= views[from].t) continue;
    const auto after = std::ranges::lower_bound(views, sample.t, {}, &BoardView::t);
    const BoardView& before = *(after - 1);
    const double share = to_seconds(sample.t - before.t) / to_seconds(after->t - before.t);
    const Pose T_map_cam = before.T_map_cam.plus(share * after->T_map_cam.minus(before.T_map_cam));
    sum += (T_map_cam * recording.T_cam_body).q * sample.accel;
    ++count;
  }
  if (count == 0) return sum;
  const Eigen::Vector3d change = motion_at(views, to, recording.T_cam_body)->velocity -
                                 motion_at(views, from, recording.T_cam_body)->velocity;
  return Eigen::Vector3d(change / to_seconds(views[to].t - views[from].t) - sum / count);
}

Eigen::MatrixXd covariance_of(const CalibrationSigma& sigma, const CameraIntrinsics& camera) {
  const Eigen::VectorXd s = sigma.of_intrinsics(camera).cwiseMax(1e-9);
  const Eigen::Index n = s.size();
  return s.asDiagonal() * sigma.of_correlation(camera).topLeftCorner(n, n) * s.asDiagonal();
}

}  // namespace

std::optional<StartState> BoardSighting::start(const Camera& camera, const Pose& T_cam_body) const {
  std::vector<BoardView> views = views_;
  for (BoardView& view : views) {
    const auto pose = best_pose_before_board(camera, lattice_, view.pixels);
    if (!pose) return {};
    view.T_map_cam = *pose;
  }
  const std::size_t k = views.size() / 2;
  StartState out;
  out.t = views[k].t;
  out.T_map_body = views[k].T_map_cam * T_cam_body;
  if (const auto motion = motion_at(views, k, T_cam_body)) {
    out.velocity = motion->velocity;
    out.angular_rate_body = motion->rate_body;
  }
  return out;
}

Expected<std::optional<BoardStart>> find_board_start(const std::vector<Recording>& recordings,
                                                     const Board& board, const CameraIntrinsics& given,
                                                     const CalibrationSigma& sigma, const Told& progress) {
  const BoardLattice lattice = lattice_of(board);
  const auto finder = make_board_finder(board);
  if (!finder) return finder.error();
  std::vector<BoardView> all;
  for (std::size_t k = 0; k < recordings.size(); ++k) {
    const auto told = [&](double share) {
      return progress((static_cast<double>(k) + share) / static_cast<double>(recordings.size()));
    };
    auto views = find_views(recordings[k], static_cast<int>(k), **finder, told);
    if (!views) return views.error();
    if (!*views) return std::optional<BoardStart>();
    if ((*views)->empty())
      return Error{
          recordings[k].folder, "the board is never seen",
          "check its counts of columns and rows and record it whole, or give a start pose with --init"};
    all.insert(all.end(), (*views)->begin(), (*views)->end());
  }
  auto camera = fit_board_camera(given, covariance_of(sigma, given), lattice, &all);
  if (!camera) return camera.error();
  const auto found = make_camera(corrected(given, camera->correction));
  if (!found) return found.error();

  BoardStart out;
  out.correction = camera->correction;
  out.sigma = camera->sigma;
  out.rms_px = camera->rms_px;
  out.views = all.size();
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < recordings.size(); ++k) {
    std::vector<BoardView> fitting;
    std::ranges::copy_if(all, std::back_inserter(fitting),
                         [&](const BoardView& view) { return view.recording == static_cast<int>(k); });
    if (fitting.empty())
      return Error{recordings[k].folder, "no picture of the board fits the camera of the others",
                   "check that one camera made all recordings"};
    out.sightings.push_back(sighting_of(lattice, fitting, recordings[k].T_cam_body));
    const auto start = out.sightings.back().start(**found, recordings[k].T_cam_body);
    if (!start) return Error{recordings[k].folder, "the board is not seen at the start", "give --init"};
    out.starts.push_back(*start);
    if (!recordings[k].has_imu) continue;
    const auto here = gravity_of(recordings[k], fitting);
    if (!here) return here.error();
    gravity += *here;
  }
  if (recordings.front().has_imu)
    out.gravity = kGravity_m_s2 *
                  (gravity.isZero(0) ? Eigen::Vector3d(0, 0, -1) : Eigen::Vector3d(gravity.normalized()));
  log_detail(text("the board in ", out.views, " pictures, points to ", out.rms_px, " px"));
  if (out.gravity)
    log_detail(text("gravity ", out.gravity->x(), " ", out.gravity->y(), " ", out.gravity->z()));
  return std::optional(std::move(out));
}

}  // namespace evpose
