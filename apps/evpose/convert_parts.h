// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "evpose/io/events/event_reader.h"
#include "evpose/io/events/event_writer.h"
#include "evpose/io/files/new_folder.h"
#include "evpose/io/recording/recording.h"

namespace evpose {

struct ConvertRequest {
  std::string input, output;
  std::optional<double> start_s, end_s, duration_s;  ///< from the first stamp of the input on
  double offset_s = 0;                               ///< added to all stamps
  std::vector<int> size;    ///< width, height; empty: the file's or the calibration's
  std::vector<int> region;  ///< x0 y0 x1 y1, the last two excluded; empty: all
  std::string polarity;     ///< "on", "off" or "" for both
  std::string topic, input_format, output_format;
  std::string calibration;  ///< file
  bool undistort = false;   ///< moves events to where a lens without distortion had put them
  std::string pose_of;      ///< of the input trajectory: "", "camera" or "marker"; becomes the IMU's
};

/// What a conversion did, for one line at its end.
struct ConvertCounts {
  std::int64_t read = 0, written = 0;
  std::int64_t cropped = 0;           ///< outside of the region or of the other polarity
  std::int64_t undistorted_away = 0;  ///< fell out of the image
};

/// Pixels of events moved by a table: to a lens without distortion, with the same focal lengths and centre,
/// rounded to the nearest pixel.
class UndistortTable {
 public:
  UndistortTable(const Camera& camera, const CameraIntrinsics& c);
  /// False where the pixel falls out of the image.
  bool move(Event& event) const;

 private:
  ImageSize size_;
  std::vector<std::array<std::int32_t, 2>> to_;  ///< -1: out of the image
};

/// Takes region, polarity and lens of the request to packets.
class EventFilter {
 public:
  /// Errors: a region that is none, a calibration that cannot be read.
  static Expected<EventFilter> make(const ConvertRequest& request, ImageSize size);
  void apply(EventPacket& packet, ConvertCounts& counts) const;

 private:
  std::array<int, 4> region_{0, 0, 65536, 32768};
  int polarity_ = -1;  ///< -1: both
  std::optional<UndistortTable> table_;
};

/// The crop of a request on the clock of a stream whose first stamp is known, the offset not yet added.
struct Crop {
  std::optional<TimeNs> begin, end;
  bool holds(TimeNs t) const { return (!begin || t >= *begin) && (!end || t < *end); }
};
Crop crop_of(const ConvertRequest& request, TimeNs first);

/// Rows of anything with a time, in place.
template <class Timed>
void shift_and_crop(std::vector<Timed>& rows, const Crop& crop, TimeNs offset) {
  std::erase_if(rows, [&](const Timed& row) { return !crop.holds(row.t); });
  for (Timed& row : rows) row.t += offset;
}

Status read_all(ImuReader reader, std::vector<ImuSample>& out);

/// Writes the events that pass the filter and ends the file; nullopt when interrupted. An Error where none is
/// left.
Expected<std::optional<ConvertCounts>> write_events(const ConvertRequest& request, EventReader& reader,
                                                    const EventFilter& filter, EventWriter& writer);

/// The recording's frames, or those between the events of the input where these have the camera's size, into
/// frames/ of a recording folder; how many.
Expected<std::size_t> write_frames(const NewFolder& folder, const ConvertRequest& request,
                                   const std::optional<Recording>& recording, ImageSize size,
                                   const Crop& crop);

// The kinds of conversion; each gives the exit status or an error.
Expected<int> convert_events(const ConvertRequest& request);
Expected<int> convert_to_recording(const ConvertRequest& request);
/// Frames, IMU and ground truth as EuRoC lays them out, with settings for ORB-SLAM3.
Expected<int> convert_to_euroc(const ConvertRequest& request);
Expected<int> convert_to_bag(const ConvertRequest& request);
Expected<int> convert_trajectory(const ConvertRequest& request);
Expected<int> convert_imu(const ConvertRequest& request);
Expected<int> convert_calibration(const ConvertRequest& request);

}  // namespace evpose
