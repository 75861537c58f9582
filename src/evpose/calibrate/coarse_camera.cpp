// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/coarse_camera.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "evpose/calibrate/event_slices.h"
#include "evpose/camera/adjusted_camera.h"
#include "evpose/fusion/state_propagator.h"
#include "evpose/map/visible_set.h"
#include "evpose/registration/pose_search.h"

namespace evpose {
namespace {

constexpr double kBridged_px = 4;  // that the alignment of the start bridges: its first gate
constexpr double kReach = 2;       // sigmas to each side
constexpr double kStep_px = 8;     // of the coarse grid: the reach of a coarse edge
constexpr std::size_t kKept = 6;   // of its cameras are refined
constexpr double kFineSteps_px[] = {6, 3, 1.5, 0.75};
constexpr int kMostSweeps = 20;  // at each step
constexpr double kSigma_px = 2;  // of each mode of what is found
constexpr std::size_t kSlices = 6;
constexpr TimeNs kApart = 50 * kNsPerMs;  // slices; the pose follows from the IMU
constexpr double kStrideOfPoints_px = 8;
constexpr int kPoints = 700;

/// Changes of all numbers that move what is seen by up to one pixel, each in a way of its own: focal length,
/// cubic and quintic radial terms without what lower ones can do (Zernike's radial polynomials), the
/// principal point.
struct Modes {
  Eigen::VectorXd focal, cubic, quintic, cx, cy;  ///< empty: the model has none
};

Modes modes_of(const CameraIntrinsics& camera, Eigen::Index n) {
  const double corner_px = 0.5 * std::hypot(camera.size.width, camera.size.height), r = corner_px / camera.fx;
  Modes out;
  for (Eigen::VectorXd* mode : {&out.focal, &out.cx, &out.cy}) mode->setZero(n);
  out.focal(0) = camera.fx / corner_px;
  out.focal(1) = camera.fy / corner_px;
  out.cx(2) = out.cy(3) = 1;
  // Double sphere has a shape of its own: it is left to the alignment.
  if (n < 6 || camera.distortion_model == "ds") return out;
  // 3 (r^3 - 2/3 r) and 10 (r^5 - 6/5 r^3 + 3/10 r), at most 1 in between.
  const Eigen::VectorXd cube = Eigen::VectorXd::Unit(n, 4) / (corner_px * r * r),
                        fifth = Eigen::VectorXd::Unit(n, 5) / (corner_px * r * r * r * r);
  out.cubic = 3 * (cube - 2.0 / 3 * out.focal);
  out.quintic = 10 * (fifth - 1.2 * cube + 0.3 * out.focal);
  return out;
}

/// Of the body, at these times, by the IMU from the start; without one as it moved there.
Expected<std::vector<Pose>> poses_at(const TrackJob& job, const FusionConfig& fusion,
                                     std::span<const TimeNs> times) {
  const StatePropagator propagator(job.setup.motion, fusion, job.setup.imu_noise);
  FusionState state = propagator.initial_state(job.start.t, {job.start.T_map_body, job.start.velocity},
                                               job.start.angular_rate_body);
  std::vector<Pose> out;
  if (!job.recording.has_imu) {
    for (const TimeNs t : times) {
      if (t > state.t) propagator.propagate(state, t);
      out.push_back(state.nav.T_map_body);
    }
    return out;
  }
  auto imu = open_imu(job.recording);
  if (!imu) return imu.error();
  std::optional<ImuSample> last;
  ImuSample next;
  while (out.size() < times.size()) {
    const auto more = imu->next(next);
    if (!more) return more.error();
    if (!*more) break;
    if (last && last->t < next.t)
      while (out.size() < times.size() && state.t < next.t) {
        const TimeNs until = std::clamp(times[out.size()], state.t, next.t);
        if (last->t <= state.t && state.t < until)
          propagator.propagate(state, interpolate(*last, next, state.t), interpolate(*last, next, until));
        if (times[out.size()] > next.t) break;
        out.push_back(state.nav.T_map_body);
      }
    last = next;
  }
  return out;
}

class Trials {
 public:
  Trials(const TrackJob& job) : job_(job), camera_(*job.setup.intrinsics), index_(*job.map) {}

  void add(std::span<const FilteredEvent> events, const Pose& T_map_body) {
    VisibleSetConfig config = job_.config.tracker.visible;
    config.stride_px = kStrideOfPoints_px;
    config.budget = kPoints;
    config.margin_px = kReach * kStep_px * 2;
    views_.push_back({EdgeField(camera_.size), T_map_body * job_.setup.T_body_cam, {}});
    View& view = views_.back();
    view.field.build(events);
    VisibleSet visible(index_, *job_.setup.camera, config);
    for (const std::uint32_t i : visible.choose(view.T_map_cam))
      view.points.push_back({job_.map->position(i), job_.map->points[i].tangent.cast<double>()});
  }
  bool empty() const { return views_.empty(); }

  /// In the first `views`.
  double score(const Eigen::VectorXd& numbers, EdgeSpread spread, std::size_t views) const {
    const auto camera = make_camera(corrected(camera_, numbers));
    constexpr double kNone = -1e9;
    if (!camera) return kNone;
    double out = 0;
    for (std::size_t i = 0; i < std::min(views, views_.size()); ++i)
      out +=
          score_pose({views_[i].field, **camera, identity_, views_[i].points}, views_[i].T_map_cam, spread);
    return out;
  }

 private:
  struct View {
    EdgeField field;
    Pose T_map_cam;
    std::vector<SearchPoint> points;
  };
  const TrackJob& job_;
  const CameraIntrinsics& camera_;
  ContourIndex index_;
  const Pose identity_;
  std::vector<View> views_;
};

struct Trial {
  Eigen::VectorXd numbers;
  double score;
};

/// The best of a grid, that differ, best first.
std::vector<Trial> best_of_grid(const Trials& trials, const Modes& modes, const Eigen::VectorXd& sigma) {
  const auto count = [&](const Eigen::VectorXd& mode, Eigen::Index number) {
    return mode.size() == 0 ? 0
                            : static_cast<int>(std::ceil(kReach * sigma(number) / (kStep_px * mode(number))));
  };
  const int focal_count = count(modes.focal, 0), cubic_count = count(modes.cubic, 4),
            centre_count = count(modes.cx, 2);
  const Eigen::VectorXd cubic = cubic_count > 0 ? modes.cubic : Eigen::VectorXd::Zero(sigma.size());
  std::vector<Trial> all;
  for (int f = -focal_count; f <= focal_count; ++f)
    for (int k = -cubic_count; k <= cubic_count; ++k)
      for (int x = -centre_count; x <= centre_count; ++x)
        for (int y = -centre_count; y <= centre_count; ++y) {
          const Eigen::VectorXd numbers =
              kStep_px * (f * modes.focal + k * cubic + x * modes.cx + y * modes.cy);
          all.push_back({numbers, trials.score(numbers, EdgeSpread::coarse, 1)});
        }
  std::ranges::stable_sort(all, std::greater(), &Trial::score);
  std::vector<Trial> out;
  // Neighbours in the grid lie within one step in each number.
  const Eigen::VectorXd step =
      1.5 * kStep_px * (modes.focal.cwiseAbs() + cubic.cwiseAbs() + modes.cx + modes.cy);
  for (const Trial& t : all) {
    const auto near = [&](const Trial& kept) {
      return ((t.numbers - kept.numbers).cwiseAbs().array() <= step.array()).all();
    };
    if (out.size() < kKept && std::ranges::none_of(out, near)) out.push_back(t);
  }
  return out;
}

/// Along each mode to and fro as long as it gets better, in ever smaller steps.
Trial refined(const Trials& trials, const Modes& modes, const Eigen::VectorXd& sigma, Trial best) {
  const auto score = [&](const Eigen::VectorXd& numbers) {
    return trials.score(numbers, EdgeSpread::fine, kSlices);
  };
  best.score = score(best.numbers);
  for (const double step_px : kFineSteps_px)
    for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
      const double before = best.score;
      for (const Eigen::VectorXd* mode : {&modes.focal, &modes.cx, &modes.cy, &modes.cubic, &modes.quintic})
        for (const double step : {step_px, -step_px}) {
          if (mode->size() == 0) continue;
          const Eigen::VectorXd numbers = best.numbers + step * *mode;
          if ((numbers.cwiseAbs().array() > kReach * sigma.array() + 1e-12).any()) continue;
          if (const double here = score(numbers); here > best.score) best = {numbers, here};
        }
      if (best.score <= before) break;
    }
  return best;
}

/// Slices of the first tenths of a second.
Status add_slices(const TrackJob& job, const FusionConfig& fusion, Trials* trials) {
  auto reader = open_events(job.recording);
  if (!reader) return reader.error();
  EventSlices slices(**reader, job.setup.intrinsics->size);
  std::vector<std::vector<FilteredEvent>> events;
  std::vector<TimeNs> times;
  for (TimeNs from = job.start.t; times.size() < kSlices; from = slices.end() + kApart) {
    const auto more = slices.next(from);
    if (!more) return more.error();
    if (!*more) break;
    events.emplace_back(slices.events().begin(), slices.events().end());
    times.push_back(slices.middle());
  }
  const auto poses = poses_at(job, fusion, times);
  if (!poses) return poses.error();
  for (std::size_t i = 0; i < poses->size(); ++i) trials->add(events[i], (*poses)[i]);
  return {};
}

/// By how many pixels the given numbers may be off at the rim.
double uncertain_px(const CameraIntrinsics& camera, const Eigen::VectorXd& sigma) {
  return std::max(sigma(0) / camera.fx * 0.5 * camera.size.width, sigma(2));
}

}  // namespace

Expected<Calibration> coarse_camera(const TrackJob& job, const FusionConfig& fusion) {
  const CameraIntrinsics& camera = *job.setup.intrinsics;
  const CalibrationSigma& given = *job.setup.calibration_sigma;
  Calibration out;
  const Eigen::VectorXd sigma = given.of_intrinsics(camera);
  out.intrinsics.setZero(sigma.size());
  out.intrinsics_sigma = sigma;
  out.turn_sigma_rad = given.of_rotation_rad();
  out.shift_sigma_m = given.of_translation_m();
  if (uncertain_px(camera, sigma) < kBridged_px) return out;
  Trials trials(job);
  if (auto ok = add_slices(job, fusion, &trials); !ok) return ok.error();
  if (trials.empty()) return out;
  const Modes modes = modes_of(camera, sigma.size());
  std::optional<Trial> best;
  for (const Trial& start : best_of_grid(trials, modes, sigma))
    if (Trial trial = refined(trials, modes, sigma, start); !best || trial.score > best->score)
      best = std::move(trial);
  out.intrinsics = best->numbers;
  // To some pixels in each mode; tangential terms and higher radial ones are as they were.
  Eigen::VectorXd square = Eigen::VectorXd::Zero(sigma.size());
  for (const Eigen::VectorXd* mode : {&modes.focal, &modes.cx, &modes.cy, &modes.cubic, &modes.quintic})
    if (mode->size() > 0) square += (kSigma_px * *mode).cwiseAbs2();
  for (Eigen::Index i = 0; i < sigma.size(); ++i)
    if (square(i) > 0) out.intrinsics_sigma(i) = std::min(sigma(i), std::sqrt(square(i)));
  return out;
}

}  // namespace evpose
