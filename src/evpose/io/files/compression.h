// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "evpose/core/error.h"

namespace evpose {

/// Whole blocks as bags and MCAP files hold them: LZ4 and Zstandard frames, bzip2 streams.
enum class Compression { none, lz4, zstd, bz2 };

/// Undoes the compression of `data` into the front of `room`, which grows as needed and is kept from call to
/// call; returns the bytes written. Memory follows what really comes out, never what a header promises.
/// Errors, at `where`: damaged, cut off, more than `largest` bytes.
Expected<std::size_t> decompress(Compression method, std::span<const std::byte> data, std::size_t largest,
                                 const std::string& where, std::vector<std::byte>& room);

/// Undoes the compression of one LZF block. True when it is sound and fills `out` exactly.
bool decompress_lzf(std::span<const std::byte> block, std::span<std::byte> out);

/// One frame. For none, lz4 and zstd.
std::vector<std::byte> compress(Compression method, std::span<const std::byte> data);

}  // namespace evpose
