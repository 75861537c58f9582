// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/hdf5/hdf5_types.h"

#include <hdf5.h>

#include <algorithm>
#include <type_traits>
#include <utility>
#include <vector>

namespace evpose {

static_assert(std::is_same_v<hid_t, std::int64_t>, "Hdf5Handle holds identifiers as 64-bit numbers");

Hdf5Handle::Hdf5Handle(Hdf5Handle&& other) noexcept
    : id_(std::exchange(other.id_, -1)), close_(other.close_) {}

Hdf5Handle& Hdf5Handle::operator=(Hdf5Handle&& other) noexcept {
  if (this == &other) return *this;
  reset();
  id_ = std::exchange(other.id_, -1);
  close_ = other.close_;
  return *this;
}

bool Hdf5Handle::reset() {
  const std::int64_t id = std::exchange(id_, -1);
  return id < 0 || close_(id) >= 0;
}

bool is_sound_number(std::int64_t type) {
  constexpr std::size_t kLargest = 16, kMostExponentBits = 32;  // bytes; quadruple precision has 15
  const std::size_t size = H5Tget_size(type), bits = 8 * size;
  if (size > kLargest) return false;
  const auto within = [bits](std::size_t from, std::size_t count) {
    return from <= bits && count <= bits - from;
  };
  const int offset = H5Tget_offset(type);
  if (offset < 0 || !within(static_cast<std::size_t>(offset), H5Tget_precision(type))) return false;
  if (H5Tget_class(type) != H5T_FLOAT) return true;
  std::size_t sign = 0, exponent = 0, exponent_bits = 0, mantissa = 0, mantissa_bits = 0;
  return H5Tget_fields(type, &sign, &exponent, &exponent_bits, &mantissa, &mantissa_bits) >= 0 &&
         within(sign, 1) && exponent_bits <= kMostExponentBits && within(exponent, exponent_bits) &&
         within(mantissa, mantissa_bits);
}

std::size_t size_of(NumberType type) { return H5Tget_size(hdf5_types(type).memory); }

Hdf5TypePair hdf5_types(NumberType type) {
  switch (type) {
    case NumberType::i8:
      return {H5T_STD_I8LE, H5T_NATIVE_INT8};
    case NumberType::u8:
      return {H5T_STD_U8LE, H5T_NATIVE_UINT8};
    case NumberType::i16:
      return {H5T_STD_I16LE, H5T_NATIVE_INT16};
    case NumberType::u16:
      return {H5T_STD_U16LE, H5T_NATIVE_UINT16};
    case NumberType::i32:
      return {H5T_STD_I32LE, H5T_NATIVE_INT32};
    case NumberType::u32:
      return {H5T_STD_U32LE, H5T_NATIVE_UINT32};
    case NumberType::i64:
      return {H5T_STD_I64LE, H5T_NATIVE_INT64};
    case NumberType::u64:
      return {H5T_STD_U64LE, H5T_NATIVE_UINT64};
    case NumberType::f32:
      return {H5T_IEEE_F32LE, H5T_NATIVE_FLOAT};
    case NumberType::f64:
      return {H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE};
  }
  return {H5I_INVALID_HID, H5I_INVALID_HID};
}

std::optional<NumberType> number_type(std::int64_t type) {
  hid_t number = type;
  Hdf5Handle base;
  if (H5Tget_class(type) == H5T_ENUM) {
    base = Hdf5Handle(H5Tget_super(type), H5Tclose);
    number = base.get();
  }
  if (!is_sound_number(number)) return std::nullopt;
  const std::size_t size = H5Tget_size(number);
  if (H5Tget_class(number) == H5T_FLOAT) return size == 4 ? NumberType::f32 : NumberType::f64;
  const bool is_signed = H5Tget_sign(number) == H5T_SGN_2;
  switch (size) {
    case 1:
      return is_signed ? NumberType::i8 : NumberType::u8;
    case 2:
      return is_signed ? NumberType::i16 : NumberType::u16;
    case 4:
      return is_signed ? NumberType::i32 : NumberType::u32;
    case 8:
      return is_signed ? NumberType::i64 : NumberType::u64;
    default:
      return std::nullopt;
  }
}

bool are_sound_rows(std::int64_t type) {
  std::vector<std::pair<std::size_t, std::size_t>> members;  // begin, size
  for (int i = 0; i < H5Tget_nmembers(type); ++i) {
    const auto index = static_cast<unsigned>(i);
    const auto member = Hdf5Handle(H5Tget_member_type(type, index), H5Tclose);
    const H5T_class_t kind = H5Tget_class(member.get());
    const bool is_number = kind == H5T_INTEGER || kind == H5T_FLOAT;
    const bool is_text = kind == H5T_STRING && H5Tis_variable_str(member.get()) == 0;
    if (!is_text && !(is_number && is_sound_number(member.get()))) return false;
    members.emplace_back(H5Tget_member_offset(type, index), H5Tget_size(member.get()));
  }
  std::sort(members.begin(), members.end());
  std::size_t end = 0;
  for (const auto& [begin, size] : members) {
    if (begin < end) return false;
    end = begin + size;
  }
  return end <= H5Tget_size(type);
}

}  // namespace evpose
