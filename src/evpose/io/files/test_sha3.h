// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace evpose {

/// The permutation of FIPS 202.
inline void keccak(std::array<std::uint64_t, 25>& a) {
  std::uint8_t shift_register = 1;
  for (int round = 0; round < 24; ++round) {
    std::array<std::uint64_t, 5> parity{};
    for (std::size_t i = 0; i < 25; ++i) parity[i % 5] ^= a[i];
    for (std::size_t i = 0; i < 25; ++i) a[i] ^= parity[(i + 4) % 5] ^ std::rotl(parity[(i + 1) % 5], 1);
    std::uint64_t moved = a[1];
    for (std::size_t t = 0, x = 1, y = 0; t < 24; ++t) {
      const std::size_t next_y = (2 * x + 3 * y) % 5;
      x = y;
      y = next_y;
      const auto turn = static_cast<int>((t + 1) * (t + 2) / 2 % 64);
      const std::uint64_t held = a[x + 5 * y];
      a[x + 5 * y] = std::rotl(moved, turn);
      moved = held;
    }
    for (std::size_t y = 0; y < 25; y += 5) {
      std::array<std::uint64_t, 5> row{};
      for (std::size_t x = 0; x < 5; ++x) row[x] = a[y + x];
      for (std::size_t x = 0; x < 5; ++x) a[y + x] = row[x] ^ (~row[(x + 1) % 5] & row[(x + 2) % 5]);
    }
    for (int j = 0; j <= 6; ++j) {
      if ((shift_register & 1) != 0) a[0] ^= std::uint64_t{1} << ((1 << j) - 1);
      shift_register = static_cast<std::uint8_t>(shift_register << 1 ^ (shift_register >> 7) * 0x71);
    }
  }
}

/// In hexadecimal digits.
inline std::string sha3_224(std::span<const std::byte> bytes) {
  constexpr std::size_t kRate = 144, kDigest = 28;
  std::array<std::uint64_t, 25> state{};
  const auto absorb = [&](std::size_t at, std::byte byte) {
    state[at / 8] ^= std::to_integer<std::uint64_t>(byte) << 8 * (at % 8);
  };
  std::size_t at = 0;
  for (const std::byte byte : bytes) {
    absorb(at++, byte);
    if (at == kRate) keccak(state), at = 0;
  }
  absorb(at, std::byte{0x06});
  absorb(kRate - 1, std::byte{0x80});
  keccak(state);
  std::string hex;
  for (std::size_t i = 0; i < kDigest; ++i) {
    const auto byte = static_cast<unsigned>(state[i / 8] >> 8 * (i % 8) & 0xFF);
    hex += "0123456789abcdef"[byte >> 4];
    hex += "0123456789abcdef"[byte & 15];
  }
  return hex;
}

}  // namespace evpose
