// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/summary.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "evpose/core/version.h"
#include "evpose/eval/statistics.h"
#include "evpose/report/page_parts.h"

namespace evpose {
namespace {

using Json = PageJson;

LatencyFigures figures(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return {quantile(values, 0.5), quantile(values, 0.99), values.back()};
}

double rounded(double value) { return evpose::rounded(value, 6); }

double seconds(TimeNs t) { return static_cast<double>(t) / 1e9; }

Json accuracy_json(const TrajectoryScore& score) {
  Json out = Json::object();
  for (const auto& [name, value] : score.words()) out[name] = rounded(value);
  out["alignment"] = to_string(score.alignment);
  out["pairs"] = score.pairs;
  return out;
}

Json lost_json(const TrajectoryScore& score) {
  Json out = Json::array();
  for (const Stretch& s : score.lost) out.push_back({{"from_s", seconds(s.from)}, {"to_s", seconds(s.to)}});
  return out;
}

Json latency_json(const LatencySummary& latency) {
  Json stages = Json::object();
  for (std::size_t i = 0; i < kStageNames.size(); ++i) {
    const LatencyFigures& s = latency.stages[i];
    stages[kStageNames[i]] = {
        {"p50_ms", rounded(s.p50_ms)}, {"p99_ms", rounded(s.p99_ms)}, {"max_ms", rounded(s.max_ms)}};
  }
  return {{"update_p50_ms", rounded(latency.update.p50_ms)},
          {"update_p99_ms", rounded(latency.update.p99_ms)},
          {"update_max_ms", rounded(latency.update.max_ms)},
          {"stages", stages}};
}

Json events_json(const RunSummary& summary) {
  Json out = {{"read", summary.events_read}, {"kept", summary.events_kept}, {"shed", summary.events_shed}};
  if (summary.wall_s > 0)
    out["rate_mev_s"] = rounded(1e-6 * static_cast<double>(summary.events_read) / summary.wall_s);
  out["hot_pixels"] = Json::array();
  for (const auto& [x, y] : summary.hot_pixels) out["hot_pixels"].push_back({x, y});
  return out;
}

double data_seconds(const StateLog& log) {
  return log.rows.empty() ? 0 : to_seconds(log.rows.back().t - log.rows.front().t);
}

Json resources_json(const StateLog& log, const RunSummary& summary) {
  Json out = Json::object();
  // Processor time per second of data: 1 is one core kept busy by a live sensor.
  if (data_seconds(log) > 0 && summary.cpu_s > 0)
    out["cpu_share"] = rounded(summary.cpu_s / data_seconds(log));
  if (summary.peak_memory_mb > 0) out["peak_memory_mb"] = rounded(summary.peak_memory_mb);
  if (summary.wall_s > 0) out["wall_s"] = rounded(summary.wall_s);
  return out;
}

Json health_json(const StateLog& log) {
  Json out = Json::array();
  for (const HealthChange& h : log.health)
    out.push_back({{"t_s", seconds(h.t)}, {"state", to_string(h.health)}, {"reason", h.reason}});
  return out;
}

Json problems_json(const RunVerdict& verdict) {
  Json out = Json::array();
  for (const RunProblem& p : verdict.problems)
    out.push_back({{"state", to_string(p.health)},
                   {"reason", p.reason},
                   {"total_s", rounded(p.total_s)},
                   {"last_s", seconds(p.last)},
                   {"cause", p.cause},
                   {"remedy", p.remedy}});
  return out;
}

Json input_json(const RunInput& input) {
  Json out = {{"recording", input.recording}, {"map", input.map}, {"calibration", input.calibration}};
  if (!input.occluders.empty()) out["occluders"] = input.occluders;
  return out;
}

Json config_json(const ConfigTable& config) {
  Json out = Json::object();
  for (const ConfigTable::Value& v : config.values()) {
    const Json value = v.number ? Json::parse(v.value, nullptr, false) : Json(v.value);
    out[v.key] = value.is_discarded() ? Json(v.value) : value;
  }
  return out;
}

/// Text that is not UTF-8 (a file's name can be) is mended, not refused.
std::string dump(const Json& json) { return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n"; }

std::string line(const char* format, auto... values) {
  char out[300];
  std::snprintf(out, sizeof out, format, values...);
  return out;
}

}  // namespace

std::optional<LatencySummary> summarise_latency(const StateLog& log) {
  std::vector<double> update;
  std::vector<std::vector<double>> stages(kStageNames.size());
  double sum = 0;
  for (const StateRow& row : log.rows) {
    double after_newest_event = 0;
    for (std::size_t i = 0; i < stages.size(); ++i) {
      stages[i].push_back(row.stages_ms[i]);
      sum += row.stages_ms[i];
      if (i >= kStagesBeforeThePose) after_newest_event += row.stages_ms[i];
    }
    update.push_back(after_newest_event);
  }
  if (!(sum > 0)) return std::nullopt;
  LatencySummary out{figures(std::move(update)), {}};
  for (auto& s : stages) out.stages.push_back(figures(std::move(s)));
  return out;
}

std::string status_word(Health at_end) {
  switch (at_end) {
    case Health::tracking:
      return "tracking";
    case Health::initialising:
    case Health::degraded:
      return "degraded";
    case Health::waiting:
    case Health::ambiguous:
    case Health::lost:
      return "lost";
  }
  return "lost";
}

Json calibration_json(const RunCalibration& calibration) {
  const auto entry = [](double given, double given_sigma, double found, double sigma) {
    return Json{{"given", rounded(given)},
                {"given_sigma", rounded(given_sigma)},
                {"found", rounded(found)},
                {"sigma", rounded(sigma)}};
  };
  const CalibratedCamera &a = calibration.given, &b = calibration.found;
  const CameraIntrinsics &i = *a.intrinsics, &j = *b.intrinsics;
  const Eigen::VectorXd before = a.sigma.of_intrinsics(i), after = b.sigma.of_intrinsics(j);
  Json out;
  out["fx_px"] = entry(i.fx, before(0), j.fx, after(0));
  out["fy_px"] = entry(i.fy, before(1), j.fy, after(1));
  out["cx_px"] = entry(i.cx, before(2), j.cx, after(2));
  out["cy_px"] = entry(i.cy, before(3), j.cy, after(3));
  out["distortion"] = Json::array();
  for (std::size_t k = 0; k < i.distortion.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(k) + 4;
    out["distortion"].push_back(entry(i.distortion[k], before(at), j.distortion[k], after(at)));
  }
  if (!a.T_cam_imu || !b.T_cam_imu) return out;
  const Pose given = a.T_cam_imu->inverse(), found = b.T_cam_imu->inverse();
  const Eigen::Vector3d turn = so3::log(found.q * given.q.conjugate()) * 180 / M_PI;
  const Eigen::Vector3d turn_before = a.sigma.of_rotation_rad() * 180 / M_PI,
                        turn_after = b.sigma.of_rotation_rad() * 180 / M_PI,
                        shift_before = a.sigma.of_translation_m(), shift_after = b.sigma.of_translation_m();
  for (const int axis : {0, 1, 2}) {
    const std::string name(1, static_cast<char>('x' + axis));
    out["camera_turned_deg"][name] = entry(0, turn_before(axis), turn(axis), turn_after(axis));
    out["camera_in_imu_m"][name] = entry(given.p(axis), shift_before(axis), found.p(axis), shift_after(axis));
  }
  out["timeshift_cam_imu_s"] =
      entry(a.timeshift_cam_imu_s, a.sigma.of_time_s(), b.timeshift_cam_imu_s, b.sigma.of_time_s());
  return out;
}

std::string score_json(const TrajectoryScore& score) {
  return dump({{"coverage", rounded(score.coverage)},
               {"accuracy", accuracy_json(score)},
               {"lost", lost_json(score)}});
}

std::string summary_json(const StateLog& log, const RunSummary& summary, const ConfigTable& config,
                         const std::optional<TrajectoryScore>& score, const RunVerdict& verdict) {
  Json out;
  out["status"] = status_word(log.rows.empty() ? Health::waiting : log.rows.back().health);
  if (summary.interrupted) out["interrupted"] = true;
  out["tracking_share"] = rounded(verdict.tracking_share);
  out["problems"] = problems_json(verdict);
  out["findings"] = Json::array();
  for (const Error& f : summary.findings)
    out["findings"].push_back({{"where", f.where}, {"what", f.what}, {"fix", f.fix}});
  if (!summary.start.empty()) out["start"] = summary.start;
  if (!summary.input.recording.empty()) out["input"] = input_json(summary.input);
  if (score) {
    out["coverage"] = rounded(score->coverage);
    out["accuracy"] = accuracy_json(*score);
    out["lost"] = lost_json(*score);
  }
  if (summary.calibration) out["calibration"] = calibration_json(*summary.calibration);
  out["updates"] = log.rows.size();
  if (const auto latency = summarise_latency(log)) out["latency"] = latency_json(*latency);
  out["events"] = events_json(summary);
  out["resources"] = resources_json(log, summary);
  out["health"] = health_json(log);
  out["versions"] = {{"evpose", version()}};
  for (const auto& [name, number] : summary.versions) out["versions"][name] = number;
  out["config"] = config_json(config);
  return dump(out);
}

std::string score_text(const TrajectoryScore& score) {
  std::string out = line("%-24s %zu", "pairs", score.pairs);
  out += line("\n%-24s %.4f", "coverage", score.coverage);
  out += line("\n%-24s %s", "alignment", to_string(score.alignment));
  for (const auto& [name, value] : score.words()) out += line("\n%-24s %.6g", name.c_str(), value);
  if (score.lost.empty()) return out;
  const auto longest =
      std::max_element(score.lost.begin(), score.lost.end(),
                       [](const Stretch& a, const Stretch& b) { return a.length_s() < b.length_s(); });
  return out + line("\n%-24s %zu time%s, longest %.3f s .. %.3f s", "lost", score.lost.size(),
                    score.lost.size() == 1 ? "" : "s", seconds(longest->from), seconds(longest->to));
}

std::string summary_text(const StateLog& log, const RunSummary& summary,
                         const std::optional<TrajectoryScore>& score) {
  const Health at_end = log.rows.empty() ? Health::waiting : log.rows.back().health;
  std::string out = line("%s at the end; %zu updates over %.2f s of data, %zu change(s) of health",
                         status_word(at_end).c_str(), log.rows.size(), data_seconds(log),
                         log.health.empty() ? 0 : log.health.size() - 1);
  if (!summary.start.empty()) out += "; " + summary.start;
  if (summary.interrupted) out += "; interrupted";
  if (score && score->pairs > 0) {
    out += line("\nposition error: mean %.2f mm, p95 %.2f mm, largest %.2f mm", score->ate_mm.mean,
                score->ate_mm.p95, score->ate_mm.max);
    out += line("\nrotation error: mean %.3f deg, p95 %.3f deg, largest %.3f deg; coverage %.1f %%",
                score->are_deg.mean, score->are_deg.p95, score->are_deg.max, 100 * score->coverage);
  } else {
    out += "\nposition error: not known without ground truth";
    out += "\nrotation error: not known without ground truth";
  }
  if (const auto latency = summarise_latency(log))
    out += line("\nupdate: median %.2f ms, p99 %.2f ms after the newest event", latency->update.p50_ms,
                latency->update.p99_ms);
  else
    out += "\nupdate: not timed";
  const double kept = summary.events_read == 0 ? 0
                                               : 100 * static_cast<double>(summary.events_kept) /
                                                     static_cast<double>(summary.events_read);
  return out + line("\nevents: %.3f million read, %.0f %% kept",
                    1e-6 * static_cast<double>(summary.events_read), kept);
}

}  // namespace evpose
