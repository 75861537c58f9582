// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/run/start.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "evpose/core/geodesy.h"
#include "evpose/io/motion/trajectory_tum.h"

namespace evpose {
namespace {

constexpr double kUnknownSpeed_m_s = 0.5;  // of a start pose given without velocity
constexpr double kUnknownRate_rad_s = 0.5;
constexpr TimeNs kDifference = 5 * kNsPerMs;  // velocity from poses at least so far to both sides

/// First pose of the trajectory inside the recording, velocities from its neighbours.
Expected<StartState> from_trajectory(const std::vector<TimedPose>& poses, const Recording& recording,
                                     const std::string& where) {
  const auto before = [](const TimedPose& p, TimeNs t) { return p.t < t; };
  const auto first = std::lower_bound(poses.begin(), poses.end(), recording.first_ns, before);
  if (first == poses.end() || first->t > recording.last_ns)
    return Error{where, "no pose inside the recording's events",
                 "check the clocks (time.offset_groundtruth_s), or give a pose with --init"};
  auto a = first, b = first;
  while (a != poses.begin() && first->t - a->t < kDifference) --a;
  while (b + 1 != poses.end() && b->t - first->t < kDifference) ++b;
  if (a == b) return Error{where, "a single pose has no velocity", "give --init x,y,z,qx,qy,qz,qw@t_s"};
  const double dt = to_seconds(b->t - a->t);
  StartState start;
  start.t = first->t;
  start.T_map_body = first->pose;
  start.velocity = (b->pose.p - a->pose.p) / dt;
  start.angular_rate_body = so3::log(a->pose.q.conjugate() * b->pose.q) / dt;
  return start;
}

bool parse(const char*& at, const char* end, double* value) {
  const auto r = std::from_chars(at, end, *value);
  if (r.ec != std::errc() || !std::isfinite(*value)) return false;
  at = r.ptr;
  return true;
}

Expected<StartState> from_text(const std::string& text_in, const Recording& recording) {
  const Error wrong{"--init", "'" + text_in + "' is no start pose",
                    "give groundtruth, anywhere, gps:LAT,LON,ALT, a TUM file, or x,y,z,qx,qy,qz,qw[@t_s] "
                    "with a unit quaternion"};
  const char* at = text_in.data();
  const char* const end = at + text_in.size();
  double v[7];
  for (int i = 0; i < 7; ++i) {
    if (i > 0 && (at == end || *at++ != ',')) return wrong;
    if (!parse(at, end, &v[i])) return wrong;
  }
  StartState start;
  start.t = recording.first_ns;
  if (at != end) {
    double t_s = 0;
    if (*at++ != '@' || !parse(at, end, &t_s) || at != end || std::abs(t_s) > 9e9) return wrong;
    start.t = from_seconds(t_s);
  }
  Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
  if (std::abs(q.norm() - 1) > 1e-2) return wrong;
  start.T_map_body = {q.normalized(), {v[0], v[1], v[2]}};
  return start;
}

/// Three or four numbers with commas between.
std::optional<std::vector<double>> gps_numbers(const std::string& words) {
  const char* at = words.data();
  const char* const end = at + words.size();
  std::vector<double> out;
  do {
    double number = 0;
    if (!parse(at, end, &number)) return {};
    out.push_back(number);
  } while (at != end && *at++ == ',');
  if (at != end || out.size() < 3 || out.size() > 4) return {};
  return out;
}

/// LAT,LON,ALT[,SIGMA]; the sigma, if it is given, replaces `sigma_m`.
Expected<Pose> from_gps(const std::string& words, const Recording& recording, const MapPlacement& placement,
                        double& sigma_m) {
  const auto numbers = gps_numbers(words);
  if (!numbers || std::abs((*numbers)[0]) > 90 || std::abs((*numbers)[1]) > 180 ||
      (numbers->size() == 4 && (*numbers)[3] <= 0))
    return Error{"--init", "'gps:" + words + "' is no place on earth",
                 "give gps:LAT,LON,ALT[,SIGMA] in degrees, m above the ellipsoid, and m"};
  if (!placement.origin_llh)
    return Error{"--init gps", "the map is not placed on the earth",
                 "place it: `evpose map import MAP --heading DEG --origin LAT,LON,ALT -o PLACED.h5`"};
  if (numbers->size() == 4) sigma_m = (*numbers)[3];
  const Pose T_ned_map = recording.T_ned_map   ? Pose::from_matrix(*recording.T_ned_map)
                         : placement.T_ned_map ? *placement.T_ned_map
                                               : Pose{Eigen::Quaterniond(rotation_ned_enu()), {0, 0, 0}};
  const Eigen::Vector3d llh((*numbers)[0], (*numbers)[1], (*numbers)[2]);
  return Pose{Eigen::Quaterniond::Identity(), T_ned_map.inverse() * ned_from_llh(llh, *placement.origin_llh)};
}

void widen(double position_m, double rotation_rad, FusionConfig* config) {
  config->start_position_sigma_m = std::max(config->start_position_sigma_m, position_m);
  config->start_rotation_sigma_rad = std::max(config->start_rotation_sigma_rad, rotation_rad);
  config->start_velocity_sigma_m_s = std::max(config->start_velocity_sigma_m_s, kUnknownSpeed_m_s);
  config->start_angular_rate_sigma_rad_s =
      std::max(config->start_angular_rate_sigma_rad_s, kUnknownRate_rad_s);
}

}  // namespace

Expected<StartState> choose_start(const std::string& init, const Recording& recording,
                                  const std::vector<TimedPose>& truth, const StartSigma& sigma,
                                  const MapPlacement& placement, FusionConfig* config) {
  if (init == "groundtruth" || (init == "auto" && !truth.empty())) {
    if (truth.empty())
      return Error{"--init groundtruth", "the recording has no ground truth",
                   "give --init x,y,z,qx,qy,qz,qw[@t_s] or a TUM file"};
    return from_trajectory(truth, recording, recording.groundtruth_path);
  }
  if (init == "auto") {
    if (!recording.initial_pose)
      return Error{"--init", "the recording has neither ground truth nor initial_pose",
                   "give --init x,y,z,qx,qy,qz,qw[@t_s] or a TUM file"};
    widen(recording.initial_pose->sigma_p_m, recording.initial_pose->sigma_q_deg * M_PI / 180, config);
    StartState start;
    start.t = std::max(recording.initial_pose->t, recording.first_ns);
    start.T_map_body = recording.initial_pose->T_map_body;
    return start;
  }
  if (starts_anywhere(init) || starts_by_gps(init)) {
    if (!recording.has_imu)
      return Error{"--init " + init, "the recording has no IMU, which tells what is up",
                   "give --init x,y,z,qx,qy,qz,qw[@t_s] or a TUM file"};
    StartState start;
    start.t = recording.first_ns;
    double sigma_m = kAnywhereSigma_m;
    if (starts_by_gps(init)) {
      sigma_m = kGpsSigma_m;
      const auto place = from_gps(init.substr(std::string("gps:").size()), recording, placement, sigma_m);
      if (!place) return place.error();
      start.T_map_body = *place;
    }
    widen(sigma_m, kAnyHeading_deg * M_PI / 180, config);
    return start;
  }
  if (init.find(',') == std::string::npos) {
    const auto poses = read_tum(init);
    if (!poses)
      return Error{"--init", poses.error().line(),
                   "give groundtruth, anywhere, gps:LAT,LON,ALT, a TUM file, or x,y,z,qx,qy,qz,qw[@t_s]"};
    return from_trajectory(*poses, recording, init);
  }
  auto start = from_text(init, recording);
  if (!start) return start;
  if (start->t > recording.last_ns)
    return Error{"--init", "the start lies after the recording's end",
                 "give a time on the recording's clock after @"};
  widen(sigma.position_m, sigma.rotation_deg * M_PI / 180, config);
  return start;
}

std::string start_words(const std::string& init, bool has_truth) {
  if (init == "groundtruth" || (init == "auto" && has_truth)) return "started from ground truth";
  if (init == "auto") return "started from the recording's initial_pose";
  if (starts_anywhere(init)) return "started anywhere in the map";
  if (starts_by_gps(init)) return "started from a place by GPS";
  return init.find(',') == std::string::npos ? "started from " + init : "started from --init";
}

}  // namespace evpose
