// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

#include "evpose/io/files/crc32.h"
#include "evpose/io/hdf5/hdf5_file.h"
#include "evpose/io/maps/map_h5_pages.h"

namespace evpose {

inline constexpr double kFarthestInMap = 1e7;  ///< m
inline constexpr const char* kMapDamaged = "the file is damaged; copy or build it again";

template <class T>
constexpr NumberType number_type();
template <>
constexpr NumberType number_type<std::int8_t>() {
  return NumberType::i8;
}
template <>
constexpr NumberType number_type<std::uint8_t>() {
  return NumberType::u8;
}
template <>
constexpr NumberType number_type<std::uint16_t>() {
  return NumberType::u16;
}
template <>
constexpr NumberType number_type<std::int32_t>() {
  return NumberType::i32;
}
template <>
constexpr NumberType number_type<std::uint32_t>() {
  return NumberType::u32;
}
template <>
constexpr NumberType number_type<std::uint64_t>() {
  return NumberType::u64;
}
template <>
constexpr NumberType number_type<float>() {
  return NumberType::f32;
}
template <>
constexpr NumberType number_type<double>() {
  return NumberType::f64;
}

/// False, too, where it cannot be read.
bool is_hdf5_file(const std::string& path);

/// Reads datasets of a map file, whole and each against its checksum, or the rows of a page, which has one
/// for all of them. Remembers the first failure, so that reads can be listed.
class MapColumns {
 public:
  /// `page`: outlives it; null: the whole file.
  explicit MapColumns(const Hdf5File& file, const MapFilePage* page = nullptr) : file_(file), page_(page) {}

  const Status& status() const { return status_; }
  const MapFilePage* page() const { return page_; }
  /// Number of the first row that is read.
  std::uint64_t first_of(MapRows kind) const { return page_ == nullptr ? 0 : page_->first_of(kind); }

  /// `width` numbers a row; `rows` rows, any number if -1. Empty after a failure.
  template <class T>
  std::vector<T> column(const std::string& name, std::uint64_t width, std::int64_t rows);

  /// Once all of a page is read. Error: it is not what was written.
  Status finish() const {
    if (!status_ || page_ == nullptr || crc32_agrees(page_->crc, crc_)) return status_;
    return Error{file_.path(), "a page does not match its checksum", kMapDamaged};
  }

 private:
  static constexpr std::uint64_t kMostRows = std::uint64_t{1} << 31;

  template <class T>
  std::vector<T> fail(Error error) {
    status_ = std::move(error);
    return {};
  }

  const Hdf5File& file_;
  const MapFilePage* page_;
  Status status_;
  std::uint32_t crc_ = 0;  ///< of the columns of the page
};

/// The part of a page's checksum that a column has; the parts are added up.
inline std::uint32_t page_checksum(const std::string& name, const void* data, std::size_t size) {
  return crc32(data, size, crc32(name.data(), name.size()));
}

template <class T>
std::vector<T> MapColumns::column(const std::string& name, std::uint64_t width, std::int64_t rows) {
  if (!status_) return {};
  const auto dataset = file_.dataset(name, width == 1 ? 1 : 2);
  if (!dataset) return fail<T>(dataset.error());
  const std::string where = file_.path() + ": " + name;
  if (dataset->type() != number_type<T>() || (width > 1 && dataset->shape()[1] != width))
    return fail<T>({where, "is of another type or width than map files have", "build the map again"});
  const MapRows kind = rows_of_dataset(name);
  const std::uint64_t first = first_of(kind),
                      count = page_ == nullptr ? dataset->rows() : page_->count_of(kind);
  if (dataset->rows() >= kMostRows || first + count > dataset->rows() ||
      (rows >= 0 && count != static_cast<std::uint64_t>(rows)))
    return fail<T>({where, text("has ", dataset->rows(), " rows instead of ", rows), kMapDamaged});
  std::vector<T> values(count * width);
  if (auto read = dataset->read(number_type<T>(), first, count, values.data()); !read)
    return fail<T>(read.error());
  const auto crc = dataset->attribute_u32("crc32");
  if (!crc) return fail<T>({where, "has no checksum (attribute crc32)", "build the map again"});
  const std::size_t bytes = values.size() * sizeof(T);
  if (page_ != nullptr) crc_ += page_checksum(name, values.data(), bytes);
  if (page_ == nullptr && !crc32_agrees(*crc, crc32(values.data(), bytes)))
    return fail<T>({where, "does not match its checksum", kMapDamaged});
  if constexpr (std::is_floating_point_v<T>) {
    const auto wrong =
        std::find_if(values.begin(), values.end(), [](T v) { return !(std::abs(v) <= kFarthestInMap); });
    if (wrong != values.end())
      return fail<T>({where,
                      text("row ", first + static_cast<std::uint64_t>(wrong - values.begin()) / width,
                           " is not finite or out of range"),
                      kMapDamaged});
  }
  return values;
}

}  // namespace evpose
