// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/mavlink/reporter.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "evpose/core/config.h"

namespace evpose {

void describe(ConfigTable& table, MavlinkConfig& c) {
  table.add("rate_hz", c.rate_hz, "Hz", "poses per second of data time, at most one for each update",
            {4, 5000});
  table.add("odometry", c.odometry, "send ODOMETRY");
  table.add("position", c.position, "send VISION_POSITION_ESTIMATE");
  table.add("speed", c.speed, "send VISION_SPEED_ESTIMATE");
  table.add("ned_frame", c.ned_frame, "frame_id of ODOMETRY is LOCAL_NED instead of LOCAL_FRD");
  table.add("system_id", c.system_id, "", "ours; 0: that of the vehicle, once heard", {0, 255});
  table.add("component_id", c.component_id, "", "ours; 197 is visual-inertial odometry", {1, 255});
  table.add("vehicle_time", c.vehicle_time, "stamps on the vehicle's clock, once TIMESYNC has answered");
  table.add("set_origin", c.set_origin, "send SET_GPS_GLOBAL_ORIGIN until the vehicle confirms it");
  table.add("origin_latitude_deg", c.origin_latitude_deg, "deg", "of the map's local origin", {-90, 90});
  table.add("origin_longitude_deg", c.origin_longitude_deg, "deg", "of the map's local origin", {-180, 180});
  table.add("origin_altitude_m", c.origin_altitude_m, "m", "of the map's local origin, above mean sea level",
            {-1e4, 1e5});
  table.add("landing_target", c.landing_target, "send LANDING_TARGET ten times a second");
  table.add("pad_x_m", c.pad_x_m, "m", "the landing pad in the map", {-1e6, 1e6});
  table.add("pad_y_m", c.pad_y_m, "m", "the landing pad in the map", {-1e6, 1e6});
  table.add("pad_z_m", c.pad_z_m, "m", "the landing pad in the map", {-1e6, 1e6});
}

namespace mavlink {
namespace {

constexpr TimeNs kHeartbeat = kNsPerS, kTimesync = kNsPerS, kOrigin = kNsPerS, kTarget = 100 * kNsPerMs;
constexpr TimeNs kLongestRoundTrip = 10 * kNsPerMs;
constexpr int kFirstReplies = 5;     // whose round trip may be longer
constexpr int kMinimumReplies = 30;  // after so many the least round trip is sought anew: clocks drift
constexpr int kFailedPoses = 3;      // a datagram may be lost
constexpr TimeNs kEarly = 8;         // a pose may be sent this part of a period early
constexpr double kJump_m = 0.1, kJump_rad = 0.1;  // more than motion explains between two updates
constexpr double kPoorSigma_m = 0.1;              // halves the quality
constexpr int kDegradedQuality = 25;
constexpr std::uint8_t kLocalNed = 1, kBodyFrd = 12, kLocalFrd = 20;
constexpr std::uint8_t kNotAnAutopilot = 8, kActive = 4, kStandby = 3, kCritical = 5;
constexpr std::uint8_t kError = 3, kWarning = 4, kInfo = 6;

Covariance21 upper_triangle(const Matrix6d& m) {
  Covariance21 out{};
  std::size_t at = 0;
  for (int i = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j) out[at++] = static_cast<float>(m(i, j));
  return out;
}

std::int8_t quality_of(const Update& update) {
  if (update.health != Health::tracking) return kDegradedQuality;
  const double sigma = std::sqrt(update.covariance.topLeftCorner<3, 3>().trace());
  return static_cast<std::int8_t>(std::lround(100 - 50 * std::min(1.0, sigma / kPoorSigma_m)));
}

bool valid(Health health) { return health == Health::tracking || health == Health::degraded; }

void set(float& x, float& y, float& z, const Eigen::Vector3d& v) {
  x = static_cast<float>(v.x()), y = static_cast<float>(v.y()), z = static_cast<float>(v.z());
}

}  // namespace

void ClockOffset::add(TimeNs sent, TimeNs received, TimeNs theirs) {
  const TimeNs round_trip = received - sent;
  if (round_trip < 0 || (count_ >= kFirstReplies && round_trip > kLongestRoundTrip)) return;
  if (++count_ % kMinimumReplies == 0) round_trip_ = std::numeric_limits<TimeNs>::max();
  if (round_trip > round_trip_) return;
  round_trip_ = round_trip;
  offset_ = theirs - (sent + round_trip / 2);
}

Reporter::Reporter(const MavlinkConfig& config, const VehicleFrames& frames, Send send)
    : config_(config), frames_(frames), send_(std::move(send)) {}

template <class Message>
void Reporter::send(const Message& message) {
  const int system = config_.system_id > 0 ? config_.system_id : vehicle_.value_or(1);
  send_(encode(message, sequence_++, static_cast<std::uint8_t>(system),
               static_cast<std::uint8_t>(config_.component_id))
            .bytes());
}

std::uint64_t Reporter::stamp_usec(TimeNs monotonic) const {
  const TimeNs t = config_.vehicle_time && clock_.known() ? monotonic + clock_.offset_ns() : monotonic;
  return static_cast<std::uint64_t>(std::max<TimeNs>(t, 0) / kNsPerUs);
}

void Reporter::say(std::uint8_t severity, const std::string& words) {
  Statustext message;
  message.severity = severity;
  const std::string line = "evpose: " + words;
  const std::size_t most = message.text.size();
  if (line.size() > most && ++text_id_ == 0) ++text_id_;
  if (line.size() > most) message.id = text_id_;  // 0: the text is whole
  // A chunk that is not full ends the text; it may be empty.
  for (std::size_t at = 0; at == 0 || (message.id != 0 && at <= line.size());
       at += most, ++message.chunk_seq) {
    message.text.fill('\0');
    std::copy_n(line.begin() + static_cast<std::ptrdiff_t>(at), std::min(line.size() - at, most),
                message.text.begin());
    send(message);
  }
}

void Reporter::say(const Update& u) {
  const std::uint8_t severity = u.health == Health::lost ? kError : valid(u.health) ? kInfo : kWarning;
  say(u.health == Health::degraded ? kWarning : severity,
      std::string(to_string(u.health)) + (u.reason.empty() ? "" : ": " + u.reason));
}

bool Reporter::jumped(const Update& u) const {
  if (!last_) return false;
  const double dt = to_seconds(u.t - last_->t);
  const Pose expected{last_->T_map_body.q * so3::exp(dt * last_->angular_rate),
                      last_->T_map_body.p + dt * last_->velocity};
  const Vector6d difference = u.T_map_body.minus(expected);
  return difference.head<3>().norm() > kJump_m || difference.tail<3>().norm() > kJump_rad;
}

void Reporter::add(const Update& update, TimeNs data_to_monotonic_ns) {
  data_to_monotonic_ = data_to_monotonic_ns;
  const bool was_valid = valid(health_);
  if (update.health != health_ || !update.reason.empty()) say(update);
  health_ = update.health;
  if (!valid(health_)) {
    if (was_valid) send_failed();
    return;
  }
  if (reset_pending_ || jumped(update)) ++reset_counter_;
  reset_pending_ = false;
  last_ = update;
  const TimeNs period = from_seconds(1 / config_.rate_hz);
  const bool due = update.t + period / kEarly >= next_pose_,
             target = config_.landing_target && update.t >= next_target_;
  if (!due && !target) return;
  const NedState state = to_ned(update, frames_);
  const std::uint64_t time_usec = stamp_usec(update.t + data_to_monotonic_);
  if (target) {
    next_target_ = update.t + kTarget;
    send_landing_target(state, time_usec);
  }
  if (!due) return;
  // On a grid of its own, so that 50 of 300 are every sixth.
  if (next_pose_ < update.t - 4 * period) next_pose_ = update.t;
  next_pose_ += period;
  send_pose(state, time_usec, quality_of(update));
}

void Reporter::send_pose(const NedState& s, std::uint64_t time_usec, std::int8_t quality) {
  if (last_q_.dot(s.q_ned_frd) < 0)
    last_q_ = Eigen::Quaterniond(-s.q_ned_frd.coeffs());
  else
    last_q_ = s.q_ned_frd;
  const bool failed = quality < 0;
  Covariance21 covariance = upper_triangle(s.covariance);
  if (failed) covariance[0] = kUnknown;
  if (config_.odometry) {
    Odometry m;
    m.time_usec = time_usec;
    set(m.x, m.y, m.z, s.position);
    const Eigen::Quaternionf q = last_q_.cast<float>();
    m.q = {q.w(), q.x(), q.y(), q.z()};
    set(m.vx, m.vy, m.vz, s.velocity_frd);
    set(m.rollspeed, m.pitchspeed, m.yawspeed, s.rates_frd);
    m.pose_covariance = covariance;
    Matrix6d twist = Matrix6d::Zero();
    twist.topLeftCorner<3, 3>() = s.velocity_covariance_frd;
    m.velocity_covariance = upper_triangle(twist);
    // The rates are the gyroscope's less its bias: their error is not estimated.
    m.velocity_covariance[15] = m.velocity_covariance[18] = m.velocity_covariance[20] = kUnknown;
    if (failed) m.velocity_covariance[0] = kUnknown;
    m.frame_id = config_.ned_frame ? kLocalNed : kLocalFrd;
    m.child_frame_id = kBodyFrd;
    m.reset_counter = reset_counter_;
    m.quality = quality;
    send(m);
  }
  if (failed) return;  // the others cannot say that they failed: they fall silent
  if (config_.position) {
    VisionPositionEstimate m;
    m.usec = time_usec;
    set(m.x, m.y, m.z, s.position);
    set(m.roll, m.pitch, m.yaw, euler_of(s.q_ned_frd));
    m.covariance = covariance;
    m.reset_counter = reset_counter_;
    send(m);
  }
  if (config_.speed) {
    VisionSpeedEstimate m;
    m.usec = time_usec;
    set(m.x, m.y, m.z, s.velocity_ned);
    for (int i = 0; i < 9; ++i)
      m.covariance[static_cast<std::size_t>(i)] = static_cast<float>(s.velocity_covariance_ned(i / 3, i % 3));
    m.reset_counter = reset_counter_;
    send(m);
  }
}

void Reporter::send_failed() {
  if (!last_) return;
  const NedState state = to_ned(*last_, frames_);
  for (int i = 0; i < kFailedPoses; ++i) send_pose(state, stamp_usec(last_->t + data_to_monotonic_), -1);
  last_.reset();
  reset_pending_ = true;  // whatever comes back may be somewhere else
}

void Reporter::send_landing_target(const NedState& s, std::uint64_t time_usec) {
  const Eigen::Vector3d pad_ned =
      frames_.T_ned_map * Eigen::Vector3d(config_.pad_x_m, config_.pad_y_m, config_.pad_z_m);
  const Eigen::Vector3d pad = s.q_ned_frd.conjugate() * (pad_ned - s.position);
  LandingTarget m;
  m.time_usec = time_usec;
  set(m.x, m.y, m.z, pad);
  m.distance = static_cast<float>(std::max(pad.norm(), 1e-3));  // 0 would be ignored
  // As a camera that looks down, its picture's top ahead, would see it.
  m.angle_x = static_cast<float>(std::atan2(pad.y(), pad.z()));
  m.angle_y = static_cast<float>(std::atan2(-pad.x(), pad.z()));
  m.frame = kBodyFrd;
  m.position_valid = 1;
  send(m);
}

void Reporter::restarted(const std::string& reason) {
  if (valid(health_)) send_failed();
  health_ = Health::waiting;
  last_.reset();
  reset_pending_ = true;
  next_pose_ = next_target_ = std::numeric_limits<TimeNs>::min();
  say(kWarning, "restarted: " + reason);
}

void Reporter::stalled(const std::string& reason) {
  if (valid(health_)) send_failed();
  health_ = Health::waiting;
  say(kError, reason);
}

void Reporter::ambiguous(const std::string& poses) {
  say(kWarning, std::string(to_string(Health::ambiguous)) + ": " + poses);
}

void Reporter::tick(TimeNs now_ns) {
  if (now_ns >= next_heartbeat_) {
    next_heartbeat_ = now_ns + kHeartbeat;
    Heartbeat m;
    m.system_status = valid(health_) ? kActive : health_ == Health::lost ? kCritical : kStandby;
    send(m);
  }
  if (now_ns >= next_timesync_) {
    next_timesync_ = now_ns + kTimesync;
    timesync_sent_ = now_ns;
    Timesync m;
    m.ts1 = now_ns;
    send(m);
  }
  if (config_.set_origin && !origin_confirmed_ && vehicle_ && now_ns >= next_origin_) {
    next_origin_ = now_ns + kOrigin;
    SetGpsGlobalOrigin m;
    m.latitude = static_cast<std::int32_t>(std::lround(1e7 * config_.origin_latitude_deg));
    m.longitude = static_cast<std::int32_t>(std::lround(1e7 * config_.origin_longitude_deg));
    m.altitude = static_cast<std::int32_t>(std::lround(1e3 * config_.origin_altitude_m));
    m.target_system = *vehicle_;
    m.time_usec = stamp_usec(now_ns);
    send(m);
  }
}

void Reporter::receive(Bytes bytes, TimeNs now_ns) {
  parser_.parse(bytes, [&](const Frame& frame) { handle(frame, now_ns); });
}

void Reporter::handle(const Frame& frame, TimeNs now_ns) {
  if (const auto m = decode<Heartbeat>(frame)) {
    if (!vehicle_ && m->autopilot != kNotAnAutopilot && frame.component == 1) vehicle_ = frame.system;
  } else if (const auto sync = decode<Timesync>(frame)) {
    if (sync->tc1 != 0) {
      if (sync->ts1 == timesync_sent_) clock_.add(timesync_sent_, now_ns, sync->tc1);
      return;
    }
    Timesync reply;
    reply.tc1 = now_ns;
    reply.ts1 = sync->ts1;
    reply.target_system = frame.system;
    reply.target_component = frame.component;
    send(reply);
  } else if (const auto origin = decode<GpsGlobalOrigin>(frame)) {
    origin_confirmed_ = true;
  } else if (const auto place = decode<GlobalPositionInt>(frame)) {
    const bool others = vehicle_ && frame.system != *vehicle_;
    if (others || (config_.origin_latitude_deg == 0 && config_.origin_longitude_deg == 0)) return;
    place_ = place_of(*place);
    place_heard_ = now_ns;
  }
}

Reporter::VehiclePlace Reporter::place_of(const GlobalPositionInt& m) const {
  const Eigen::Vector3d llh(1e-7 * m.lat, 1e-7 * m.lon, 1e-3 * m.alt);
  const Eigen::Vector3d origin(config_.origin_latitude_deg, config_.origin_longitude_deg,
                               config_.origin_altitude_m);
  constexpr std::uint16_t kNoHeading = 65535;
  VehiclePlace out;
  out.has_heading = m.hdg != kNoHeading;
  const double heading_rad = out.has_heading ? 0.01 * m.hdg * M_PI / 180 : 0;
  // Forward-left-up of a level vehicle with this heading.
  const Pose T_ned_vehicle{so3::exp({0, 0, heading_rad}) * so3::exp({M_PI, 0, 0}), ned_from_llh(llh, origin)};
  out.T_map_body = frames_.T_ned_map.inverse() * T_ned_vehicle * frames_.T_body_vehicle.inverse();
  return out;
}

std::optional<Reporter::VehiclePlace> Reporter::vehicle_place(TimeNs now_ns) const {
  return place_ && now_ns - place_heard_ < kPlaceLasts ? place_ : std::nullopt;
}

}  // namespace mavlink
}  // namespace evpose
