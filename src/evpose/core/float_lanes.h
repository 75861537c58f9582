// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

/// Eight numbers side by side, for use within one file: how they are passed depends on the processor.
namespace evpose::lanes {

constexpr std::size_t kSide = 8;
using Floats = float __attribute__((vector_size(4 * kSide)));
using Ints = std::int32_t __attribute__((vector_size(4 * kSide)));

/// From memory that need not be aligned.
template <class Vector, class Element>
Vector load(const Element* from) {
  Vector out;
  std::memcpy(&out, from, sizeof out);
  return out;
}

inline Floats all(float v) { return v - Floats{}; }

}  // namespace evpose::lanes
