// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>

namespace evpose {

/// Whether a child process survives this on a file, within ten seconds and a gigabyte. The HDF5 library
/// (1.10) believes what a damaged file says, follows null pointers, divides by zero or asks for memory
/// without end: there it ends the child, not us. A file tried before that has not changed since is not tried
/// again. Where no child can be had, true.
bool survives(const std::string& path, const std::function<void()>& what);

}  // namespace evpose
