// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/sim/sensors/sim_event.h"

namespace evpose::sim {

struct ReadOutConfig;

/// Decides when and in which order the events of the pixels are read.
class EventArbiter {
 public:
  virtual ~EventArbiter() = default;
  /// As ReadOut::push, but for the timestamps: nanoseconds of the moment of reading.
  virtual void push(std::span<const SimEvent> events, TimeNs until, std::vector<SimEvent>& read) = 0;
  virtual void finish(std::vector<SimEvent>& read) = 0;
  std::int64_t lost() const { return lost_; }
  std::int64_t late() const { return late_; }

 protected:
  void deliver(SimEvent event, TimeNs t, std::vector<SimEvent>& read);
  std::int64_t lost_ = 0;

 private:
  std::int64_t late_ = 0;
};

/// By ReadOutConfig::kind, which is not `preset`.
std::unique_ptr<EventArbiter> make_arbiter(ImageSize size, const ReadOutConfig& config);

/// `t`, down to the whole microsecond.
TimeNs whole_us(TimeNs t);

/// Rows in which events wait.
class RowRequests {
 public:
  explicit RowRequests(std::size_t rows);
  void set(std::size_t row) { bits_[row / kWord] |= std::uint64_t{1} << (row % kWord); }
  void clear(std::size_t row) { bits_[row / kWord] &= ~(std::uint64_t{1} << (row % kWord)); }
  /// The first requesting row after `row`, around the end; it may be `row` itself. There must be one.
  std::size_t next(std::size_t row) const;

 private:
  static constexpr std::size_t kWord = 64;
  std::size_t rows_;
  std::vector<std::uint64_t> bits_;
};

/// Reads one event at a time. In a burst events queue in their rows. The arbiter visits the rows cyclically
/// downwards and reads the events that are queued in a row at its arrival.
class EventQueue : public EventArbiter {
 public:
  EventQueue(ImageSize size, double max_rate_mev_s, int capacity);
  void push(std::span<const SimEvent> events, TimeNs until, std::vector<SimEvent>& read) override;
  void finish(std::vector<SimEvent>& read) override;

 private:
  struct Row {
    std::vector<SimEvent> waiting;
    std::size_t read = 0;  ///< of these
  };
  TimeNs next_slot() const;
  void add(const SimEvent& event);
  void read_one(std::vector<SimEvent>& read);

  double slot_ns_ = 0;  ///< time per event; 0: no limit
  std::size_t capacity_;
  std::vector<Row> rows_;
  RowRequests requests_;
  std::size_t waiting_ = 0, row_ = 0, left_in_row_ = 0;
  TimeNs burst_start_ = 0;
  std::int64_t slots_used_ = 0;  ///< since then
};

/// Reads a row at a time: all its waiting events get the time at which the row is latched. A row takes a
/// fixed time and more for each 32 pixels among which there are events. Rows take turns downwards. A pixel
/// whose event waits makes no other.
class RowArbiter : public EventArbiter {
 public:
  /// `max_rate_mev_s`: of rows full of events.
  RowArbiter(ImageSize size, double max_rate_mev_s, double row_ns);
  void push(std::span<const SimEvent> events, TimeNs until, std::vector<SimEvent>& read) override;
  void finish(std::vector<SimEvent>& read) override;

 private:
  void add(const SimEvent& event);
  void read_row(std::vector<SimEvent>& read);

  static constexpr int kWordPixels = 32;
  std::size_t width_;
  double row_ns_, word_ns_;
  std::vector<std::vector<SimEvent>> rows_;
  std::vector<bool> waits_;  ///< of each pixel
  RowRequests requests_;
  std::size_t waiting_ = 0, row_ = 0;
  double next_ns_ = 0;  ///< the next row is latched
};

/// Samples the pixels in frames, all at once or column by column; a sample's events share its time. A pixel
/// shows one event a frame. A frame with many events takes longer.
class FrameScan : public EventArbiter {
 public:
  FrameScan(ImageSize size, double max_rate_mev_s, double scan_hz, bool hold);
  void push(std::span<const SimEvent> events, TimeNs until, std::vector<SimEvent>& read) override;
  void finish(std::vector<SimEvent>& read) override;

 private:
  void sample(std::vector<SimEvent>& read);

  std::size_t width_;
  double event_ns_, step_ns_;                  ///< per event, at least; per sample
  std::vector<std::vector<SimEvent>> groups_;  ///< of columns that are sampled together
  std::vector<bool> waits_;                    ///< of each pixel
  std::size_t waiting_ = 0, group_ = 0;
  double next_ns_;  ///< time of the next sample
};

}  // namespace evpose::sim
