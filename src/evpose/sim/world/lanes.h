// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>

#ifdef __AVX2__
#include <immintrin.h>
#endif

namespace evpose::sim {

/// Eight numbers that are worked on at once. What is written for a type V runs with V = float and
/// V = FloatLanes and gives the same bits: no operation here is rounded differently in a lane.
inline constexpr int kLanes = 8;
using FloatLanes = float __attribute__((vector_size(4 * kLanes)));
using IntLanes = std::int32_t __attribute__((vector_size(4 * kLanes)));

inline constexpr IntLanes kLaneNumbers = {0, 1, 2, 3, 4, 5, 6, 7};

template <class V>
struct LaneTypes {
  using Int = std::int32_t;
  using Mask = bool;
};
template <>
struct LaneTypes<FloatLanes> {
  using Int = IntLanes;
  using Mask = IntLanes;
};

inline float select(bool which, float a, float b) { return which ? a : b; }
inline std::int32_t select(bool which, std::int32_t a, std::int32_t b) { return which ? a : b; }
inline FloatLanes select(IntLanes which, FloatLanes a, FloatLanes b) { return which ? a : b; }
inline IntLanes select(IntLanes which, IntLanes a, IntLanes b) { return which ? a : b; }

inline bool any(bool m) { return m; }
inline bool any(IntLanes m) {
#ifdef __AVX2__
  return _mm256_movemask_ps(reinterpret_cast<__m256>(m)) != 0;
#else
  std::int32_t sum = 0;
  for (int i = 0; i < kLanes; ++i) sum |= m[i];
  return sum != 0;
#endif
}
/// Bit i: lane i.
inline unsigned bits_of(IntLanes m) {
#ifdef __AVX2__
  return static_cast<unsigned>(_mm256_movemask_ps(reinterpret_cast<__m256>(m)));
#else
  unsigned out = 0;
  for (int i = 0; i < kLanes; ++i) out |= (m[i] != 0 ? 1U : 0U) << i;
  return out;
#endif
}

template <class V>
V smaller(V a, V b) {
  return select(a < b, a, b);
}
template <class V>
V larger(V a, V b) {
  return select(a > b, a, b);
}

/// Towards zero.
inline std::int32_t to_int(float v) { return static_cast<std::int32_t>(v); }
inline IntLanes to_int(FloatLanes v) { return __builtin_convertvector(v, IntLanes); }
inline float to_float(std::int32_t v) { return static_cast<float>(v); }
inline FloatLanes to_float(IntLanes v) { return __builtin_convertvector(v, FloatLanes); }

inline std::int32_t bits(float v) { return std::bit_cast<std::int32_t>(v); }
inline IntLanes bits(FloatLanes v) { return reinterpret_cast<IntLanes>(v); }
inline float from_bits(std::int32_t v) { return std::bit_cast<float>(v); }
inline FloatLanes from_bits(IntLanes v) { return reinterpret_cast<FloatLanes>(v); }

inline float root(float v) { return __builtin_sqrtf(v); }
inline FloatLanes root(FloatLanes v) {
#ifdef __AVX2__
  return _mm256_sqrt_ps(v);
#else
  for (int i = 0; i < kLanes; ++i) v[i] = __builtin_sqrtf(v[i]);
  return v;
#endif
}

template <class V>
V magnitude(V v) {
  return from_bits(bits(v) & 0x7FFFFFFF);
}
/// Within the range of an int.
template <class V>
V round_down(V v) {
  const V whole = to_float(to_int(v));
  return select(whole > v, V(whole - 1.0F), whole);
}

template <class V>
V all(float v) {
  return V{} + v;
}
inline IntLanes load(const std::int32_t* from) {
  IntLanes out;
  std::memcpy(&out, from, sizeof out);
  return out;
}
inline FloatLanes load(const float* from) {
  FloatLanes out;
  std::memcpy(&out, from, sizeof out);
  return out;
}
template <class V, class T>
void store(T* to, V v) {
  std::memcpy(to, &v, sizeof v);
}

inline float gather(const float* table, std::int32_t at) { return table[at]; }
inline std::int32_t gather(const std::int32_t* table, std::int32_t at) { return table[at]; }
inline FloatLanes gather(const float* table, IntLanes at) {
#ifdef __AVX2__
  return _mm256_i32gather_ps(table, reinterpret_cast<__m256i>(at), sizeof *table);
#else
  FloatLanes out;
  for (int i = 0; i < kLanes; ++i) out[i] = table[at[i]];
  return out;
#endif
}
inline IntLanes gather(const std::int32_t* table, IntLanes at) {
#ifdef __AVX2__
  return reinterpret_cast<IntLanes>(
      _mm256_i32gather_epi32(table, reinterpret_cast<__m256i>(at), sizeof *table));
#else
  IntLanes out;
  for (int i = 0; i < kLanes; ++i) out[i] = table[at[i]];
  return out;
#endif
}

/// Two neighbouring elements, the first in the lower half.
inline std::int32_t gather_pair(const std::uint16_t* table, std::int32_t at) {
  static_assert(std::endian::native == std::endian::little);
  std::int32_t out = 0;
  std::memcpy(&out, table + at, sizeof out);
  return out;
}
inline IntLanes gather_pair(const std::uint16_t* table, IntLanes at) {
#ifdef __AVX2__
  return reinterpret_cast<IntLanes>(_mm256_i32gather_epi32(reinterpret_cast<const int*>(table),
                                                           reinterpret_cast<__m256i>(at), sizeof *table));
#else
  IntLanes out;
  for (int i = 0; i < kLanes; ++i) out[i] = gather_pair(table, static_cast<std::int32_t>(at[i]));
  return out;
#endif
}

/// Natural logarithm of a positive normal number; within 1e-7 and the rounding of the result.
template <class V>
V fast_log(V v) {
  using Int = typename LaneTypes<V>::Int;
  constexpr float kHigh = 0.693359375F, kLow = -2.12194440e-4F;  // ln 2 in two parts
  // v = 2^e m with m in [sqrt(1/2), sqrt(2)): ln m = 2 atanh s, s = (m - 1) / (m + 1), |s| < 0.172.
  const Int raw = bits(v) - 0x3F3504F3;
  const Int e = raw >> 23;
  const V m = from_bits(Int((raw & 0x007FFFFF) + 0x3F3504F3));
  const V s = (m - 1.0F) / (m + 1.0F), s2 = s * s;
  const V tail = s2 * (1.0F / 3 + s2 * (1.0F / 5 + s2 * (1.0F / 7 + s2 * (1.0F / 9))));
  const V exponent = to_float(e);
  return exponent * kHigh + (exponent * kLow + (s * 2.0F + s * 2.0F * tail));
}

/// e^v for v from -80 to 80, within 3e-7 relative.
template <class V>
V fast_exp(V v) {
  using Int = typename LaneTypes<V>::Int;
  constexpr float kHigh = 0.693359375F, kLow = -2.12194440e-4F, kPerLog2 = 1.44269504F;
  const V whole = round_down(V(v * kPerLog2 + 0.5F));
  const V r = v - whole * kHigh - whole * kLow;  // |r| < 0.35
  const V p =
      1.0F +
      r * (1.0F + r * (1.0F / 2 + r * (1.0F / 6 + r * (1.0F / 24 + r * (1.0F / 120 + r * (1.0F / 720))))));
  const Int scale = (to_int(whole) + 127) << 23;
  return p * from_bits(scale);
}

}  // namespace evpose::sim
