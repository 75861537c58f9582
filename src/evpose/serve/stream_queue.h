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
  int stride = 1;         ///< of events; set by the queue: it keeps up with no more than every n-th update
};

struct QueueConfig {
  bool shed = true;            ///< false: the source waits instead, and nothing is lost
  double thin_after_ms = 20;   ///< events that waited longer are thinned, the more so the longer
  double drop_after_ms = 200;  ///< events that waited longer are left out
  int most_mev = 4;            ///< million events waiting at most
};
void describe(ConfigTable& table, QueueConfig& config);

/// Between the thread of a source and that of the tracker. Under overload it sheds events, never IMU samples,
/// so that the newest pose stays timely: every k-th event of a packet is kept, which is fair over the image,
/// and every k-th update is made.
class StreamQueue {
 public:
  explicit StreamQueue(const QueueConfig& config) : config_(config) {}

  /// Takes an item. Without shedding it waits for room. False: the queue is closed.
  bool push(StreamItem item);
  /// The next item, thinned if it has waited too long; false: none came within the time.
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
