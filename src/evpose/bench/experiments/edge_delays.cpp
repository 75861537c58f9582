// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/edge_delays.h"

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>

#include "evpose/bench/experiments/edge_delay_fit.h"
#include "evpose/bench/experiments/posed_looks.h"

namespace evpose::experiments {
namespace {

constexpr double kCounts = 500;  // events of a class, from which on it counts in the root mean square

struct MeasuredDelays {
  std::string name;
  DelaySamples samples;
};

/// What a sensor's parameters leave over of each sample; positive: earlier than they say.
struct Leftover {
  std::string name;
  std::vector<double> px;
};

Leftover leftover(const std::string& name, const DelaySamples& samples, const SensorDelay& sensor) {
  Leftover out{name, delays_px(samples, sensor)};
  for (std::size_t i = 0; i < out.px.size(); ++i) out.px[i] -= samples.samples[i].late_px;
  return out;
}

struct DelayClass {
  std::string name;
  bool on;
  double low, high;
  double (*value)(const DelaySample&);
  bool holds(const DelaySample& s) const { return s.on == on && value(s) >= low && value(s) < high; }
};

std::vector<DelayClass> delay_classes() {
  const std::vector<double> crossings{0, 0.5, 1, 2, 4, 1e9}, speeds{8, 25, 60, 120, 1e9};
  std::vector<DelayClass> out;
  const auto add = [&](const std::vector<double>& limits, const char* unit,
                       double (*value)(const DelaySample&)) {
    for (const bool on : {true, false})
      for (std::size_t k = 0; k + 1 < limits.size(); ++k) {
        const double low = limits[k], high = limits[k + 1];
        const bool last = k + 2 == limits.size();
        out.push_back({last ? text("> ", low, unit) : text(low, " - ", high, unit), on, low, high, value});
      }
  };
  add(crossings, " events", [](const DelaySample& s) { return s.crossing; });
  add(speeds, " px/s", [](const DelaySample& s) { return s.speed_px_s; });
  return out;
}

/// Mean over the events of a class.
struct ClassMean {
  double events = 0, left_px = 0;
};

ClassMean mean_of(const DelayClass& c, const DelaySamples& samples, const Leftover& left) {
  ClassMean out;
  for (std::size_t i = 0; i < left.px.size(); ++i) {
    const DelaySample& s = samples.samples[i];
    if (!c.holds(s)) continue;
    out.events += s.events;
    out.left_px += s.events * left.px[i];
  }
  out.left_px /= std::max(1.0, out.events);
  return out;
}

void print_left(const DelaySamples& samples, const std::vector<Leftover>& columns) {
  std::printf("\n| class | polarity | events |");
  for (const Leftover& c : columns) std::printf(" %s |", c.name.c_str());
  std::printf("\n|---|---|---|");
  for (std::size_t k = 0; k < columns.size(); ++k) std::printf("---|");
  std::vector<double> square(columns.size(), 0);
  int counted = 0;
  for (const DelayClass& c : delay_classes()) {
    const double events = mean_of(c, samples, columns[0]).events;
    counted += events >= kCounts;
    std::printf("\n| %s | %s | %.0f |", c.name.c_str(), c.on ? "on" : "off", events);
    for (std::size_t k = 0; k < columns.size(); ++k) {
      const double px = mean_of(c, samples, columns[k]).left_px;
      std::printf(" %.3f |", px);
      if (events >= kCounts) square[k] += px * px;
    }
  }
  std::printf("\n| root mean square | of %d classes | %.0f or more |", counted, kCounts);
  for (const double s : square) std::printf(" %.3f |", std::sqrt(s / std::max(1, counted)));
  std::printf("\n");
}

void print_fit(const char* of, const DelayFit& fit) {
  const SensorDelay& s = fit.sensor;
  const auto& sigma = fit.sigma;
  std::printf("| %s | %d | %.3f +- %.3f | %.3f +- %.3f | %.3f +- %.3f |\n", of, fit.samples, s.threshold,
              sigma[0], 1e3 * s.latency_on_s, 1e3 * sigma[1], 1e3 * s.latency_off_s, 1e3 * sigma[2]);
}

void print_fits_head() {
  std::printf("\n| fit | looks | threshold | latency on ms | latency off ms |\n|---|---|---|---|---|\n");
}

std::vector<const DelaySamples*> all_but(const std::vector<MeasuredDelays>& all,
                                         const MeasuredDelays* left_out) {
  std::vector<const DelaySamples*> out;
  for (const MeasuredDelays& m : all)
    if (&m != left_out) out.push_back(&m.samples);
  return out;
}

void print_recording(const MeasuredDelays& m, const std::vector<MeasuredDelays>& all) {
  const DelayFit own = fit_delay({&m.samples}, DelayFreedom::all);
  std::printf("\n### %s\n", m.name.c_str());
  print_fits_head();
  print_fit("its own", own);
  std::vector<Leftover> columns{leftover("as it is px", m.samples, {}),
                                leftover("own fit px", m.samples, own.sensor)};
  if (all.size() > 1) {
    const DelayFit others = fit_delay(all_but(all, &m), DelayFreedom::all);
    const DelayFit handed = fit_delay(all_but(all, &m), DelayFreedom::handed_on);
    print_fit("of the others", others);
    print_fit("of the others, handed on", handed);
    columns.push_back(leftover("others' fit px", m.samples, others.sensor));
    columns.push_back(leftover("others' fit, handed on px", m.samples, handed.sensor));
  }
  print_left(m.samples, columns);
}

/// How the program takes what was found.
void print_hand_on(const std::vector<MeasuredDelays>& all) {
  const DelayFit fit = fit_delay(all_but(all, nullptr), DelayFreedom::handed_on);
  std::printf("\n### all\n");
  print_fits_head();
  print_fit("all", fit_delay(all_but(all, nullptr), DelayFreedom::all));
  print_fit("all, handed on", fit);
  std::printf(
      "\nIn the configuration: registration.contrast_threshold: %.3f. In the calibration: timeshift_cam_imu "
      "less by %.6f s.\n",
      fit.sensor.threshold, fit.sensor.latency_on_s);
}

Expected<BenchRecording> recording_of(const EdgeDelaysRequest& request, std::size_t i) {
  const std::string& folder = request.recordings[i];
  BenchRecording out{folder, folder, folder + "/contours.ply", ""};
  const auto pick = [&](const std::vector<std::string>& from, std::string& to) {
    if (!from.empty()) to = from[from.size() == 1 ? 0 : i];
  };
  std::error_code ignored;
  if (request.maps.empty() && std::filesystem::exists(folder + "/mesh.ply", ignored))
    out.occluders = folder + "/mesh.ply";
  for (const auto* given : {&request.maps, &request.occluders})
    if (given->size() > 1 && given->size() != request.recordings.size())
      return Error{folder, text(given->size(), " files for ", request.recordings.size(), " recordings"),
                   "give one --map and one --occluders for each of them, or one for all"};
  pick(request.maps, out.map);
  pick(request.occluders, out.occluders);
  return out;
}

Expected<MeasuredDelays> measure(const BenchRecording& recording, const EdgeDelaysRequest& request) {
  const auto config = configure(request.assignments);
  if (!config) return config.error();
  const auto streams = load_streams(recording, *config);
  if (!streams) return streams.error();
  std::vector<TimedPose> poses = streams->job.truth;
  if (request.tracked) {
    auto found = tracked_poses(*streams);
    if (!found) return found.error();
    poses = *std::move(found);
  }
  if (poses.size() < 2)
    return Error{recording.folder, "no poses", "give a recording with ground truth, or --tracked"};
  const auto& filter = streams->job.setup.trail_filter;
  return MeasuredDelays{recording.name, delay_samples(looks_from(*streams, poses), filter)};
}

}  // namespace

Status print_edge_delays(const EdgeDelaysRequest& request) {
  std::vector<MeasuredDelays> all;
  for (std::size_t i = 0; i < request.recordings.size(); ++i) {
    const auto recording = recording_of(request, i);
    if (!recording) return recording.error();
    auto measured = measure(*recording, request);
    if (!measured) return measured.error();
    all.push_back(*std::move(measured));
  }
  for (const MeasuredDelays& m : all) print_recording(m, all);
  print_hand_on(all);
  return {};
}

}  // namespace evpose::experiments
