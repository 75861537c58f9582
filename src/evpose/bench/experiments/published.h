// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/error.h"

namespace evpose::experiments {

/// Folders with published sequences as downloaded, a folder for each.
struct PublishedRequest {
  std::string vector, tum_vie;      ///< empty: not there
  std::string maps = "paper_maps";  ///< folder for the maps that are built, and found there again
};

/// Tracks each sequence from its ground truth in the paper's form and with the defaults, and prints a table
/// for each data set. Beside a sequence lies its map, SEQUENCE_contours.ply, .pcd or .h5, or the cloud that
/// each form builds its own of, SEQUENCE_cloud.ply, .pcd or .las, both in the frame of the ground truth. A
/// sequence that cannot be tracked says why. Errors: no such folder, no sequence in it, none that can be
/// tracked.
Status print_published(const PublishedRequest& request);

}  // namespace evpose::experiments
