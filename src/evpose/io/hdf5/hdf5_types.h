// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

namespace evpose {

/// Owns one identifier of the HDF5 library.
class Hdf5Handle {
 public:
  using Close = int (*)(std::int64_t);

  Hdf5Handle() = default;
  Hdf5Handle(std::int64_t id, Close close) : id_(id), close_(close) {}
  Hdf5Handle(Hdf5Handle&& other) noexcept;
  Hdf5Handle& operator=(Hdf5Handle&& other) noexcept;
  ~Hdf5Handle() { reset(); }

  std::int64_t get() const { return id_; }
  explicit operator bool() const { return id_ >= 0; }
  /// False when closing failed, as it does when the disk is full.
  bool reset();

 private:
  std::int64_t id_ = -1;
  Close close_ = nullptr;
};

enum class NumberType { i8, u8, i16, u16, i32, u32, i64, u64, f32, f64 };
std::size_t size_of(NumberType type);

/// Whether the bits of a stored integer or floating-point type lie within it, and are as many as numbers
/// have. The library takes the word of a file for them, and would read and write beyond.
bool is_sound_number(std::int64_t type);

/// Whether the members of a stored row are sound numbers or texts that do not overlap and end within the row.
/// Here, too, the library takes the word of a file. `type` is compound.
bool are_sound_rows(std::int64_t type);

/// The library's types of a number, little-endian in the file and as this machine has it.
struct Hdf5TypePair {
  std::int64_t file = -1, memory = -1;
};
Hdf5TypePair hdf5_types(NumberType type);

/// The type whose values are those of a stored one; half and long floats are read as double. None: it is no
/// sound number of a usual size.
std::optional<NumberType> number_type(std::int64_t type);

}  // namespace evpose
