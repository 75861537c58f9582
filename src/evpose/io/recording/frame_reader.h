// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "evpose/camera/frame.h"
#include "evpose/core/error.h"

namespace evpose {

struct FrameReadOptions {
  /// What the stamps are of; the frame's time becomes the middle of the exposure.
  enum class Stamp { start, middle, end };
  Stamp stamp = Stamp::middle;
  TimeNs exposure = 0;               ///< of frames whose row states none
  TimeNs offset_ns = 0;              ///< added to each stamp
  std::optional<TimeNs> t_start_ns;  ///< frames before are left out; on the clock after the offset
  std::optional<TimeNs> t_end_ns;    ///< frames at or after are left out
  ImageSize size;                    ///< that pictures must have
};

/// Pictures as the data set EuRoC keeps them, and our recordings: a CSV of rows `t_ns,file[,exposure_ns]`,
/// the files beside it or in the folder `data` there, PNG.
class FrameReader {
 public:
  /// Reads the list. Errors: file and line of what is no such row, of stamps that do not advance, of a
  /// picture that is not there; no rows.
  static Expected<FrameReader> open(const std::string& csv, const FrameReadOptions& options);

  /// The next frame; false at the end. Errors: the picture cannot be read or has another size.
  Expected<bool> next(Frame& frame);

  /// Of the frames that next() gives, in order of time.
  struct Row {
    TimeNs t;  ///< middle of the exposure
    TimeNs exposure;
    std::string path;
  };
  const std::vector<Row>& rows() const { return rows_; }

 private:
  FrameReader(std::vector<Row> rows, ImageSize size) : rows_(std::move(rows)), size_(size) {}
  std::vector<Row> rows_;
  ImageSize size_;
  std::size_t next_ = 0;
};

}  // namespace evpose
