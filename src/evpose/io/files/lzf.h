// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <span>

namespace evpose {

/// Unpacks one LZF block. True when it is sound and fills `out` exactly.
bool lzf_decompress(std::span<const std::byte> in, std::span<std::byte> out);

}  // namespace evpose
