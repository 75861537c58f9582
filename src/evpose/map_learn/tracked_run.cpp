// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/tracked_run.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <sstream>

#include "evpose/io/calibration/calibration.h"

namespace evpose::map_learn {
namespace {

constexpr TimeNs kRateOver = 10 * kNsPerMs;  // to each side, for the turn rate, which a run does not tell

bool same_file(const std::string& a, const std::string& b) {
  std::error_code ignored;
  return std::filesystem::equivalent(a, b, ignored);
}

Status check_input(const RunFiles& run, const std::string& recording, const std::string& map) {
  const RunInput& input = run.input;
  if (input.recording.empty())
    return Error{run.folder, "does not say what it was made from", "give what evpose track wrote"};
  if (!same_file(input.recording, recording))
    return Error{run.folder, "was made from " + input.recording + ", not from " + recording,
                 "give a run for each recording, in their order"};
  if (!same_file(input.map, map))
    return Error{run.folder, "was tracked with " + input.map + ", not with " + map,
                 "track the recording with the map that is to be made better"};
  return {};
}

Status check_health(const RunFiles& run) {
  if (run.interrupted)
    return Error{run.folder, "was broken off before the recording's end", "track the recording to its end"};
  const auto valid =
      std::count_if(run.rows.begin(), run.rows.end(), [](const RunRow& r) { return r.valid(); });
  if (const double share = tracking_share(run); share < kLeastTracked || valid < 2)
    return Error{run.folder,
                 text("was tracking in ", std::lround(100 * share), " % of its time; nothing can be learnt"),
                 "learn from a run that was tracked; its report.html says more"};
  if (!run.rows.back().valid())
    return Error{run.folder, "was lost at its end", "learn from a run that was tracked to its end"};
  return {};
}

FusionState state_of(const RunRow& row) {
  FusionState out;
  out.t = row.t;
  out.nav = {row.T_map_body, row.velocity};
  out.gyro_bias = row.gyro_bias;
  out.accel_bias = row.accel_bias;
  out.covariance.topLeftCorner<6, 6>() = row.covariance;
  return out;
}

void add_turn_rates(Trajectory& states) {
  std::size_t before = 0, after = 0;
  for (std::size_t k = 0; k < states.size(); ++k) {
    while (states[k].t - states[before].t > kRateOver) ++before;
    while (after + 1 < states.size() && states[after].t - states[k].t < kRateOver) ++after;
    const FusionState &a = states[before], &b = states[after];
    states[k].angular_rate =
        so3::log(a.nav.T_map_body.q.conjugate() * b.nav.T_map_body.q) / to_seconds(b.t - a.t);
  }
}

Eigen::VectorXd numbers_of(const CameraIntrinsics& i) {
  Eigen::VectorXd out(4 + static_cast<Eigen::Index>(i.distortion.size()));
  out.head<4>() << i.fx, i.fy, i.cx, i.cy;
  for (std::size_t k = 0; k < i.distortion.size(); ++k)
    out(4 + static_cast<Eigen::Index>(k)) = i.distortion[k];
  return out;
}

}  // namespace

double tracking_share(const RunFiles& run) {
  const auto tracked = std::count_if(run.rows.begin(), run.rows.end(),
                                     [](const RunRow& r) { return r.health == Health::tracking; });
  return static_cast<double>(tracked) / static_cast<double>(run.rows.size());
}

Expected<RunFiles> read_run_of(const std::string& folder, const std::string& recording,
                               const std::string& map) {
  auto run = read_run_files(folder);
  if (!run) return run;
  if (auto ok = check_input(*run, recording, map); !ok) return ok.error();
  if (auto ok = check_health(*run); !ok) return ok.error();
  return run;
}

Trajectory states_of(const RunFiles& run, double rate_hz) {
  Trajectory given, out;
  for (const RunRow& row : run.rows)
    if (row.valid() || !given.empty()) given.push_back(state_of(row));
  EVPOSE_CHECK(given.size() >= 2);
  add_turn_rates(given);
  const TimeNs start = given.front().t;
  // The run's own grid, rounded to nanoseconds, may end one of them early.
  for (TimeNs t = start; t <= given.back().t + 1;
       t = start + from_seconds(static_cast<double>(out.size()) / rate_hz)) {
    out.push_back(state_at(given, t));
    out.back().t = t;
  }
  return out;
}

Expected<Calibration> found_by(const RunFiles& run, const TrackJob& job) {
  Calibration out;
  const CameraIntrinsics& given = job.recording.camera;
  out.intrinsics.setZero(numbers_of(given).size());
  out.intrinsics_sigma = out.intrinsics;
  if (run.calibration == run.input.calibration) return out;
  const auto file = read_calibration(run.calibration);
  if (!file) return file.error();
  const auto camera = choose_camera(*file);
  if (!camera) return camera.error();
  if (camera->intrinsics->distortion.size() != given.distortion.size() || !camera->T_cam_imu)
    return Error{run.calibration, "is not of the recording's camera", "give a complete run folder"};
  const Pose T_body_cam = camera->T_cam_imu->inverse();
  out.turn = T_body_cam.q * job.setup.T_body_cam.q.conjugate();
  out.shift = T_body_cam.p - job.setup.T_body_cam.p;
  out.time_offset_s = camera->timeshift_cam_imu_s - job.recording.timeshift_cam_imu_s;
  out.intrinsics = numbers_of(*camera->intrinsics) - numbers_of(given);
  out.intrinsics_sigma = camera->sigma.of_intrinsics(*camera->intrinsics);
  out.turn_sigma_rad = camera->sigma.of_rotation_rad();
  out.shift_sigma_m = camera->sigma.of_translation_m();
  out.time_sigma_s = camera->sigma.of_time_s();
  return out;
}

TrackRequest request_of(TrackRequest request, const RunFiles& run, const FusionState& start) {
  const Pose& T = start.nav.T_map_body;
  std::ostringstream words;
  words.precision(std::numeric_limits<double>::max_digits10);
  for (const double v : {T.p.x(), T.p.y(), T.p.z(), T.q.x(), T.q.y(), T.q.z()}) words << v << ',';
  words << T.q.w() << '@' << to_seconds(start.t);
  request.init = words.str();
  if (request.calibration.empty()) request.calibration = run.input.calibration;
  return request;
}

}  // namespace evpose::map_learn
