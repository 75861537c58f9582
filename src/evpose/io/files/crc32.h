// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

namespace evpose {

/// CRC-32/ISO-HDLC, that of zlib and MCAP. Goes on from `crc`, the value of what came before.
std::uint32_t crc32(const void* data, std::size_t size, std::uint32_t crc = 0);

/// Whether a file's checksum is that of its content. Fuzzers go past checksums, as an attacker does.
inline bool crc32_agrees(std::uint32_t stored, std::uint32_t computed) {
#ifdef FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION
  static_cast<void>(stored), static_cast<void>(computed);
  return true;
#else
  return stored == computed;
#endif
}

}  // namespace evpose
