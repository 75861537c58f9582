// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/eval/score.h"

#include <algorithm>
#include <numbers>

#include "evpose/core/error.h"
#include "evpose/eval/measures.h"

namespace evpose {
namespace {

constexpr double kDegPerRad = 180 / std::numbers::pi;

struct Span {
  TimeNs from = 0, to = 0;
};

Span judged_span(const ScoreInput& input, const ScoreOptions& options) {
  Span span{input.truth.front().t, input.truth.back().t};
  if (options.from) span.from = std::max(span.from, *options.from);
  if (options.to) span.to = std::min(span.to, *options.to);
  return span;
}

/// Nearest partners may lie a little outside the ground truth's span: only what was asked for cuts them off.
std::vector<PosePair> pairs_within(const ScoreInput& input, const ScoreOptions& options) {
  std::vector<PosePair> pairs = associate(input.estimate, input.truth, options.association);
  std::erase_if(pairs, [&](const PosePair& p) {
    return (options.from && p.t < *options.from) || (options.to && p.t > *options.to);
  });
  return pairs;
}

Similarity fit(const std::vector<PosePair>& pairs, const ScoreOptions& options) {
  std::vector<Eigen::Vector3d> from, to;
  for (const PosePair& p : pairs) {
    if (options.align_first_s > 0 && to_seconds(p.t - pairs.front().t) > options.align_first_s) break;
    from.push_back(p.estimate.p);
    to.push_back(p.truth.p);
  }
  return align(from, to, options.alignment);
}

std::vector<ErrorSample> errors_of(const std::vector<PosePair>& pairs, const ScoreInput& input,
                                   const Similarity& T) {
  std::vector<ErrorSample> samples;
  samples.reserve(pairs.size());
  for (const PosePair& pair : pairs) {
    ErrorSample s;
    s.index = pair.index;
    s.t = pair.t;
    s.estimate = T * pair.estimate;
    s.truth = pair.truth;
    s.true_velocity = pair.true_velocity;
    const Vector6d d = s.estimate.minus(s.truth);
    s.position_error = d.head<3>();
    s.rotation_error = d.tail<3>();
    if (!input.covariances.empty())
      s.sigma = T.covariance(input.covariances[pair.index]).diagonal().cwiseMax(0).cwiseSqrt();
    samples.push_back(s);
  }
  return samples;
}

void measure_optional_inputs(const ScoreInput& input, TrajectoryScore* score) {
  const std::vector<ErrorSample>& samples = score->samples;
  const Similarity& T = score->T_truth_estimate;
  if (!input.velocities.empty()) {
    std::vector<double> errors_mm_s;
    for (const ErrorSample& s : samples)
      errors_mm_s.push_back(1e3 * (T.scale * (T.q * input.velocities[s.index]) - s.true_velocity).norm());
    score->velocity_rmse_mm_s = summarise(errors_mm_s).rmse;
  }
  if (!input.pixels_per_metre.empty()) score->along_motion_px = along_motion(samples, input.pixels_per_metre);
  if (!input.covariances.empty()) {
    if (const auto nees = consistency(samples, input.covariances, T)) {
      score->nees6_mean = nees->mean;
      score->nees6_in_band = nees->share_in_band;
      score->nees_by_direction = nees->by_direction;
    }
  }
}

}  // namespace

double ErrorSample::are_deg() const { return kDegPerRad * rotation_error.norm(); }

TrajectoryScore score_trajectory(const ScoreInput& input, const ScoreOptions& options) {
  const std::size_t count = input.estimate.size();
  EVPOSE_CHECK(input.covariances.empty() || input.covariances.size() == count);
  EVPOSE_CHECK(input.velocities.empty() || input.velocities.size() == count);
  EVPOSE_CHECK(input.pixels_per_metre.empty() || input.pixels_per_metre.size() == count);

  TrajectoryScore score;
  score.alignment = options.alignment;
  if (input.truth.size() < 2) return score;
  const Span span = judged_span(input, options);
  const std::vector<PosePair> pairs = pairs_within(input, options);
  if (pairs.size() < 2) {
    if (span.from < span.to) score.lost.push_back({span.from, span.to});
    return score;
  }
  score.pairs = pairs.size();
  score.T_truth_estimate = fit(pairs, options);
  score.samples = errors_of(pairs, input, score.T_truth_estimate);

  std::vector<double> ate_mm, are_deg;
  for (const ErrorSample& s : score.samples) {
    ate_mm.push_back(s.ate_mm());
    are_deg.push_back(s.are_deg());
  }
  score.ate_mm = summarise(std::move(ate_mm));
  score.are_deg = summarise(std::move(are_deg));
  const Coverage coverage = coverage_of(score.samples, span.from, span.to);
  score.coverage = coverage.share;
  score.lost = coverage.lost;
  score.over_10ms = relative_over_time(score.samples, 10 * kNsPerMs);
  score.over_100ms = relative_over_time(score.samples, 100 * kNsPerMs);
  score.over_1s = relative_over_time(score.samples, kNsPerS);
  score.over_1m = relative_over_path(score.samples, 1.0);
  if (const auto lag = lag_of(score.samples)) {
    score.lag_ms = lag->lag_ms;
    score.lag_standard_error_ms = lag->standard_error_ms;
  }
  score.jitter_mm = jitter(score.samples);
  measure_optional_inputs(input, &score);
  return score;
}

std::vector<std::pair<std::string, double>> TrajectoryScore::words() const {
  std::vector<std::pair<std::string, double>> out;
  if (pairs == 0) return out;
  const auto series = [&](const std::string& name, const Statistics& s, const std::string& unit) {
    out.insert(out.end(), {{name + "_mean_" + unit, s.mean},
                           {name + "_median_" + unit, s.median},
                           {name + "_rmse_" + unit, s.rmse},
                           {name + "_p95_" + unit, s.p95},
                           {name + "_max_" + unit, s.max}});
  };
  const auto figure = [&](const std::string& name, const std::optional<double>& value) {
    if (value) out.emplace_back(name, *value);
  };
  const auto relative = [&](const std::string& over, const std::optional<RelativeError>& error) {
    if (!error) return;
    out.emplace_back("rte_" + over + "_mm", error->translation_mm);
    out.emplace_back("rre_" + over + "_deg", error->rotation_deg);
  };
  series("ate", ate_mm, "mm");
  series("are", are_deg, "deg");
  relative("10ms", over_10ms);
  relative("100ms", over_100ms);
  relative("1s", over_1s);
  relative("1m", over_1m);
  figure("velocity_rmse_mm_s", velocity_rmse_mm_s);
  figure("lag_ms", lag_ms);
  figure("lag_standard_error_ms", lag_standard_error_ms);
  figure("along_motion_px", along_motion_px);
  figure("nees6_mean", nees6_mean);
  figure("nees6_in_band", nees6_in_band);
  if (const auto& nees = nees_by_direction) {
    for (const auto& [i, axis] : {std::pair(0, "x"), std::pair(1, "y"), std::pair(2, "z")})
      out.emplace_back(std::string("nees_position_") + axis, nees->position(i));
    for (const auto& [i, axis] : {std::pair(0, "x"), std::pair(1, "y"), std::pair(2, "z")})
      out.emplace_back(std::string("nees_rotation_") + axis, nees->rotation(i));
    out.emplace_back("nees_position_weakest", nees->weakest_position);
    out.emplace_back("nees_rotation_weakest", nees->weakest_rotation);
  }
  figure("jitter_mm", jitter_mm);
  if (alignment == Alignment::sim3) out.emplace_back("scale", T_truth_estimate.scale);
  return out;
}

}  // namespace evpose
