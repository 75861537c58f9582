// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <cstdio>

namespace evpose {

/// Whether attributes and filters in an object header of the older form (version 1, which has no checksum)
/// lie within their messages: names, types, shapes, values. HDF5 1.10 takes their word for where these are,
/// up to megabytes beyond. True for headers of version 2, false where there is no header. Of a file of
/// `bytes` bytes; `address` counts from `base`, the length of what others wrote before it. Source: HDF5 File
/// Format Specification 3.0, IV.A.1.a, IV.A.2.l and IV.A.2.m.
bool messages_are_sound(std::FILE* file, std::uint64_t bytes, std::uint64_t base, std::uint64_t address);

}  // namespace evpose
