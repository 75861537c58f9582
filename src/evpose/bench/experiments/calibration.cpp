// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/calibration.h"

#include <algorithm>
#include <cstdio>

namespace evpose::experiments {
namespace {

constexpr double kDegree = M_PI / 180;
constexpr double kSpoiltTimeSigma_s = 0.02, kSpoiltRotationSigma_rad = 0.02;  // for errors of 20 ms, 1 deg
constexpr double kShiftedStartSigma_m = 0.01;  // of a start whose camera is said to be elsewhere

/// By how much a given calibration is wrong.
struct CalibrationError {
  double offset_s;
  Eigen::Vector3d turn_deg;  ///< of the given camera about the body's axes
  Eigen::Vector3d shift_mm = Eigen::Vector3d::Zero();

  bool timed() const { return offset_s != 0 || !(turned() || shifted()); }
  bool turned() const { return turn_deg.norm() > 0; }
  bool shifted() const { return shift_mm.norm() > 0; }
  Eigen::Vector3d turn_rad() const { return turn_deg * kDegree; }
};

const CalibrationError kErrors[] = {
    {0, {0, 0, 0}}, {0.02, {0, 0, 0}}, {-0.02, {0, 0, 0}},       {0, {1, 0, 0}},
    {0, {0, 1, 0}}, {0, {0, 0, 1}},    {0.01, {0.5, -0.5, 0.5}}, {0, {0, 0, 0}, {10, -10, 5}}};

/// What the tracker knew in the end.
struct CalibrationOutcome {
  Health at_end = Health::waiting;
  Calibration found;
  int frozen = 0, updates = 0;
};

/// Makes the given calibration wrong and lets the tracker estimate what is wrong with it.
void spoil(const CalibrationError& error, Streams& streams) {
  FusionConfig& fusion = streams.job.config.tracker.fusion;
  CalibrationSigma sigma = CalibrationSigma::known(*streams.job.setup.intrinsics);
  if (error.timed()) sigma.time_s = kSpoiltTimeSigma_s;
  if (error.shifted()) sigma.translation_m.reset();
  if (error.turned()) sigma.rotation_rad = Eigen::Vector3d::Constant(kSpoiltRotationSigma_rad);
  streams.job.setup.calibration_sigma = sigma;
  for (ImuSample& s : streams.imu) s.t += from_seconds(error.offset_s);
  Pose& given = streams.job.setup.T_body_cam;
  const Pose T_map_cam = streams.job.start.T_map_body * given;
  // The given rotation is turned back, so that the true one is turn * given.
  given.q = so3::exp(-error.turn_rad()) * given.q;
  if (error.turned()) {
    // The start is where the camera was seen to be; the body's attitude is as wrong as the calibration.
    streams.job.start.T_map_body = T_map_cam * given.inverse();
    fusion.start_rotation_sigma_rad = kSpoiltRotationSigma_rad;
  }
  if (error.shifted()) {
    given.p -= 1e-3 * error.shift_mm;
    streams.job.start.T_map_body = T_map_cam * given.inverse();
    fusion.start_position_sigma_m = kShiftedStartSigma_m;
  }
}

Expected<CalibrationOutcome> track(const Streams& streams) {
  auto tracker = Tracker::create(streams.job.setup, streams.job.config.tracker, streams.job.start);
  if (!tracker) return tracker.error();
  CalibrationOutcome out;
  (*tracker)->on_update([&](const Update& u) {
    out.at_end = u.health;
    ++out.updates;
    out.frozen += (*tracker)->calibration().frozen ? 1 : 0;
  });
  feed(streams.packets, streams.imu, **tracker);
  out.found = (*tracker)->calibration();
  return out;
}

void print_row(const std::string& name, const CalibrationError& error, const CalibrationOutcome& outcome) {
  const Calibration& found = outcome.found;
  std::printf("| %s | %.0f | %.1f, %.1f, %.1f | %.0f, %.0f, %.0f | %s | ", name.c_str(), 1e3 * error.offset_s,
              error.turn_deg.x(), error.turn_deg.y(), error.turn_deg.z(), error.shift_mm.x(),
              error.shift_mm.y(), error.shift_mm.z(), to_string(outcome.at_end));
  const auto cell = [](bool wanted, const char* format, double value, double sigma) {
    if (wanted)
      std::printf(format, value, sigma);
    else
      std::printf("- | ");
  };
  const Eigen::Quaterniond turn = so3::exp(error.turn_rad());
  cell(error.timed(), "%.3f +- %.3f | ", 1e3 * (found.time_offset_s - error.offset_s),
       1e3 * found.time_sigma_s);
  cell(error.turned(), "%.3f +- %.3f | ", so3::log(found.turn * turn.conjugate()).norm() / kDegree,
       found.turn_sigma_rad.norm() / kDegree);
  cell(error.shifted(), "%.1f +- %.1f | ", (1e3 * found.shift - error.shift_mm).norm(),
       1e3 * found.shift_sigma_m.norm());
  std::printf("%.0f |\n", 100.0 * outcome.frozen / std::max(1, outcome.updates));
  std::fflush(stdout);
}

}  // namespace

Status print_calibration(const Selection& selection) {
  const auto config = configure(selection.assignments);
  if (!config) return config.error();
  const auto recordings = select_recordings(selection);
  if (!recordings) return recordings.error();
  std::printf(
      "| recording | offset given wrong by ms | rotation given wrong by deg | shifted by mm | at the end "
      "| offset error ms | rotation error deg | shift error mm | frozen %% of the time |\n"
      "|---|---|---|---|---|---|---|---|---|\n");
  for (const BenchRecording& recording : *recordings) {
    const auto streams = load_streams(recording, *config);
    if (!streams) return streams.error();
    for (const CalibrationError& error : kErrors) {
      Streams spoilt = *streams;
      spoil(error, spoilt);
      const auto outcome = track(spoilt);
      if (!outcome) return outcome.error();
      print_row(recording.name, error, *outcome);
    }
  }
  return {};
}

}  // namespace evpose::experiments
