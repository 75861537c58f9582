// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/files/lzf.h"

#include <algorithm>

namespace evpose {

bool lzf_decompress(std::span<const std::byte> in, std::span<std::byte> out) {
  std::size_t i = 0, o = 0;
  while (i < in.size()) {
    const auto control = std::to_integer<std::size_t>(in[i++]);
    if (control < 32) {  // a run of control + 1 plain bytes
      const std::size_t run = control + 1;
      if (run > in.size() - i || run > out.size() - o) return false;
      std::copy_n(in.begin() + static_cast<std::ptrdiff_t>(i), run,
                  out.begin() + static_cast<std::ptrdiff_t>(o));
      i += run;
      o += run;
      continue;
    }
    // A copy of what stands `distance` before: 3 bits of length (7: one more byte adds to it), 13 bits of
    // distance.
    std::size_t length = control >> 5;
    if (length == 7) {
      if (i == in.size()) return false;
      length += std::to_integer<std::size_t>(in[i++]);
    }
    length += 2;
    if (i == in.size()) return false;
    const std::size_t distance = ((control & 31) << 8 | std::to_integer<std::size_t>(in[i++])) + 1;
    if (distance > o || length > out.size() - o) return false;
    for (std::size_t k = 0; k < length; ++k, ++o) out[o] = out[o - distance];  // may overlap: byte by byte
  }
  return o == out.size();
}

}  // namespace evpose
