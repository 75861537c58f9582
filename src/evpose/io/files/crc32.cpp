// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/files/crc32.h"

#include <zlib.h>

namespace evpose {

std::uint32_t crc32(const void* data, std::size_t size, std::uint32_t crc) {
  if (size == 0) return crc;  // no data may be a null pointer, for which zlib gives 0
  return static_cast<std::uint32_t>(::crc32_z(crc, static_cast<const Bytef*>(data), size));
}

}  // namespace evpose
