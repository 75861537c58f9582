// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/map_learner.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "evpose/batch/batch_estimator.h"
#include "evpose/core/log.h"
#include "evpose/map_learn/depth_edges.h"
#include "evpose/map_learn/observe_flight.h"
#include "evpose/map_learn/plane_events.h"
#include "evpose/map_learn/tracked_run.h"

namespace evpose::map_learn {
namespace {

constexpr int kSmoothings = 2;
constexpr int kPasses = 3;  // of looking for markings and adjusting
constexpr double kDegree = 57.29577951;
// A flight that tells less than this says nothing that the cloud does not know.
constexpr double kLeastSpread_deg = 1;
constexpr double kWorstCommon_m = 0.01;

/// One flight and a map on their way to each other.
class FlightLearner {
 public:
  FlightLearner(const Flight& flight, const ContourMap& map, const LearnProgress& progress)
      : flight_(flight), request_(flight.request), learning_(map), progress_(progress) {}

  Expected<LearntMap> learn();

 private:
  Status prepare_flight(const ContourMap& map);
  Status track(BatchEstimator& estimator);
  Status take_run(BatchEstimator& estimator);
  Status smooth();
  Status find_edges(bool off_planes);
  Status adjust_once();
  Status check_worth() const;
  void use(const ContourMap& map);
  void report(const AdjustmentResult& result, const FlightObservations& seen);
  /// Of the steps of the work: the share of the present one, 0..1.
  bool go_on(double share) {
    // Markings are looked for in all passes but the last, depth edges in one.
    constexpr double kSteps = 1 + kSmoothings + 2 * kPasses;
    return !(interrupted_ = interrupted_ || !progress_(std::min(1.0, (steps_done_ + share) / kSteps)));
  }

  const Flight& flight_;
  TrackRequest request_;
  std::optional<RunFiles> run_;  ///< if the flight was tracked before
  LearningMap learning_;
  const LearnProgress& progress_;
  std::optional<TrackJob> job_;
  std::optional<FusionState> start_;  ///< what is known of it beside the recording
  Trajectory trajectory_;
  FlightReport report_;
  int steps_done_ = 0;
  bool interrupted_ = false;
};

void FlightLearner::use(const ContourMap& map) {
  auto shared = std::make_shared<const ContourMap>(map);
  job_->map = shared;
  job_->setup.map = shared;
}

Status FlightLearner::prepare_flight(const ContourMap& map) {
  const auto asked = load_config(request_);
  if (!asked) return asked.error();
  if (!flight_.run.empty()) {
    auto run = read_run_of(flight_.run, request_.recording, request_.map);
    if (!run) return run.error();
    run_ = std::move(*run);
    request_ = request_of(request_, *run_, states_of(*run_, asked->tracker.rate_hz).front());
  }
  auto job = prepare(request_, *asked);
  if (!job) return job.error();
  job_.emplace(std::move(*job));
  use(map);
  return {};
}

Status FlightLearner::track(BatchEstimator& estimator) {
  if (auto ok = estimator.filter(request_, [&](double share) { return go_on(share); }); !ok) return ok;
  if (interrupted_) return {};
  const auto& updates = estimator.updates();
  const auto tracked = std::count_if(updates.begin(), updates.end(),
                                     [](const Update& u) { return u.health == Health::tracking; });
  report_.tracked = static_cast<double>(tracked) / static_cast<double>(updates.size());
  if (report_.tracked < kLeastTracked)
    return Error{request_.recording,
                 text("was tracked in ", std::lround(100 * report_.tracked),
                      " % of its time with this map; nothing can be learnt from it"),
                 "check that it was flown in the place of the map; evpose check says more"};
  return {};
}

Status FlightLearner::take_run(BatchEstimator& estimator) {
  report_.tracked = tracking_share(*run_);
  const auto found = found_by(*run_, *job_);
  return found ? estimator.begin_along(states_of(*run_, job_->config.tracker.rate_hz), *found)
               : found.error();
}

Status FlightLearner::smooth() {
  BatchEstimator estimator(*job_);
  const auto progress = [&](double share) { return go_on(share); };
  if (auto ok = run_ ? take_run(estimator) : track(estimator); !ok || interrupted_) return ok;
  start_ = estimator.trajectory().front();
  for (int pass = 0; pass < kSmoothings; ++pass) {
    ++steps_done_;
    const auto changed = estimator.iterate(request_, progress);
    if (!changed) return changed.error();
    if (interrupted_) return {};
  }
  ++steps_done_;
  trajectory_ = estimator.trajectory();
  report_.seconds = to_seconds(trajectory_.back().t - trajectory_.front().t);
  learning_.displace(estimator.displacements());
  job_ = estimator.at_present_values();
  return {};
}

/// On planes first, whose place is known best; then what is on none.
Status FlightLearner::find_edges(bool off_planes) {
  const auto progress = [&](double share) { return go_on(share); };
  const auto planes = events_on_planes(*job_, trajectory_, progress);
  ++steps_done_;
  if (!planes) return planes.error();
  if (interrupted_) return {};
  learning_.add_new(find_markings(*planes, learning_.map(), learning_.next_contour()));
  if (!off_planes) return {};
  use(learning_.map());
  const auto edges = find_depth_edges(*job_, trajectory_, learning_.next_contour(), progress);
  ++steps_done_;
  if (!edges) return edges.error();
  if (!interrupted_) learning_.add_new(*edges);
  return {};
}

Status FlightLearner::adjust_once() {
  use(learning_.map());
  const auto seen = observe_flight(*job_, trajectory_, [&](double share) { return go_on(share); });
  ++steps_done_;
  if (!seen) return seen.error();
  if (interrupted_) return {};
  const ContourSegments segments = cut_into_segments(learning_.map());
  AdjustmentProblem problem;
  problem.steps = seen->steps;
  problem.start_covariance = start_->covariance;
  problem.start_offset = trajectory_.front().minus(*start_);
  problem.landmarks = learning_.landmarks(segments);
  problem.observations = seen->observations;
  problem.shared = learning_.shared();
  problem.shared_covariance = learning_.shared_covariance();
  std::vector<Eigen::Matrix3d> rotations;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const std::size_t k : seen->knots) {
    rotations.push_back(trajectory_[k].nav.T_map_body.rotation());
    middle += trajectory_[k].nav.T_map_body.p / static_cast<double>(seen->knots.size());
  }
  const AdjustmentResult result = adjust(problem, rotations);
  add_at_knots(seen->knots, result.states, trajectory_);
  std::size_t knot = 0;
  for (std::size_t i = 0; i < trajectory_.size(); ++i) {
    while (knot + 1 < seen->knots.size() && seen->knots[knot + 1] <= i) ++knot;
    trajectory_[i].covariance.topLeftCorner<6, 6>() = result.pose_covariances[knot];
  }
  learning_.apply(result, segments, *seen);
  learning_.set_frame(middle, result.common_covariance);
  report(result, *seen);
  return {};
}

/// Root mean square angle of directions about their mean, per landmark; its median over the landmarks.
double median_spread_rad(const FlightObservations& seen) {
  std::vector<double> spreads;
  for (std::size_t i = 0, end = 0; i < seen.observations.size(); i = end) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (end = i;
         end < seen.observations.size() && seen.observations[end].landmark == seen.observations[i].landmark;
         ++end)
      sum += seen.views[end];
    const auto count = static_cast<double>(end - i);
    if (count >= 4) spreads.push_back(std::sqrt(std::max(0.0, 2 * (1 - sum.norm() / count))));
  }
  if (spreads.empty()) return 0;
  const auto middle = spreads.begin() + static_cast<std::ptrdiff_t>(spreads.size() / 2);
  std::nth_element(spreads.begin(), middle, spreads.end());
  return *middle;
}

void FlightLearner::report(const AdjustmentResult& result, const FlightObservations& seen) {
  if (report_.explained_before == 0) report_.explained_before = seen.explained;
  report_.explained_after = seen.explained;
  report_.view_spread_deg = kDegree * median_spread_rad(seen);
  report_.delay_px += result.delay_px;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(result.common_covariance.topLeftCorner<3, 3>());
  report_.common_sigma_m = eigen.eigenvalues().cwiseMax(0).cwiseSqrt().reverse();
  report_.common_axes = eigen.eigenvectors().rowwise().reverse();
  report_.common_rotation_sigma_rad =
      std::sqrt(result.common_covariance.bottomRightCorner<3, 3>().trace() / 3);
  report_.lengths = learning_.lengths();
  log_detail(text("pass: ", seen.observations.size(), " observations, common sigma ",
                  1e3 * report_.common_sigma_m.x(), " mm, delay ", result.delay_px, " px, explained ",
                  seen.explained, ", moved ", report_.lengths.moved_m, " m, struck ",
                  report_.lengths.struck_m, " m, new ", report_.lengths.new_m, " m"));
}

Status FlightLearner::check_worth() const {
  const double spread_deg = report_.view_spread_deg, common_m = report_.common_sigma_m.x();
  if (spread_deg >= kLeastSpread_deg && common_m <= kWorstCommon_m) return {};
  return Error{request_.recording,
               text("tells nothing that the map does not know: its contours were seen from directions ",
                    std::round(10 * spread_deg) / 10, " deg apart, and what was learnt stands within ",
                    std::round(1e4 * common_m) / 10, " mm (1 sigma)"),
               "learn from a flight that passes the contours, sideways or up and down"};
}

Expected<LearntMap> FlightLearner::learn() {
  report_.recording = request_.recording;
  if (auto ok = prepare_flight(learning_.map()); !ok) return ok.error();
  if (auto ok = smooth(); !ok) return ok.error();
  for (int pass = 0; pass < kPasses && !interrupted_; ++pass) {
    if (pass + 1 < kPasses)
      if (auto ok = find_edges(pass + 2 == kPasses); !ok) return ok.error();
    if (interrupted_) break;
    if (auto ok = adjust_once(); !ok) return ok.error();
  }
  if (interrupted_) return LearntMap{};
  if (auto ok = check_worth(); !ok) return ok.error();
  return LearntMap{learning_.map(), report_, trajectory_};
}

}  // namespace

Expected<LearntMap> learn_from_flight(const Flight& flight, const ContourMap& map,
                                      const LearnProgress& progress) {
  return FlightLearner(flight, map, progress).learn();
}

}  // namespace evpose::map_learn
