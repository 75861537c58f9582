// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/coarse_camera.h"

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "evpose/calibrate/binned_image.h"
#include "evpose/calibrate/event_slices.h"
#include "evpose/calibrate/image_modes.h"
#include "evpose/camera/adjusted_camera.h"
#include "evpose/core/log.h"
#include "evpose/fusion/state_propagator.h"
#include "evpose/map/visible_set.h"
#include "evpose/registration/pose_search.h"

namespace evpose {

Calibration given_calibration(const TrackJob& job) {
  const CalibrationSigma& stated = *job.setup.calibration_sigma;
  Calibration out;
  out.intrinsics_sigma = stated.of_intrinsics(*job.setup.intrinsics);
  out.intrinsics.setZero(out.intrinsics_sigma.size());
  out.turn_sigma_rad = stated.of_rotation_rad();
  out.shift_sigma_m = stated.of_translation_m();
  return out;
}

namespace {

constexpr double kBridged_px = 4;           // that the alignment of the start bridges: its first gate
constexpr double kReach = 2.5;              // sigmas to each side
constexpr double kStep_px = 8;              // of the coarse grid: the reach of a coarse edge
constexpr int kWideImage_px = 800;          // from here on edges are found in cells of two by two pixels
constexpr std::size_t kKept = 10;           // of its cameras are refined
constexpr std::size_t kKeptOfBinned = 100;  // more of them fit where pixels are wide
constexpr double kCoarseSteps_px[] = {8, 4}, kFineSteps_px[] = {6, 3, 1.5, 0.75};
constexpr double kRollSigma_rad = 0.02;     // at least: that of a start pose
constexpr int kMostSweeps = 20;             // at each step
constexpr double kCorrelatedPoints = 10;    // so many points share one error
constexpr ImageSigma kSigma{1, 1.5, 2, 3};  // of what is found, in cells of edges: the corners show least
constexpr std::size_t kSlices = 6;
constexpr TimeNs kApart = 50 * kNsPerMs;  // slices; the pose follows from the IMU
constexpr std::size_t kLaterSlices = 16;  // over a whole trajectory
constexpr int kFarSteps[] = {-2, -1, 0, 1, 2};
constexpr double kFarCubic_px = 8, kFarQuintic_px = 5;
constexpr double kBetter = 0.002;  // mean score by which another camera has to be, to be another one
constexpr double kKnown = 1e-9;    // sigma of a number that is known
constexpr double kStrideOfPoints_px = 8;
constexpr int kPoints = 700;
constexpr double kMarginOfWidth =
    0.2;  // in which the given camera, without barrel distortion, sees the corners

using Trial = Eigen::VectorXd;  ///< as ImageModes has it

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

/// So many pixels along each axis are one where the search begins.
int binning_of(const CameraIntrinsics& camera) { return camera.size.width > kWideImage_px ? 2 : 1; }

/// How closely an image is looked at.
struct Look {
  EdgeSpread spread;
  int binning = 1;  ///< so many pixels are one, along each axis
};

class Trials {
 public:
  /// Points so far outside of the given camera's image are tried, too. `information`: of the intrinsic
  /// numbers.
  Trials(const TrackJob& job, const Pose& T_body_cam, double margin_px, const Eigen::MatrixXd& information)
      : job_(job),
        T_body_cam_(T_body_cam),
        margin_px_(margin_px),
        information_(information),
        camera_(*job.setup.intrinsics),
        index_(*job.map) {}

  void add(std::span<const FilteredEvent> events, const Pose& T_map_body) {
    VisibleSetConfig config = job_.config.tracker.visible;
    config.stride_px = kStrideOfPoints_px;
    config.budget = kPoints;
    config.margin_px = margin_px_;
    views_.push_back({EdgeField(camera_.size), {}, T_map_body * T_body_cam_, {}});
    View& view = views_.back();
    view.field.build(events);
    if (binning_ > 1) view.binned = binned_field(events);
    VisibleSet visible(index_, *job_.setup.camera, config);
    for (const std::uint32_t i : visible.choose(view.T_map_cam))
      view.points.push_back({job_.map->position(i), job_.map->points[i].tangent.cast<double>()});
    evidence_ += static_cast<double>(view.points.size()) / kCorrelatedPoints;
  }

  std::size_t size() const { return views_.size(); }
  int binning() const { return binning_; }  ///< of the camera

  /// Mean of the views', with the share of what is known of the numbers.
  double score(const Trial& trial, Look look) const {
    const auto n = trial.size() - 1;
    const auto camera = make_camera(binned(corrected(camera_, trial.head(n)), look.binning));
    const Pose rolled{so3::exp({0, 0, trial(n)}), Eigen::Vector3d::Zero()};
    constexpr double kNone = -1e9;
    if (!camera) return kNone;
    double out = 0;
    for (const View& v : views_)
      out += score_pose({look.binning > 1 ? *v.binned : v.field, **camera, rolled, v.points}, v.T_map_cam,
                        look.spread);
    const double unlikely = 0.5 * trial.head(n).dot(information_ * trial.head(n));
    return out / static_cast<double>(views_.size()) - unlikely / std::max(1.0, evidence_);
  }

 private:
  struct View {
    EdgeField field;
    std::optional<EdgeField> binned;  ///< of wide images
    Pose T_map_cam;
    std::vector<SearchPoint> points;
  };
  EdgeField binned_field(std::span<const FilteredEvent> events) const {
    EdgeField out(binned(camera_, binning_).size);
    out.build(binned(events, binning_));
    return out;
  }

  const TrackJob& job_;
  const Pose T_body_cam_;
  const double margin_px_;
  Eigen::MatrixXd information_;
  const CameraIntrinsics& camera_;
  const int binning_ = binning_of(camera_);
  ContourIndex index_;
  std::vector<View> views_;
  double evidence_ = 0;  ///< independent points
};

struct Scored {
  Trial trial;
  double score;
};

/// The best of a grid, that differ, best first.
std::vector<Scored> best_of_grid(const Trials& trials, const ImageModes& modes, const Trial& reach) {
  const double step_px = kStep_px * trials.binning();
  const auto count = [&](const Trial& mode, Eigen::Index number) {
    return mode.size() == 0 ? 0 : static_cast<int>(std::ceil(reach(number) / (step_px * mode(number))));
  };
  const int focal_count = count(modes.focal, 0), cubic_count = count(modes.cubic, 4),
            centre_count = count(modes.cx, 2);
  const Trial cubic = cubic_count > 0 ? modes.cubic : Trial::Zero(reach.size());
  std::vector<Scored> all;
  for (int f = -focal_count; f <= focal_count; ++f)
    for (int k = -cubic_count; k <= cubic_count; ++k)
      for (int x = -centre_count; x <= centre_count; ++x)
        for (int y = -centre_count; y <= centre_count; ++y) {
          const Trial on_grid = step_px * (f * modes.focal + k * cubic + x * modes.cx + y * modes.cy);
          const Trial trial = on_grid.cwiseMin(reach).cwiseMax(-reach);
          all.push_back({trial, trials.score(trial, {EdgeSpread::coarse, trials.binning()})});
        }
  std::ranges::stable_sort(all, std::greater(), &Scored::score);
  std::vector<Scored> out;
  const std::size_t most = trials.binning() > 1 ? kKeptOfBinned : kKept;
  // Neighbours in the grid lie within one step in each number.
  const Eigen::VectorXd step =
      1.5 * step_px * (modes.focal.cwiseAbs() + cubic.cwiseAbs() + modes.cx + modes.cy);
  for (const Scored& t : all) {
    const auto near = [&](const Scored& kept) {
      return ((t.trial - kept.trial).cwiseAbs().array() <= step.array()).all();
    };
    if (out.size() < most && std::ranges::none_of(out, near)) out.push_back(t);
  }
  return out;
}

/// What is not known of the given calibration, and how it is tried.
struct Unknowns {
  explicit Unknowns(const TrackJob& job)
      : given(given_calibration(job)), modes(image_modes(*job.setup.intrinsics, given.intrinsics.size())) {
    const Eigen::Index n = given.intrinsics.size();
    const Eigen::MatrixXd R = job.setup.calibration_sigma->of_correlation(*job.setup.intrinsics);
    const Eigen::VectorXd sigma = given.intrinsics_sigma.cwiseMax(kKnown);
    const Eigen::MatrixXd P = sigma.asDiagonal() * R.topLeftCorner(n, n) * sigma.asDiagonal();
    information = P.completeOrthogonalDecomposition().pseudoInverse();
    reach.resize(n + 1);
    reach << kReach * given.intrinsics_sigma,
        kReach * std::max(kRollSigma_rad, given.turn_sigma_rad.maxCoeff());
  }

  Calibration given;
  ImageModes modes;
  Trial reach;
  Eigen::MatrixXd information;  ///< of the numbers, about what was given

  bool beyond(const Trial& trial) const { return (trial.cwiseAbs().array() > reach.array() + 1e-12).any(); }
  /// What has been found; `job` as it was given.
  void take(const Trial& trial, const TrackJob& job, const Pose& T_body_cam, CoarseCamera* found) const {
    const Eigen::Index n = given.intrinsics.size();
    Calibration& c = found->calibration;
    c.intrinsics = trial.head(n);
    const Eigen::Vector3d axis = T_body_cam.q * Eigen::Vector3d::UnitZ();
    if (!given.turn_sigma_rad.isZero(0)) c.turn = (so3::exp(trial(n) * axis) * c.turn).normalized();
    c.turn_sigma_rad = given.turn_sigma_rad;
    CalibrationSigma stated = *job.setup.calibration_sigma;
    if (!job.recording.has_imu) stated.rotation_rad = Eigen::Vector3d::Zero();  // the pose is the camera's
    const ImageSigma image = binning_of(*job.setup.intrinsics) * kSigma;
    const Eigen::MatrixXd C = covariance_of_found(modes, *job.setup.intrinsics, stated, T_body_cam.q, image);
    const Eigen::VectorXd sigma = C.diagonal().cwiseMax(0).cwiseSqrt();
    c.intrinsics_sigma = sigma.head(n);
    const Eigen::VectorXd weight = (sigma.array() > 0).select(sigma.cwiseInverse(), 0);
    found->correlation = weight.asDiagonal() * C * weight.asDiagonal();
    found->correlation.diagonal().setOnes();
  }
};

/// Along each mode to and fro as long as it gets better, in ever smaller steps, of pixels as they are looked
/// at.
void refine(const Trials& trials, const Unknowns& unknowns, Look look, std::span<const double> steps_px,
            Scored* best) {
  const auto score = [&](const Trial& trial) { return trials.score(trial, look); };
  best->score = score(best->trial);
  for (const double step_px : steps_px)
    for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
      const double before = best->score;
      for (const Eigen::VectorXd* mode : unknowns.modes.all())
        for (const double step : {step_px, -step_px}) {
          if (mode->size() == 0) continue;
          const Trial trial = best->trial + look.binning * step * *mode;
          if (unknowns.beyond(trial)) continue;
          if (const double here = score(trial); here > best->score) *best = {trial, here};
        }
      if (best->score <= before) break;
    }
}

void refine(const Trials& trials, const Unknowns& unknowns, Scored* best) {
  refine(trials, unknowns, {EdgeSpread::coarse}, kCoarseSteps_px, best);
  refine(trials, unknowns, {EdgeSpread::fine}, kFineSteps_px, best);
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

/// Between two of its states, or that of its end.
Pose pose_of(std::span<const FusionState> trajectory, TimeNs t) {
  const auto after = std::ranges::lower_bound(trajectory, t, {}, &FusionState::t);
  if (after == trajectory.begin()) return after->nav.T_map_body;
  const FusionState& before = *(after - 1);
  if (after == trajectory.end()) return before.nav.T_map_body;
  const double share = to_seconds(t - before.t) / to_seconds(after->t - before.t);
  return before.nav.T_map_body.plus(share * after->nav.T_map_body.minus(before.nav.T_map_body));
}

/// Slices of a whole trajectory.
Status add_slices_along(const TrackJob& job, std::span<const FusionState> trajectory, Trials* trials) {
  auto reader = open_events(job.recording);
  if (!reader) return reader.error();
  EventSlices slices(**reader, job.setup.intrinsics->size);
  const TimeNs first = trajectory.front().t, last = trajectory.back().t;
  for (std::size_t k = 0; k < kLaterSlices; ++k) {
    const TimeNs from = first + (last - first) / TimeNs{kLaterSlices} * static_cast<TimeNs>(k);
    const auto more = slices.next(std::max(from, slices.end()));
    if (!more) return more.error();
    if (!*more || slices.end() > last) break;
    if (!slices.sparse()) trials->add(slices.events(), pose_of(trajectory, slices.middle()));
  }
  return {};
}

/// By how many pixels the given numbers may be off at the rim.
double uncertain_px(const CameraIntrinsics& camera, const Eigen::VectorXd& sigma) {
  return std::max(sigma(0) / camera.fx * 0.5 * camera.size.width, sigma(2));
}

}  // namespace

Expected<CoarseCamera> coarse_camera(const TrackJob& job, const FusionConfig& fusion) {
  Unknowns unknowns(job);
  unknowns.modes.roll.resize(0);  // the start's pose and the mounting have more than one way to be off
  CoarseCamera out{unknowns.given, {}};
  if (uncertain_px(*job.setup.intrinsics, unknowns.given.intrinsics_sigma) < kBridged_px) return out;
  const double margin_px = 2 * kReach * kStep_px * binning_of(*job.setup.intrinsics);
  Trials trials(job, job.setup.T_body_cam, margin_px, unknowns.information);
  if (auto ok = add_slices(job, fusion, &trials); !ok) return ok.error();
  if (trials.size() == 0) return out;
  std::optional<Scored> best;
  for (Scored tried : best_of_grid(trials, unknowns.modes, unknowns.reach)) {
    refine(trials, unknowns, {EdgeSpread::fine, trials.binning()}, kFineSteps_px, &tried);
    if (trials.binning() > 1) refine(trials, unknowns, {EdgeSpread::fine}, kFineSteps_px, &tried);
    if (!best || tried.score > best->score) best = std::move(tried);
  }
  unknowns.take(best->trial, job, job.setup.T_body_cam, &out);
  return out;
}

Expected<bool> coarse_camera_along(const TrackJob& job, std::span<const FusionState> trajectory,
                                   CoarseCamera* found) {
  const Unknowns unknowns(job);
  if (unknowns.modes.cubic.size() == 0 ||
      uncertain_px(*job.setup.intrinsics, unknowns.given.intrinsics_sigma) < kBridged_px)
    return false;
  const Pose T_body_cam{found->calibration.turn * job.setup.T_body_cam.q,
                        job.setup.T_body_cam.p + found->calibration.shift};
  Trials trials(job, T_body_cam, kMarginOfWidth * job.setup.intrinsics->size.width, unknowns.information);
  if (auto ok = add_slices_along(job, trajectory, &trials); !ok) return ok.error();
  if (trials.size() == 0) return false;
  const Eigen::VectorXd& numbers = found->calibration.intrinsics;
  Scored here{Trial::Zero(numbers.size() + 1), 0};
  here.trial.head(numbers.size()) = numbers;
  refine(trials, unknowns, &here);
  std::optional<Scored> best;
  for (const int k : kFarSteps)
    for (const int l : kFarSteps) {
      Scored tried = here;
      tried.trial += k * kFarCubic_px * unknowns.modes.cubic + l * kFarQuintic_px * unknowns.modes.quintic;
      if ((k == 0 && l == 0) || unknowns.beyond(tried.trial)) continue;
      refine(trials, unknowns, &tried);
      if (!best || tried.score > best->score) best = std::move(tried);
    }
  if (best)
    log_detail(text("cameras along the flight: ", here.score, " as found, ", best->score,
                    " with other radial terms"));
  if (!best || best->score < here.score + kBetter) return false;
  unknowns.take(best->trial, job, T_body_cam, found);
  return true;
}

}  // namespace evpose
