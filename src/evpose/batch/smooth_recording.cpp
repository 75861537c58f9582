// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/batch/smooth_recording.h"

#include <algorithm>

#include "evpose/batch/batch_estimator.h"
#include "evpose/core/log.h"
#include "evpose/run/progress.h"

namespace evpose {
namespace {

constexpr int kMostPasses = 4;
constexpr double kStill = 0.1;  // change of a pass, in sigma, that is not worth another

/// The row of an update at the smoothed state.
Update at_state(const Update& measured, const FusionState& state) {
  Update out = measured;
  out.T_map_body = state.nav.T_map_body;
  out.velocity = state.nav.velocity;
  out.gyro_bias = state.gyro_bias;
  out.accel_bias = state.accel_bias;
  out.angular_rate = state.angular_rate;
  out.covariance = state.pose_covariance();
  out.velocity_covariance = state.covariance.block<3, 3>(error_state::kV, error_state::kV);
  return out;
}

}  // namespace

Expected<std::optional<RunOutcome>> smooth_recording(const TrackRequest& request) {
  const auto asked = load_config(request);
  if (!asked) return asked.error();
  auto job = prepare(request, *asked);
  if (!job) return job.error();
  auto run = RunFolder::create(request.output, request.replace);
  if (!run) return run.error();
  for (const Error& finding : job->findings) log_warning(finding.line());
  const double wall_start = wall_s(), cpu_start = cpu_s();
  const RunConfig config = job->config;
  BatchEstimator estimator(std::move(*job));
  Progress progress("smoothing");
  int pass = 0;
  const auto go_on = [&](double share) {
    progress.at((pass + share) / (1 + kMostPasses));
    return !(request.interrupted && request.interrupted());
  };
  if (auto ok = estimator.filter(request, go_on); !ok) return ok.error();
  double change = 1;
  while (!estimator.interrupted() && change > kStill && ++pass <= kMostPasses) {
    const auto changed = estimator.iterate(request, go_on);
    if (!changed) return changed.error();
    change = *changed;
    log_detail(text("pass ", pass, ": change of ", change, " sigma"));
  }
  progress.done();
  if (estimator.interrupted()) return std::optional<RunOutcome>();

  const auto& trajectory = estimator.trajectory();
  for (std::size_t k = 0; k + 1 < trajectory.size(); ++k)
    run->add(at_state(estimator.updates()[k], trajectory[k + 1]));
  RunSummary summary = estimator.summary();
  summary.wall_s = wall_s() - wall_start;
  summary.cpu_s = cpu_s() - cpu_start;
  summary.peak_memory_mb = peak_memory_mb();
  RunConfig written = config;
  ConfigTable table;
  describe(table, written);
  auto outcome = run->finish(summary, table);
  if (!outcome) return outcome.error();
  return std::optional<RunOutcome>(std::move(*outcome));
}

}  // namespace evpose
