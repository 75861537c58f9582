// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "evpose/core/time.h"
#include "evpose/event/event.h"
#include "evpose/imu/imu.h"

namespace evpose {

class ConfigTable;

/// What a source has to say, in its order.
struct StreamItem {
  enum class Kind { events, imu, notice, restart, end };
  Kind kind = Kind::notice;
  EventPacket events;
  std::vector<ImuSample> imu;
  std::string words;  ///< of a notice; of a restart: why
  /// The machine's monotone clock less the data's, where the source knows it.
  std::optional<TimeNs> data_to_monotonic;
  TimeNs arrived_ns = 0;  ///< monotone clock; set by the queue
  double share = 1;       ///< of events; set by the queue: it keeps up with no more of the contours
  int stride = 1;         ///< likewise: with no more than every n-th update
};

struct QueueConfig {
  bool shed = true;            ///< false: the source waits instead, and nothing is lost
  double thin_after_ms = 1;    ///< if all events of a moment waited longer, less of the contours is looked at
  double drop_after_ms = 200;  ///< events that waited longer are left out
  int most_mev = 4;            ///< million events waiting at most
};
void describe(ConfigTable& table, QueueConfig& config);

/// What share of the contours can be looked at by a tracker whose packets waited so long. Those that wait
/// while an update is made tell nothing: the least wait of a moment does.
class ShareByWait {
 public:
  explicit ShareByWait(double late_ms) : late_ms_(late_ms) {}

  /// A packet that arrived then waited so long. The share from now on, kLeast to 1.
  double add(TimeNs arrived_ns, double waited_ms);
  static constexpr double kLeast = 0.05;

 private:
  double late_ms_, share_ = 1, least_ms_ = 0;
  TimeNs moment_began_ = 0;
  int packets_ = 0;  ///< of the moment
};

/// Between the thread of a source and that of the tracker. Under overload events make way, never IMU samples,
/// so that the newest pose stays timely: first less of the contours is looked at; where even that does not
/// help, every k-th update is made and old packets are left out.
class StreamQueue {
 public:
  explicit StreamQueue(const QueueConfig& config) : config_(config), share_(config.thin_after_ms) {}

  /// Takes an item. Without shedding it waits for room. False: the queue is closed.
  bool push(StreamItem item);
  /// The next item; without its events if it has waited too long. False: none came within the time.
  bool pop(StreamItem& item, TimeNs timeout_ns);
  /// Wakes a source that waits; push() returns false from then on.
  void close();
  bool closed() const;

  struct Counts {
    std::uint64_t events_in = 0, events_shed = 0, imu_in = 0, imu_shed = 0;
    std::uint64_t most_waiting = 0;  ///< events
  };
  Counts counts() const;

 private:
  void make_room();
  void relieve(StreamItem& item, TimeNs waited_ns);

  QueueConfig config_;
  mutable std::mutex mutex_;
  std::condition_variable filled_, emptied_;
  ShareByWait share_;
  std::deque<StreamItem> items_;
  std::size_t waiting_events_ = 0, waiting_imu_ = 0;
  bool closed_ = false;
  Counts counts_;
};

/// Something that fills the queue from a thread of its own until it ends or the queue is closed.
class Source {
 public:
  virtual ~Source() = default;
  virtual void run(StreamQueue& queue) = 0;
};

}  // namespace evpose
