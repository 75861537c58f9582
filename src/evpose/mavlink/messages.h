// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <limits>

namespace evpose::mavlink {

/// What the protocol says of a message: lengths of the payload without and with extensions.
struct MessageType {
  std::uint32_t id;
  std::uint8_t crc_extra, least, most;
  const char* name;
};

// Messages of common.xml, and EKF_STATUS_REPORT of ArduPilot's, with the members in the order of the wire
// (formats 8.2). `fields` hands all of them, in that order, to `f`: the codec's only description of a
// message. Units are the protocol's.

using Covariance21 = std::array<float, 21>;  ///< upper triangle by rows; [0] NaN: unknown
inline constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

struct Heartbeat {
  static constexpr MessageType kType{0, 50, 9, 9, "HEARTBEAT"};
  std::uint32_t custom_mode = 0;
  std::uint8_t type = 18, autopilot = 8, base_mode = 0, system_status = 0, mavlink_version = 3;
  static void fields(auto& m, auto&& f) {
    f(m.custom_mode, m.type, m.autopilot, m.base_mode, m.system_status, m.mavlink_version);
  }
};

struct SystemTime {
  static constexpr MessageType kType{2, 137, 12, 12, "SYSTEM_TIME"};
  std::uint64_t time_unix_usec = 0;
  std::uint32_t time_boot_ms = 0;
  static void fields(auto& m, auto&& f) { f(m.time_unix_usec, m.time_boot_ms); }
};

struct Attitude {
  static constexpr MessageType kType{30, 39, 28, 28, "ATTITUDE"};
  std::uint32_t time_boot_ms = 0;
  float roll = 0, pitch = 0, yaw = 0, rollspeed = 0, pitchspeed = 0, yawspeed = 0;
  static void fields(auto& m, auto&& f) {
    f(m.time_boot_ms, m.roll, m.pitch, m.yaw, m.rollspeed, m.pitchspeed, m.yawspeed);
  }
};

struct AttitudeQuaternion {
  static constexpr MessageType kType{31, 246, 32, 48, "ATTITUDE_QUATERNION"};
  std::uint32_t time_boot_ms = 0;
  float q1 = 1, q2 = 0, q3 = 0, q4 = 0, rollspeed = 0, pitchspeed = 0, yawspeed = 0;
  std::array<float, 4> repr_offset_q{};
  static void fields(auto& m, auto&& f) {
    f(m.time_boot_ms, m.q1, m.q2, m.q3, m.q4, m.rollspeed, m.pitchspeed, m.yawspeed, m.repr_offset_q);
  }
};

struct LocalPositionNed {
  static constexpr MessageType kType{32, 185, 28, 28, "LOCAL_POSITION_NED"};
  std::uint32_t time_boot_ms = 0;
  float x = 0, y = 0, z = 0, vx = 0, vy = 0, vz = 0;
  static void fields(auto& m, auto&& f) { f(m.time_boot_ms, m.x, m.y, m.z, m.vx, m.vy, m.vz); }
};

struct GlobalPositionInt {
  static constexpr MessageType kType{33, 104, 28, 28, "GLOBAL_POSITION_INT"};
  std::uint32_t time_boot_ms = 0;
  std::int32_t lat = 0, lon = 0, alt = 0, relative_alt = 0;
  std::int16_t vx = 0, vy = 0, vz = 0;
  std::uint16_t hdg = 65535;  ///< not known
  static void fields(auto& m, auto&& f) {
    f(m.time_boot_ms, m.lat, m.lon, m.alt, m.relative_alt, m.vx, m.vy, m.vz, m.hdg);
  }
};

struct SetGpsGlobalOrigin {
  static constexpr MessageType kType{48, 41, 13, 21, "SET_GPS_GLOBAL_ORIGIN"};
  std::int32_t latitude = 0, longitude = 0, altitude = 0;
  std::uint8_t target_system = 0;
  std::uint64_t time_usec = 0;
  static void fields(auto& m, auto&& f) {
    f(m.latitude, m.longitude, m.altitude, m.target_system, m.time_usec);
  }
};

struct GpsGlobalOrigin {
  static constexpr MessageType kType{49, 39, 12, 20, "GPS_GLOBAL_ORIGIN"};
  std::int32_t latitude = 0, longitude = 0, altitude = 0;
  std::uint64_t time_usec = 0;
  static void fields(auto& m, auto&& f) { f(m.latitude, m.longitude, m.altitude, m.time_usec); }
};

struct CommandLong {
  static constexpr MessageType kType{76, 152, 33, 33, "COMMAND_LONG"};
  std::array<float, 7> param{};
  std::uint16_t command = 0;
  std::uint8_t target_system = 0, target_component = 0, confirmation = 0;
  static void fields(auto& m, auto&& f) {
    f(m.param, m.command, m.target_system, m.target_component, m.confirmation);
  }
};

struct CommandAck {
  static constexpr MessageType kType{77, 143, 3, 10, "COMMAND_ACK"};
  std::uint16_t command = 0;
  std::uint8_t result = 0, progress = 0;
  std::int32_t result_param2 = 0;
  std::uint8_t target_system = 0, target_component = 0;
  static void fields(auto& m, auto&& f) {
    f(m.command, m.result, m.progress, m.result_param2, m.target_system, m.target_component);
  }
};

struct VisionPositionEstimate {
  static constexpr MessageType kType{102, 158, 32, 117, "VISION_POSITION_ESTIMATE"};
  std::uint64_t usec = 0;
  float x = 0, y = 0, z = 0, roll = 0, pitch = 0, yaw = 0;
  Covariance21 covariance{};
  std::uint8_t reset_counter = 0;
  static void fields(auto& m, auto&& f) {
    f(m.usec, m.x, m.y, m.z, m.roll, m.pitch, m.yaw, m.covariance, m.reset_counter);
  }
};

struct VisionSpeedEstimate {
  static constexpr MessageType kType{103, 208, 20, 57, "VISION_SPEED_ESTIMATE"};
  std::uint64_t usec = 0;
  float x = 0, y = 0, z = 0;
  std::array<float, 9> covariance{};
  std::uint8_t reset_counter = 0;
  static void fields(auto& m, auto&& f) { f(m.usec, m.x, m.y, m.z, m.covariance, m.reset_counter); }
};

struct HighresImu {
  static constexpr MessageType kType{105, 93, 62, 63, "HIGHRES_IMU"};
  std::uint64_t time_usec = 0;
  std::array<float, 3> acc{}, gyro{}, mag{};
  float abs_pressure = 0, diff_pressure = 0, pressure_alt = 0, temperature = 0;
  std::uint16_t fields_updated = 0;
  std::uint8_t id = 0;
  static void fields(auto& m, auto&& f) {
    f(m.time_usec, m.acc, m.gyro, m.mag, m.abs_pressure, m.diff_pressure, m.pressure_alt, m.temperature,
      m.fields_updated, m.id);
  }
};

struct Timesync {
  static constexpr MessageType kType{111, 34, 16, 18, "TIMESYNC"};
  std::int64_t tc1 = 0, ts1 = 0;
  std::uint8_t target_system = 0, target_component = 0;
  static void fields(auto& m, auto&& f) { f(m.tc1, m.ts1, m.target_system, m.target_component); }
};

struct AttPosMocap {
  static constexpr MessageType kType{138, 109, 36, 120, "ATT_POS_MOCAP"};
  std::uint64_t time_usec = 0;
  std::array<float, 4> q{1, 0, 0, 0};
  float x = 0, y = 0, z = 0;
  Covariance21 covariance{};
  static void fields(auto& m, auto&& f) { f(m.time_usec, m.q, m.x, m.y, m.z, m.covariance); }
};

struct LandingTarget {
  static constexpr MessageType kType{149, 200, 30, 60, "LANDING_TARGET"};
  std::uint64_t time_usec = 0;
  float angle_x = 0, angle_y = 0, distance = 0, size_x = 0, size_y = 0;
  std::uint8_t target_num = 0, frame = 12;
  float x = 0, y = 0, z = 0;
  std::array<float, 4> q{1, 0, 0, 0};
  std::uint8_t type = 3, position_valid = 0;
  static void fields(auto& m, auto&& f) {
    f(m.time_usec, m.angle_x, m.angle_y, m.distance, m.size_x, m.size_y, m.target_num, m.frame, m.x, m.y, m.z,
      m.q, m.type, m.position_valid);
  }
};

struct EkfStatusReport {
  static constexpr MessageType kType{193, 71, 22, 26, "EKF_STATUS_REPORT"};
  float velocity_variance = 0, pos_horiz_variance = 0, pos_vert_variance = 0, compass_variance = 0,
        terrain_alt_variance = 0;
  std::uint16_t flags = 0;
  float airspeed_variance = 0;
  static void fields(auto& m, auto&& f) {
    f(m.velocity_variance, m.pos_horiz_variance, m.pos_vert_variance, m.compass_variance,
      m.terrain_alt_variance, m.flags, m.airspeed_variance);
  }
};

struct EstimatorStatus {
  static constexpr MessageType kType{230, 163, 42, 42, "ESTIMATOR_STATUS"};
  std::uint64_t time_usec = 0;
  float vel_ratio = 0, pos_horiz_ratio = 0, pos_vert_ratio = 0, mag_ratio = 0, hagl_ratio = 0, tas_ratio = 0,
        pos_horiz_accuracy = 0, pos_vert_accuracy = 0;
  std::uint16_t flags = 0;
  static void fields(auto& m, auto&& f) {
    f(m.time_usec, m.vel_ratio, m.pos_horiz_ratio, m.pos_vert_ratio, m.mag_ratio, m.hagl_ratio, m.tas_ratio,
      m.pos_horiz_accuracy, m.pos_vert_accuracy, m.flags);
  }
};

struct Statustext {
  static constexpr MessageType kType{253, 83, 51, 54, "STATUSTEXT"};
  std::uint8_t severity = 6;
  std::array<char, 50> text{};
  std::uint16_t id = 0;
  std::uint8_t chunk_seq = 0;
  static void fields(auto& m, auto&& f) { f(m.severity, m.text, m.id, m.chunk_seq); }
};

struct Odometry {
  static constexpr MessageType kType{331, 91, 230, 233, "ODOMETRY"};
  std::uint64_t time_usec = 0;
  float x = 0, y = 0, z = 0;
  std::array<float, 4> q{1, 0, 0, 0};  ///< w x y z
  float vx = 0, vy = 0, vz = 0, rollspeed = 0, pitchspeed = 0, yawspeed = 0;
  Covariance21 pose_covariance{}, velocity_covariance{};
  std::uint8_t frame_id = 20, child_frame_id = 12, reset_counter = 0, estimator_type = 3;
  std::int8_t quality = 0;
  static void fields(auto& m, auto&& f) {
    f(m.time_usec, m.x, m.y, m.z, m.q, m.vx, m.vy, m.vz, m.rollspeed, m.pitchspeed, m.yawspeed,
      m.pose_covariance, m.velocity_covariance, m.frame_id, m.child_frame_id, m.reset_counter,
      m.estimator_type, m.quality);
  }
};

/// Hands one default message of each type to `f`.
void for_each_message(auto&& f) {
  f(Heartbeat{}), f(SystemTime{}), f(Attitude{}), f(AttitudeQuaternion{}), f(LocalPositionNed{}),
      f(GlobalPositionInt{}), f(SetGpsGlobalOrigin{}), f(GpsGlobalOrigin{}), f(CommandLong{}),
      f(CommandAck{}), f(VisionPositionEstimate{}), f(VisionSpeedEstimate{}), f(HighresImu{}), f(Timesync{}),
      f(AttPosMocap{}), f(LandingTarget{}), f(EkfStatusReport{}), f(EstimatorStatus{}), f(Statustext{}),
      f(Odometry{});
}

}  // namespace evpose::mavlink
