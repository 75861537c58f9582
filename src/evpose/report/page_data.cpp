// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "evpose/core/version.h"
#include "evpose/eval/statistics.h"
#include "evpose/report/page.h"
#include "evpose/report/page_parts.h"
#include "evpose/report/summary.h"

namespace evpose {
namespace {

using Json = PageJson;

constexpr double kDegPerRad = 180 / std::numbers::pi;
constexpr std::size_t kPathPoints = 1500, kMapPoints = 4000, kMarks = 300;
constexpr std::size_t kPictureBytes = 700'000;  // of all pictures: the file shall stay below 2.5 MB

std::string format(const char* pattern, auto... values) {
  char out[200];
  std::snprintf(out, sizeof out, pattern, values...);
  return out;
}

/// With three significant digits, zeros kept.
std::string three_digits(double value) {
  const double magnitude = std::abs(value) > 0 ? std::floor(std::log10(std::abs(value))) : 0;
  return format("%.*f", static_cast<int>(std::clamp(2 - magnitude, 0.0, 6.0)), value);
}

Json numbers(const std::vector<double>& values, int digits) {
  Json out = Json::array();
  for (const double v : values) out.push_back(rounded(v, digits));
  return out;
}

/// Positions as columns; `position(i)` in metres.
template <class Position>
Json columns(const std::vector<std::size_t>& indices, int digits, Position&& position) {
  Json x = Json::array(), y = Json::array(), z = Json::array();
  for (const std::size_t i : indices) {
    const Eigen::Vector3d p = position(i);
    x.push_back(rounded(p.x(), digits));
    y.push_back(rounded(p.y(), digits));
    z.push_back(rounded(p.z(), digits));
  }
  return {{"x", x}, {"y", y}, {"z", z}};
}

Json path_json(const std::string& name, const std::string& role, std::span<const TimedPose> path,
               TimeNs origin) {
  const std::vector<std::size_t> indices = evenly_spaced_indices(path.size(), kPathPoints);
  Json out = columns(indices, 7, [&](std::size_t i) { return path[i].pose.p; });
  out["name"] = name;
  out["role"] = role;
  out["t"] = Json::array();
  for (const std::size_t i : indices) out["t"].push_back(rounded(to_seconds(path[i].t - origin), 7));
  return out;
}

Json cdf_json(std::vector<double> values) {
  constexpr int kSteps = 400;
  std::sort(values.begin(), values.end());
  Json x = Json::array(), y = Json::array();
  for (int i = 0; i <= kSteps; ++i) {
    const double share = static_cast<double>(i) / kSteps;
    x.push_back(rounded(quantile(values, share), 5));
    y.push_back(rounded(share, 5));
  }
  return {{"x", x}, {"y", y}};
}

/// Errors and bounds of three axes, in the unit that `scale` makes of metres or radians.
Json axes_json(const TrajectoryScore& score, TimeNs origin, bool rotation, double scale) {
  constexpr const char* kNames[] = {"x", "y", "z"};
  Json out = Json::array();
  for (int axis = 0; axis < 3; ++axis) {
    Series error, bound;
    for (const ErrorSample& s : score.samples) {
      const double t = to_seconds(s.t - origin);
      error.add(t, scale * (rotation ? s.rotation_error[axis] : s.position_error[axis]));
      bound.add(t, 3 * scale * s.sigma[axis + (rotation ? 3 : 0)]);
    }
    Json entry = {{"name", kNames[axis]}, {"ink", kNames[axis]}, {"error", series_json(error)}};
    if (*std::max_element(bound.y.begin(), bound.y.end()) > 0) entry["bound"] = series_json(bound);
    out.push_back(entry);
  }
  return out;
}

Json errors_json(const TrajectoryScore& score, TimeNs origin) {
  Series ate, are, ate_bound, are_bound;
  for (const ErrorSample& s : score.samples) {
    const double t = to_seconds(s.t - origin);
    ate.add(t, s.ate_mm());
    are.add(t, s.are_deg());
    ate_bound.add(t, 3e3 * s.sigma.head<3>().norm());
    are_bound.add(t, 3 * kDegPerRad * s.sigma.tail<3>().norm());
  }
  Json out;
  out["about"] = score.alignment == Alignment::none
                     ? std::string("Without alignment: the map is the frame.")
                     : format("After alignment to the ground truth (%s).", to_string(score.alignment));
  out["ate"] = series_json(ate);
  out["are"] = series_json(are);
  if (*std::max_element(ate_bound.y.begin(), ate_bound.y.end()) > 0) {
    out["ate_bound"] = series_json(ate_bound);
    out["are_bound"] = series_json(are_bound);
  }
  out["position"] = axes_json(score, origin, false, 1e3);
  out["rotation"] = axes_json(score, origin, true, kDegPerRad);
  out["cdf_ate"] = cdf_json(std::move(ate.y));
  out["cdf_are"] = cdf_json(std::move(are.y));
  return out;
}

/// The longest ones, in order of time: a browser would be slow to draw thousands.
Json lost_json(const TrajectoryScore& score, TimeNs origin) {
  std::vector<Stretch> longest = score.lost;
  const auto longer = [](const Stretch& a, const Stretch& b) { return a.length_s() > b.length_s(); };
  std::stable_sort(longest.begin(), longest.end(), longer);
  longest.resize(std::min(longest.size(), kMarks));
  std::sort(longest.begin(), longest.end(),
            [](const Stretch& a, const Stretch& b) { return a.from < b.from; });
  Json out = Json::array();
  for (const Stretch& s : longest)
    out.push_back({{"from", to_seconds(s.from - origin)}, {"to", to_seconds(s.to - origin)}});
  return out;
}

void add_errors(const TrajectoryScore& score, TimeNs origin, Json* data) {
  if (score.pairs == 0) return;
  (*data)["errors"] = errors_json(score, origin);
  (*data)["lost"] = lost_json(score, origin);
}

Json latency_json(const StateLog& log, const LatencySummary& latency) {
  constexpr double kLeast_ms = 1e-4;  // the clock's own grain
  double largest_ms = kLeast_ms;
  for (const LatencyFigures& f : latency.stages) largest_ms = std::max(largest_ms, f.max_ms);
  Json stages = Json::array(), table = Json::array();
  const auto row = [&](const std::string& name, const LatencyFigures& f) {
    table.push_back({name, format("%.3f", f.p50_ms), format("%.3f", f.p99_ms), format("%.3f", f.max_ms)});
  };
  for (std::size_t i = 0; i < kStageNames.size(); ++i) {
    std::vector<double> values;
    for (const StateRow& r : log.rows) values.push_back(r.stages_ms[i]);
    LogHistogram histogram = log_histogram(values, kLeast_ms, largest_ms, 12);
    histogram.shares.push_back(0);  // brings the last step down at the last edge
    std::size_t first = 0, last = histogram.shares.size() - 1;
    while (first < last && histogram.shares[first] == 0) ++first;
    while (last > first && histogram.shares[last - 1] == 0) --last;
    Json x = Json::array(), y = Json::array();
    for (std::size_t k = first; k <= last; ++k) {
      x.push_back(rounded(histogram.edges[k], 5));
      y.push_back(rounded(histogram.shares[k], 5));
    }
    stages.push_back({{"name", kStageNames[i]}, {"x", x}, {"y", y}});
    row(kStageNames[i], latency.stages[i]);
  }
  row("pose after newest event", latency.update);
  return {{"stages", stages}, {"table", table}};
}

Json activity_json(const StateLog& log, TimeNs origin) {
  Series read, kept, points, matched;
  for (std::size_t i = 0; i < log.rows.size(); ++i) {
    const StateRow& row = log.rows[i];
    const double t = to_seconds(row.t - origin);
    points.add(t, row.points);
    matched.add(t, row.points_matched);
    if (i == 0 || row.t <= log.rows[i - 1].t) continue;
    const double interval_us = 1e6 * to_seconds(row.t - log.rows[i - 1].t);
    read.add(t, row.events_read / interval_us);
    kept.add(t, row.events_kept / interval_us);
  }
  return {{"read", series_json(read)},
          {"kept", series_json(kept)},
          {"points", series_json(points)},
          {"matched", series_json(matched)}};
}

Json health_json(const StateLog& log, TimeNs origin) {
  Json out = Json::array();
  for (std::size_t i = 0; i < std::min(log.health.size(), kMarks); ++i) {
    const HealthChange& h = log.health[i];
    const TimeNs end = i + 1 < log.health.size() ? log.health[i + 1].t : log.rows.back().t;
    out.push_back({{"from", to_seconds(h.t - origin)},
                   {"to", to_seconds(end - origin)},
                   {"state", to_string(h.health)},
                   {"reason", h.reason}});
  }
  if (log.health.size() > kMarks)
    out.back()["reason"] = log.health[kMarks - 1].reason +
                           format(" (%zu more changes: see states.csv)", log.health.size() - kMarks);
  return out;
}

Json tile(const std::string& label, const std::string& value, const std::string& unit,
          const std::string& note, const std::string& level = "") {
  return {{"label", label}, {"value", value}, {"unit", unit}, {"note", note}, {"level", level}};
}

void add_score_tiles(const TrajectoryScore& score, Json* tiles) {
  if (score.pairs > 0) {
    tiles->push_back(tile("Position error, mean", three_digits(score.ate_mm.mean), "mm",
                          format("rmse %.3g, largest %.3g mm", score.ate_mm.rmse, score.ate_mm.max)));
    tiles->push_back(tile("Rotation error, mean", three_digits(score.are_deg.mean), "deg",
                          format("rmse %.3g, largest %.3g deg", score.are_deg.rmse, score.are_deg.max)));
  }
  tiles->push_back(tile("Coverage", format("%.1f", std::floor(1000 * score.coverage) / 10), "%",
                        score.lost.empty() ? "of the ground truth"
                                           : format("of the ground truth; lost %zu time%s", score.lost.size(),
                                                    score.lost.size() == 1 ? "" : "s"),
                        score.coverage > 0.99  ? "good"
                        : score.coverage > 0.9 ? "warn"
                                               : "bad"));
  if (score.lag_ms)
    tiles->push_back(tile("Lag", format("%.2f", *score.lag_ms), "ms",
                          score.lag_standard_error_ms
                              ? format("standard error %.2f ms", *score.lag_standard_error_ms)
                              : "behind the truth if positive"));
  if (score.nees6_mean)
    tiles->push_back(tile("NEES / 6", format("%.2f", *score.nees6_mean), "",
                          format("1 is ideal; %.0f %% in the 95 %% band", 100 * *score.nees6_in_band)));
  if (score.over_100ms)
    tiles->push_back(tile("Drift over 100 ms", three_digits(score.over_100ms->translation_mm), "mm",
                          format("%.3g deg", score.over_100ms->rotation_deg)));
}

void add_run_tiles(const StateLog& log, const RunSummary& summary, Json* tiles) {
  if (const auto latency = summarise_latency(log))
    tiles->push_back(tile("Pose after newest event", format("%.2f", latency->update.p50_ms), "ms",
                          format("median; p99 %.2f ms", latency->update.p99_ms)));
  const double million = 1e-6 * static_cast<double>(summary.events_read);
  if (summary.wall_s > 0)
    tiles->push_back(tile("Events", three_digits(million), "million",
                          format("%.3g million / s processed", million / summary.wall_s)));
  if (log.rows.size() < 2) return;
  const double data_s = to_seconds(log.rows.back().t - log.rows.front().t);
  tiles->push_back(tile("Length", format("%.2f", data_s), "s", format("%zu updates", log.rows.size())));
  if (summary.cpu_s > 0)
    tiles->push_back(tile("Processor", format("%.0f", 100 * summary.cpu_s / data_s), "%",
                          format("of a core in real time; memory %.0f MB", summary.peak_memory_mb)));
}

Json shell(const std::string& title, const std::string& subtitle) {
  return {{"title", title},
          {"subtitle", subtitle},
          {"tiles", Json::array()},
          {"paths", Json::array()},
          {"foot", format("evpose %s", version())}};
}

void add_paths(std::span<const TimedPose> estimate, std::span<const TimedPose> truth, TimeNs origin,
               Json* data) {
  // The estimate last, so that it lies on top.
  if (!truth.empty()) (*data)["paths"].push_back(path_json("ground truth", "truth", truth, origin));
  if (!estimate.empty()) (*data)["paths"].push_back(path_json("estimate", "estimate", estimate, origin));
}

/// The map around the paths; the rest of a large one would only make them small.
std::vector<Eigen::Vector3d> points_near(const std::vector<Eigen::Vector3d>& points,
                                         std::span<const TimedPose> estimate,
                                         std::span<const TimedPose> truth) {
  constexpr double kMargin_m = 8;
  Eigen::AlignedBox3d box;
  for (const auto& path : {estimate, truth})
    for (const TimedPose& p : path) box.extend(p.pose.p);
  std::vector<Eigen::Vector3d> out;
  if (box.isEmpty()) return out;
  const Eigen::Vector3d margin = Eigen::Vector3d::Constant(kMargin_m);
  box.extend(Eigen::Vector3d(box.min() - margin));
  box.extend(Eigen::Vector3d(box.max() + margin));
  std::copy_if(points.begin(), points.end(), std::back_inserter(out),
               [&](const Eigen::Vector3d& p) { return box.contains(p); });
  return out;
}

Json details_json(const RunSummary& summary, const ConfigTable& config) {
  Json settings = Json::array(), versions = Json::array();
  for (const ConfigTable::Value& v : config.values())
    settings.push_back({v.key, v.unit.empty() ? v.value : v.value + " " + v.unit, v.help});
  versions.push_back({"evpose", version()});
  for (const auto& [name, number] : summary.versions) versions.push_back({name, number});
  return {{{"title", "Settings"}, {"rows", settings}}, {{"title", "Versions"}, {"rows", versions}}};
}

/// As many as there is room for, evenly over the run.
Json overlays_json(std::span<const OverlayPicture> overlays) {
  for (std::size_t count = overlays.size(); count > 0; --count) {
    Json out = Json::array();
    std::size_t bytes = 0;
    for (const std::size_t i : evenly_spaced_indices(overlays.size(), count)) {
      const OverlayPicture& o = overlays[i];
      std::string png = base64(o.png);
      bytes += png.size();
      out.push_back(
          {{"caption", o.caption}, {"png", std::move(png)}, {"width", o.width}, {"height", o.height}});
    }
    if (bytes <= kPictureBytes) return out;
  }
  return Json::array();
}

std::string page(const Json& data) {
  return page_html(data["title"].get<std::string>(),
                   data.dump(-1, ' ', false, Json::error_handler_t::replace));
}

}  // namespace

Json series_json(const Series& series, std::size_t points) {
  const Series few = thin(series, points);
  return {{"t", numbers(few.t, 7)}, {"y", numbers(few.y, 5)}};
}

std::string run_page(const RunPage& run) {
  const StateLog& log = run.log;
  Json data = shell(run.summary.title, run.summary.subtitle);
  data["status"] = status_word(log.rows.empty() ? Health::waiting : log.rows.back().health);
  if (run.score) add_score_tiles(*run.score, &data["tiles"]);
  add_run_tiles(log, run.summary, &data["tiles"]);

  std::vector<TimedPose> estimate;
  for (const StateRow& row : log.rows)
    if (row.valid()) estimate.push_back({row.t, row.T_map_body});
  const TimeNs origin = !log.rows.empty() ? log.rows.front().t : 0;
  std::vector<TimedPose> truth;  // as far as the run goes
  for (const TimedPose& p : run.summary.truth)
    if (!log.rows.empty() && p.t >= log.rows.front().t && p.t <= log.rows.back().t) truth.push_back(p);
  add_paths(estimate, truth, origin, &data);
  if (const auto near = points_near(run.summary.map_points, estimate, truth); !near.empty())
    data["map"] =
        columns(evenly_spaced_indices(near.size(), kMapPoints), 6, [&](std::size_t i) { return near[i]; });
  if (run.score) add_errors(*run.score, origin, &data);
  if (!log.rows.empty()) {
    data["activity"] = activity_json(log, origin);
    data["health"] = health_json(log, origin);
    if (const auto latency = summarise_latency(log)) data["latency"] = latency_json(log, *latency);
  }
  data["start"] = start_json(log, run.summary);
  data["motion"] = motion_json(log, truth, origin);
  data["biases"] = biases_json(log, origin);
  data["calibration"] = calibration_page_json(log, run.summary, origin);
  data["overlays"] = overlays_json(run.overlays);
  data["details"] = details_json(run.summary, run.config);
  return page(data);
}

std::string score_page(const std::string& title, const std::string& subtitle, const TrajectoryScore& score,
                       std::span<const TimedPose> truth) {
  Json data = shell(title, subtitle);
  add_score_tiles(score, &data["tiles"]);
  std::vector<TimedPose> estimate;
  for (const ErrorSample& s : score.samples) estimate.push_back({s.t, s.estimate});
  const TimeNs origin = !truth.empty() ? truth.front().t : 0;
  add_paths(estimate, truth, origin, &data);
  add_errors(score, origin, &data);
  return page(data);
}

}  // namespace evpose
