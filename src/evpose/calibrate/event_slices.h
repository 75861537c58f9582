// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/event/event_preprocessor.h"
#include "evpose/io/events/event_reader.h"
#include "evpose/tracker/event_slice.h"

namespace evpose {

/// Slices of events of a recording, one after the other, each long enough to show contours.
class EventSlices {
 public:
  /// A reference to the reader is kept.
  EventSlices(EventReader& reader, ImageSize size)
      : reader_(reader), preprocessor_(size.width, size.height, {}), slice_(size.width) {}

  /// The next slice that begins at `from` or later; false: there is none.
  Expected<bool> next(TimeNs from);
  std::span<const FilteredEvent> events() const { return slice_.events(); }
  /// So few events that nothing moves.
  bool sparse() const { return slice_.sparse(); }
  TimeNs middle() const { return middle_; }  ///< mean time of its events
  TimeNs end() const { return end_; }

 private:
  EventReader& reader_;
  EventPreprocessor preprocessor_;
  EventSlice slice_;
  TimeNs middle_ = 0, end_ = 0;
};

}  // namespace evpose
