// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

namespace evpose {

/// CRC-32/ISO-HDLC, that of zlib and MCAP. Goes on from `crc`, the value of what came before.
std::uint32_t crc32(const void* data, std::size_t size, std::uint32_t crc = 0);

}  // namespace evpose
