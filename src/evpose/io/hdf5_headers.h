// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <cstdio>

namespace evpose {

/// Whether the attributes in an object header of the older form (version 1, which has no checksum) lie within
/// their messages: name, type, shape and content. HDF5 1.10 takes their word for where these are, up to 64 kB
/// beyond. True for headers of version 2, false where there is no header. Of a file of `bytes` bytes;
/// `address` counts from `base`, the length of what others wrote before it.
/// Source: HDF5 File Format Specification 3.0, IV.A.1.a and IV.A.2.m.
bool attributes_lie_within(std::FILE* file, std::uint64_t bytes, std::uint64_t base, std::uint64_t address);

}  // namespace evpose
