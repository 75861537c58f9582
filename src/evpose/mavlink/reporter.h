// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>

#include "evpose/core/time.h"
#include "evpose/mavlink/codec.h"
#include "evpose/mavlink/frames.h"
#include "evpose/mavlink/messages.h"

namespace evpose {

class ConfigTable;

struct MavlinkConfig {
  double rate_hz = 50;     ///< of poses; at most that of the updates
  bool odometry = true;    ///< ODOMETRY
  bool position = false;   ///< VISION_POSITION_ESTIMATE
  bool speed = false;      ///< VISION_SPEED_ESTIMATE
  bool ned_frame = false;  ///< frame_id of ODOMETRY LOCAL_NED instead of LOCAL_FRD
  int system_id = 0;       ///< 0: the vehicle's, once heard; 1 until then
  int component_id = 197;
  bool vehicle_time = true;  ///< stamps on the vehicle's clock, once TIMESYNC has answered
  bool set_origin = false;   ///< SET_GPS_GLOBAL_ORIGIN until it is confirmed
  double origin_latitude_deg = 0, origin_longitude_deg = 0, origin_altitude_m = 0;
  bool landing_target = false;                   ///< LANDING_TARGET
  double pad_x_m = 0, pad_y_m = 0, pad_z_m = 0;  ///< in the map
};
void describe(ConfigTable& table, MavlinkConfig& config);

namespace mavlink {

/// The offset of the other side's clock, from TIMESYNC: that of the shortest round trip of the last ones.
class ClockOffset {
 public:
  /// Of a reply; ignored when the round trip is not plausible.
  void add(TimeNs sent, TimeNs received, TimeNs theirs);
  bool known() const { return count_ > 0; }
  TimeNs offset_ns() const { return offset_; }  ///< theirs - ours
  TimeNs round_trip_ns() const { return round_trip_; }

 private:
  int count_ = 0;
  TimeNs offset_ = 0, round_trip_ = std::numeric_limits<TimeNs>::max();
};

/// What an autopilot is told of the tracker, and what it answers. `now_ns` is the machine's monotone clock.
class Reporter {
 public:
  using Send = std::function<void(Bytes frame)>;
  Reporter(const MavlinkConfig& config, const VehicleFrames& frames, Send send);

  /// An update whose data time is at `data_to_monotonic_ns` + its time on the machine's clock. Sends poses
  /// that are due; none of a state that is not tracking or degraded, but for three of quality -1 when it is
  /// lost.
  void add(const Update& update, TimeNs data_to_monotonic_ns);
  /// The estimate starts anew somewhere else.
  void restarted(const std::string& reason);
  /// The stream is silent: as if lost, until the next update.
  void stalled(const std::string& reason);
  /// A search beside has several poses that explain the events alike; none of them is sent.
  void ambiguous(const std::string& poses);
  void receive(Bytes bytes, TimeNs now_ns);
  /// Heartbeat, clock and origin: call at least ten times a second.
  void tick(TimeNs now_ns);

  /// Level, where the autopilot's GPS and compass have the body, if it said so within kPlaceLasts and the
  /// map's origin is known. Without a heading any is possible.
  struct VehiclePlace {
    Pose T_map_body;
    bool has_heading = false;
  };
  std::optional<VehiclePlace> vehicle_place(TimeNs now_ns) const;
  static constexpr TimeNs kPlaceLasts = 2 * kNsPerS;

  std::uint8_t reset_counter() const { return reset_counter_; }
  const ClockOffset& clock() const { return clock_; }
  std::optional<std::uint8_t> vehicle() const { return vehicle_; }
  const Parser::Counts& received() const { return parser_.counts(); }

 private:
  template <class Message>
  void send(const Message& message);
  void say(const Update& update);
  void say(std::uint8_t severity, const std::string& words);
  bool jumped(const Update& update) const;
  void send_pose(const NedState& state, std::uint64_t time_usec, std::int8_t quality);
  void send_failed();
  void send_landing_target(const NedState& state, std::uint64_t time_usec);
  void handle(const Frame& frame, TimeNs now_ns);
  VehiclePlace place_of(const GlobalPositionInt& m) const;
  std::uint64_t stamp_usec(TimeNs monotonic) const;

  MavlinkConfig config_;
  VehicleFrames frames_;
  Send send_;
  Parser parser_;
  ClockOffset clock_;
  std::optional<std::uint8_t> vehicle_;
  std::optional<VehiclePlace> place_;
  TimeNs place_heard_ = 0;
  std::optional<Update> last_;  ///< valid one
  Eigen::Quaterniond last_q_ = Eigen::Quaterniond::Identity();
  TimeNs next_pose_ = std::numeric_limits<TimeNs>::min(), next_target_ = next_pose_;
  TimeNs data_to_monotonic_ = 0;
  TimeNs next_heartbeat_ = 0, next_timesync_ = 0, next_origin_ = 0, timesync_sent_ = 0;
  std::uint8_t sequence_ = 0, reset_counter_ = 0;
  std::uint16_t text_id_ = 0;  ///< of the last text in chunks
  bool reset_pending_ = false, origin_confirmed_ = false;
  Health health_ = Health::waiting;
};

}  // namespace mavlink
}  // namespace evpose
