// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "evpose/io/events/event_reader.h"
#include "evpose/io/events/event_writer.h"
#include "evpose/io/events/sensor_streams.h"

namespace evpose {

/// HDF5 with 1-D x, y, t, p of equal length in /events (DSEC, TUM-VIE, VECtor, ours), or in the first group
/// of the root that has all four. t: any number type, microseconds unless the options say otherwise
/// (floating-point stamps need a stated unit); /t_offset is added. p: 0/1 or -1/+1. Also Metavision's table
/// /CD/events, and MVSEC's /davis/left/events, of which `options.topic` picks the camera (left, right). With
/// a start in the options, reading begins there; /ms_to_idx tells where that is.
Expected<std::unique_ptr<EventReader>> open_events_h5(const std::string& path,
                                                      const EventReadOptions& options);

Expected<std::vector<StreamInfo>> list_h5_streams(const std::string& path);
/// Triggers of Metavision files; IMU of MVSEC files.
Status read_h5_sensors(const std::string& path, const SensorSink& sink);

/// Writes events.h5: i64 us, u16, u16, u8, chunks of 65,536, shuffle + deflate.
class EventWriterH5 : public EventWriter {
 public:
  /// `sensor` is free text.
  static Expected<EventWriterH5> create(const std::string& path, ImageSize size, const std::string& sensor);
  EventWriterH5(EventWriterH5&& other) noexcept;
  EventWriterH5& operator=(EventWriterH5&& other) noexcept;
  ~EventWriterH5() override;

  Status append(const EventPacket& packet) override;
  Status finish() override;

 private:
  struct Impl;
  explicit EventWriterH5(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace evpose
