// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "evpose/io/events/event_packer.h"
#include "evpose/io/hdf5/hdf5_file.h"

namespace evpose {

/// Events of an HDF5 file by their number, whatever the file's layout.
class EventRows {
 public:
  virtual ~EventRows() = default;

  virtual std::uint64_t count() const = 0;
  virtual ImageSize size() const = 0;  ///< 0x0: the file does not say
  /// Stamps of rows [first, first + count) in microseconds, offset added; beyond twice kLargestTimeUs what
  /// has none.
  virtual Status stamps(std::uint64_t first, std::uint64_t count, std::vector<std::int64_t>& t_us) = 0;
  /// Columns, rows and polarities.
  virtual Status pixels(std::uint64_t first, std::uint64_t count, RawEvents& out) = 0;
  /// Rows [first, second] between which the first event at or after the time lies, as an index in the file
  /// tells; all if there is none.
  virtual std::pair<std::uint64_t, std::uint64_t> near(std::int64_t /*t_us*/) { return {0, count()}; }
};

/// Metavision: the table /CD/events, whose stamps are microseconds.
Expected<std::unique_ptr<EventRows>> open_metavision_rows(const Hdf5File& file);

/// MVSEC: /davis/left/events, rows of x, y, seconds and polarity. `camera` is "left", "right" or empty (the
/// first there is).
Expected<std::unique_ptr<EventRows>> open_mvsec_rows(const Hdf5File& file, const std::string& camera);
/// The dataset of that camera; empty if there is none.
std::string mvsec_events(const Hdf5File& file, const std::string& camera);

}  // namespace evpose
