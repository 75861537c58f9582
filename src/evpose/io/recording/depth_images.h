// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/core/time.h"

namespace evpose {

/// One depth image of a folder.
struct DepthImageFile {
  TimeNs t = 0;
  std::string path;
};

/// The depth images of a folder in order of time, as `depth.txt` there lists them: rows `timestamp filename`
/// of seconds and a file below the folder, `#` comments (as the TUM RGB-D benchmark). Without that,
/// `timestamps.csv` of our recordings. Errors: neither list; file and line of what is no such row, of stamps
/// that do not advance, of an image that is not there; no rows.
Expected<std::vector<DepthImageFile>> list_depth_images(const std::string& folder);

}  // namespace evpose
