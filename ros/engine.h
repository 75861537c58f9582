// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

// The border between ROS's headers, which are C++17, and evpose's, which are C++20: plain types alone.
namespace evpose_ros {

/// What is published of an update. Frames as in REP 103 and 105: map -> base_link, forward-left-up.
struct PoseMessage {
  std::int64_t t_ns = 0;
  std::array<double, 3> position{};           ///< m
  std::array<double, 4> orientation{};        ///< x y z w
  std::array<double, 3> velocity{}, rates{};  ///< in base_link, m/s and rad/s
  std::array<double, 36> covariance{};        ///< (position, rotation about the map's axes), by rows
  std::array<double, 9> velocity_covariance{};
};

struct Status {
  std::string health = "waiting", reason;
  std::uint64_t updates = 0, restarts = 0, events = 0, events_shed = 0;
};

struct Parameters {
  std::string map, calibration, init, imu_model, occluders;
  std::vector<std::string> settings;  ///< key=value of evpose track --dump-config
};

struct Callbacks {
  std::function<void(const PoseMessage&)> pose;        ///< of a state that is tracking or degraded
  std::function<void(const std::string& words)> notice;
};

/// A tracker on a live stream. add_...() from one thread, the rest from another.
class Engine {
 public:
  /// Null: `error` says why in one line.
  static std::unique_ptr<Engine> create(const Parameters& parameters, const Callbacks& callbacks, std::string& error);
  virtual ~Engine() = default;

  /// A serialised message of events. What is wrong with it; empty: nothing.
  virtual std::string add_events(const std::string& type, const std::string& md5, const std::byte* bytes,
                                 std::size_t size) = 0;
  virtual void add_imu(std::int64_t t_ns, const std::array<double, 3>& gyro, const std::array<double, 3>& accel) = 0;
  /// Tracks what has arrived; waits a few milliseconds if nothing has.
  virtual void work() = 0;
  virtual void reset() = 0;
  virtual Status status() const = 0;
  virtual std::vector<std::array<float, 3>> map_points() const = 0;
};

}  // namespace evpose_ros
