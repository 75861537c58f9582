// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/camera/camera.h"
#include "evpose/io/events/event_writer.h"
#include "evpose/io/files/atomic_file.h"

namespace evpose {

/// Prophesee RAW in EVT3, as its cameras write it: vectors of events where they are shorter. It carries times
/// from 0 to 2^34 us (17,179 s), and images up to 2048 x 2048; other times are an error.
class EventWriterRaw : public EventWriter {
 public:
  static Expected<EventWriterRaw> create(const std::string& path, ImageSize size);

  Status append(const EventPacket& packet) override;
  Status finish() override;

 private:
  EventWriterRaw(AtomicFile file, ImageSize size, std::string path);

  void put(unsigned kind, unsigned value);
  void put_time(std::int64_t t_us);
  /// How many events from the i-th on a vector can hold, all at one time, row and polarity.
  static std::size_t run_length(const EventPacket& packet, std::size_t i);
  void put_vector(const EventPacket& packet, std::size_t begin, std::size_t end);

  AtomicFile file_;
  ImageSize size_;
  std::string path_, buffer_;
  std::int64_t last_us_ = -1;
  std::int64_t high_ = -1;  ///< last sent, wraps not taken off
  int y_ = -1;
};

}  // namespace evpose
