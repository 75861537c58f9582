// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/core/pose.h"

namespace evpose {

/// Reads a trajectory of any kind that it recognises: TUM; EuRoC; CSV whose stamps are seconds, or whose
/// heading has qx before qw; TUM in microseconds, as TUM-VIE's motion capture; KITTI, with its times beside
/// it; poses of a bag, those of the first topic that has some. Poses are as the file has them: bodies and
/// frames differ between data sets. Errors: as for read_tum(); times that are missing or of another number.
Expected<std::vector<TimedPose>> read_trajectory(const std::string& path);

/// Rows `timestamp [ns], px, py, pz, qw, qx, qy, qz, ...`, 8 to 17 values; what follows the pose is ignored.
Expected<std::vector<TimedPose>> read_euroc(const std::string& path);

/// Rows of a 3x4 matrix, stamps in seconds from another file, a line each. `times` empty: times.txt beside
/// the poses, or NAME_times.txt beside NAME.txt.
Expected<std::vector<TimedPose>> read_kitti(const std::string& path, const std::string& times = "");

/// EuRoC's motion-capture columns, `#timestamp [ns],p_RS_R_x [m],...`: 8 values. Stamps are exact, numbers
/// read back to 1e-9.
Status write_euroc(const std::string& path, const std::vector<TimedPose>& trajectory);

}  // namespace evpose
