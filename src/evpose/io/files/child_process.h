// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace evpose {

/// Whether a child process lives through work(path), which returns true, within ten seconds of processor time
/// and a gigabyte more memory. Where no child can be had, true.
bool child_survives(bool (*work)(const std::string& path), const std::string& path);

}  // namespace evpose
