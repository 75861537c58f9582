// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace evpose {

/// Whether a child process survives this on a file (child_process.h) and finds it good. The HDF5 library
/// (1.10) believes what a damaged file says, follows null pointers, divides by zero or asks for memory
/// without end: there it ends the child, not us. A file tried before that has not changed since is not tried
/// again.
bool survives(const std::string& path, bool (*work)(const std::string& path));

}  // namespace evpose
