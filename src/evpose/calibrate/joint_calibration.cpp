// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/joint_calibration.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "evpose/calibrate/coarse_camera.h"
#include "evpose/core/log.h"
#include "evpose/tracker/tracker_parts.h"

namespace evpose {
namespace {

constexpr int kFilterRuns = 2;  // of the first recording: the second from what the first has found
// Before a board, until a run changes little of what the one before has found, in its sigmas.
constexpr int kMostFilterRuns = 6;
constexpr double kGoodRun = 0.8, kSettled = 0.3;
constexpr int kMostPasses = 24;
// Share of what is measured that counts: what contours are off by lasts as long as they are in view, which
// adds up over a flight in what does not change and hardly in its poses. docs/decisions/fusion.md has the
// figures.
constexpr double kIndependent = 0.5;
constexpr double kStill = 0.1;  // change of a pass, in sigma, that is not worth another
// Steps that overshoot become shorter, those that go on in one direction longer again.
constexpr double kTakenBack = 0.3, kGoesOn = 0.5, kShorter = 0.5, kLeastStep = 0.25;
constexpr double kLeastAccepted = 0.2;  // share of the updates: below it, it is another view that was found
constexpr double kUnknown = 1e-4;       // trust in what was given, where the events shall speak alone
// Of a start before a board: a focal length that is off moves the camera along its axis, a principal point
// turns it.
constexpr double kBoardPosition_m = 0.15, kBoardRotation_rad = 0.05;
constexpr double kSteps = kFilterRuns + kMostPasses;

double share_of_accepted(std::span<const Update> updates) {
  const auto good = std::ranges::count(updates, true, &Update::accepted);
  return updates.empty() ? 0 : static_cast<double>(good) / static_cast<double>(updates.size());
}

/// What is found, as differences from what was given, with its sigma.
std::string values_words(const StaticParameters& parameters) {
  const Calibration& found = parameters.calibration();
  std::string out = "numbers";
  for (Eigen::Index i = 0; i < found.intrinsics.size(); ++i)
    out += text(" ", found.intrinsics(i), " (", found.intrinsics_sigma(i), ")");
  const Eigen::Vector3d turn_deg = so3::log(found.turn) * (180 / M_PI);
  return out + text(", turn ", turn_deg.x(), " ", turn_deg.y(), " ", turn_deg.z(), " deg, time ",
                    1e3 * found.time_offset_s, " ms");
}

/// The largest of the intrinsics, in sigmas of the second.
double change_of(const Calibration& a, const Calibration& b) {
  if (a.intrinsics.size() == 0 || a.intrinsics.size() != b.intrinsics.size()) return 0;
  return (b.intrinsics - a.intrinsics)
      .cwiseQuotient(b.intrinsics_sigma.cwiseMax(1e-12))
      .cwiseAbs()
      .maxCoeff();
}

/// What a run has found, with what was given: numbers that it hardly tells would drift from run to run.
void join_with_given(StaticParameters* parameters) {
  constexpr double kKnown = 1e-9;
  const Calibration& found = parameters->calibration();
  const StaticParameters::Places& places = parameters->places();
  const int n = parameters->size();
  ParameterInformation told{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n)};
  const auto add = [&](std::optional<int> place, const Eigen::VectorXd& sigma) {
    if (place)
      told.S.diagonal().segment(*place, sigma.size()) = sigma.cwiseMax(kKnown).cwiseAbs2().cwiseInverse();
  };
  add(places.time, Eigen::VectorXd::Constant(1, found.time_sigma_s));
  add(places.rotation, found.turn_sigma_rad);
  add(places.translation, found.shift_sigma_m);
  add(places.gravity, found.gravity_sigma_rad);
  add(places.intrinsics, found.intrinsics_sigma);
  parameters->correct(parameters->solve(told));
}

/// Events that the accepted updates of the second half found at the contours.
std::int64_t events_at_contours(std::span<const Update> updates) {
  std::int64_t out = 0;
  for (const Update& u : updates.subspan(updates.size() / 2))
    if (u.accepted) out += u.events_matched;
  return out;
}

/// Why updates are not accepted, as it was said last.
std::string reason_of(std::span<const Update> updates) {
  for (auto u = updates.rbegin(); u != updates.rend(); ++u)
    if (!u->accepted && !u->reason.empty()) return u->reason;
  return "their health is never told";
}

}  // namespace

JointCalibration::JointCalibration(std::vector<TrackJob> jobs, std::optional<BoardBeginning> board)
    : jobs_(std::move(jobs)), board_(std::move(board)), residuals_(jobs_.front().setup.camera->size()) {}

bool JointCalibration::go_on(const Progress& progress, double share) {
  const double of = kSteps * static_cast<double>(jobs_.size());
  return !(interrupted_ = !progress((done_ + share) / of));
}

double JointCalibration::accepted_share(std::size_t k) const {
  return share_of_accepted(flights_[k]->updates());
}

Eigen::MatrixXd JointCalibration::correlation() const {
  const CameraIntrinsics& camera = jobs_.front().recording.camera;
  return parameters_->calibration_correlation(4 + static_cast<Eigen::Index>(camera.distortion.size()),
                                              jobs_.front().recording.has_imu);
}

std::optional<ImuNoise> JointCalibration::imu() const {
  const TrackJob& job = jobs_.front();
  if (!job.recording.has_imu) return {};
  ImuNoise out = job.setup.imu_noise;
  out.axes = parameters_->corrected(out.axes);
  return out;
}

/// The parameters, at values that the filter can begin with.
Status JointCalibration::begin_parameters() {
  const TrackJob& job = jobs_.front();
  auto fusion = resolved(job.config.tracker.fusion, states_errors(*job.map));
  if (!fusion) return fusion.error();
  choose_states(job.setup, *fusion);
  auto coarse = board_ ? Expected(CoarseCamera{given_calibration(job), {}}) : coarse_camera(job, *fusion);
  if (!coarse) return coarse.error();
  if (board_) {
    coarse->calibration.intrinsics = board_->intrinsics;
    coarse->calibration.intrinsics_sigma = board_->intrinsics_sigma;
  }
  using enum StaticParameters::Shared;
  parameters_ = job.recording.has_imu
                    ? std::make_shared<StaticParameters>(*fusion, estimated, job.setup.imu_noise.axes)
                    : std::make_shared<StaticParameters>(*fusion, estimated);
  parameters_->add(coarse->calibration);
  coarse_correlation_ = std::move(coarse->correlation);
  log_detail(text("coarse: ", values_words(*parameters_)));
  return {};
}

/// Whether the first flight, as the filter has it, shows another camera than the start did: one with which
/// the filter finds more events at the contours.
Status JointCalibration::look_along_flight(const TrackRequest& request,
                                           const std::function<bool(double)>& progress) {
  const StaticParameters kept = *parameters_;
  const std::int64_t events = events_at_contours(flights_.front()->updates());
  const Calibration before = parameters_->calibration();
  CoarseCamera seen{before, {}};
  const auto other = coarse_camera_along(jobs_.front(), flights_.front()->trajectory(), &seen);
  if (!other) return other.error();
  if (!*other) return {};
  Calibration& found = seen.calibration;
  found.intrinsics -= before.intrinsics;
  found.turn = found.turn * before.turn.conjugate();
  found.shift.setZero();
  found.time_offset_s = 0;
  found.gravity_tilt_rad.setZero();
  parameters_->add(found);
  log_detail(text("along the flight: ", values_words(*parameters_)));
  if (auto ok = flights_.front()->filter(request, progress, seen.correlation); !ok || interrupted_) return ok;
  if (events_at_contours(flights_.front()->updates()) < events) *parameters_ = kept;
  return {};
}

/// The board fixes where the camera is seen from, so a start goes with the calibration it is seen with.
void JointCalibration::begin_before_board(BatchEstimator& flight, const BoardSighting& sighting) const {
  const TrackerSetup setup = flight.at_present_values().setup;
  if (const auto start = sighting.start(*setup.camera, setup.T_body_cam.inverse()))
    flight.begin_at(*start, {kBoardPosition_m, kBoardRotation_rad});
}

/// The trajectories to begin with.
Status JointCalibration::begin(const TrackRequest& request, const Progress& progress) {
  if (auto ok = begin_parameters(); !ok) return ok;
  for (std::size_t k = 0; k < jobs_.size(); ++k) {
    flights_.push_back(std::make_unique<BatchEstimator>(jobs_[k], parameters_));
    BatchEstimator& flight = *flights_.back();
    const int runs = k == 0 ? kFilterRuns : 1;
    bool settled = !board_;
    for (int run = 0; run < runs || (!settled && run < kMostFilterRuns); ++run) {
      const Calibration before = parameters_->calibration();
      if (board_) begin_before_board(flight, board_->sightings[k]);
      const auto told = [&](double share) { return go_on(progress, share); };
      if (auto ok = flight.filter(request, told, run == 0 ? coarse_correlation_ : Eigen::MatrixXd()); !ok)
        return ok;
      if (interrupted_) return {};
      if (board_) join_with_given(parameters_.get());
      log_detail(text("filter: ", std::lround(100 * share_of_accepted(flight.updates())), " % accepted, ",
                      values_words(*parameters_)));
      ++done_;
      if (!std::ranges::any_of(flight.updates(), &Update::accepted))
        return Error{
            jobs_[k].recording.folder,
            text("the events never gathered at the map's contours (", reason_of(flight.updates()), ")"),
            "check the start pose, the map and the focal length"};
      if (board_)
        settled = accepted_share(k) >= kGoodRun && change_of(before, parameters_->calibration()) < kSettled;
      if (k == 0 && run == 0 && !board_)
        if (auto ok = look_along_flight(request, told); !ok || interrupted_) return ok;
    }
    flight_residuals_.emplace_back(residuals_);
    flight.on_contours([this, k](const FusionState&, std::span<const ContourOffset> contours) {
      const TrackerSetup& setup = flights_[k]->followed();
      for (ResidualField* field : {&residuals_, &flight_residuals_[k]})
        field->add(contours, *setup.camera, setup.T_body_cam);
    });
  }
  return {};
}

/// One step of Gauss-Newton over all recordings; by how much it has moved anything, in sigma.
Expected<double> JointCalibration::pass(const Progress& progress) {
  residuals_ = ResidualField(jobs_.front().setup.camera->size());
  std::ranges::fill(flight_residuals_, residuals_);
  ParameterInformation told;
  for (const auto& flight : flights_) {
    const auto told_by_one = flight->measure([&](double share) { return go_on(progress, share); });
    if (!told_by_one) return told_by_one.error();
    if (interrupted_) return 0;
    told.add(*told_by_one);
    ++done_;
  }
  told.S *= kIndependent;
  told.s *= kIndependent;
  judge_given(told);
  ParameterSolution solution = parameters_->solve(told);
  double change = parameters_->change(solution);
  log_detail(text("calibration moves by ", change, " sigma"));
  for (int i = 0; i < parameters_->calibration_size(); ++i)
    log_detail(text("  number ", i, ": ", solution.z(i) / std::sqrt(solution.covariance(i, i)), " sigma"));
  const double share = share_of_step(solution);
  for (const auto& flight : flights_) change = std::max(change, flight->take(solution, share));
  solution.z *= share;
  parameters_->correct(solution);
  return change;
}

/// A step that takes back much of the last one has gone too far, and so had that: half of it, from then on;
/// one that goes on where the last one went had been too short.
double JointCalibration::share_of_step(const ParameterSolution& solution) {
  const Eigen::Index n = parameters_->calibration_size();
  const Eigen::VectorXd step = solution.z.head(n);
  if (last_step_.size() == n) {
    const Eigen::VectorXd weighted = solution.covariance.topLeftCorner(n, n).ldlt().solve(last_step_);
    const double along = step.dot(weighted) / last_step_.dot(weighted);
    if (along < -kTakenBack) step_share_ = std::max(kLeastStep, kShorter * step_share_);
    if (along > kGoesOn) step_share_ = std::min(1.0, step_share_ / kShorter);
  }
  last_step_ = step_share_ * step;
  return step_share_;
}

void JointCalibration::judge_given(const ParameterInformation& told) {
  const ParameterSolution alone = parameters_->solve(told, kUnknown);
  const Eigen::Index n = parameters_->calibration_size();
  const Eigen::VectorXd value = parameters_->calibration_errors() + alone.z.head(n);
  const Eigen::VectorXd given = parameters_->given_sigma();
  contradiction_.setZero(n);
  for (Eigen::Index i = 0; i < n; ++i)
    contradiction_(i) = value(i) / std::sqrt(given(i) * given(i) + alone.covariance(i, i));
}

Status JointCalibration::estimate(const TrackRequest& request, const Progress& progress) {
  if (auto ok = begin(request, progress); !ok || interrupted_) return ok;
  for (int k = 0; k < kMostPasses && !converged_; ++k) {
    const auto change = pass(progress);
    if (!change) return change.error();
    if (interrupted_) return {};
    converged_ = *change < kStill;
    log_detail(text("pass ", k + 1, ": change of ", *change, " sigma"));
  }
  for (std::size_t k = 0; k < size(); ++k)
    if (accepted_share(k) < kLeastAccepted)
      return Error{
          jobs_[k].recording.folder,
          text("with the best calibration found, ", std::lround(100 * accepted_share(k)),
               " % of the updates are accepted (", reason_of(flights_[k]->updates()), ")"),
          "give a better start pose or focal length, or a recording in which more of the map is in view"};
  return {};
}

}  // namespace evpose
