// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/io/hdf5/hdf5_types.h"

namespace evpose {

class TemporaryFile;

using Hdf5Shape = std::vector<std::uint64_t>;

/// A member of the rows of a table, and where it goes in the row in memory.
struct Hdf5Field {
  const char* name;
  std::size_t offset;
  NumberType type;
};

/// A dataset open to be read, its filters available. Errors name file and dataset.
class Hdf5Dataset {
 public:
  const std::string& name() const { return name_; }
  const Hdf5Shape& shape() const { return shape_; }
  std::uint64_t rows() const { return shape_.empty() ? 1 : shape_[0]; }
  NumberType type() const { return type_; }  ///< as stored
  bool is_floating() const { return type_ == NumberType::f32 || type_ == NumberType::f64; }

  /// Rows [first, first + count), as `type`, in C order.
  Status read(NumberType type, std::uint64_t first, std::uint64_t count, void* out) const;
  /// Of a table: rows [first, first + count), as the fields say.
  Status read_rows(std::uint64_t first, std::uint64_t count, void* out) const;
  bool has_attribute(const std::string& name) const;
  std::optional<std::uint32_t> attribute_u32(const std::string& name) const;

 private:
  friend class Hdf5File;
  Status read_as(std::int64_t memory_type, std::uint64_t first, std::uint64_t count, void* out) const;

  std::string path_, name_;
  Hdf5Handle id_, row_type_;     ///< the latter of tables
  std::size_t chunk_bytes_ = 0;  ///< of a whole chunk, unpacked; 0: there are none
  Hdf5Shape shape_;
  NumberType type_ = NumberType::f64;
};

/// An HDF5 file, to be read or being written. The library's own messages are silenced.
class Hdf5File {
 public:
  /// Errors: no such file, no HDF5, truncated, so damaged that the library breaks down over it.
  static Expected<Hdf5File> open(const std::string& path);
  /// Writes to the temporary file, whose target errors name. In the format of HDF5 1.10, whose structure
  /// carries checksums of its own; no time stamps, so that same content gives same bytes.
  static Expected<Hdf5File> create(const TemporaryFile& temporary);

  const std::string& path() const { return path_; }
  std::int64_t size() const { return size_; }  ///< bytes of the file when opened; 0 when created

  bool has(const std::string& object) const;
  std::vector<std::string> root_groups() const;                          ///< sorted by name
  std::vector<std::string> datasets() const;                             ///< full names of all, sorted
  std::vector<std::string> attributes(const std::string& object) const;  ///< names, sorted
  /// Errors: absent, not numbers, more than `dimensions` (any if -1), compressed with a filter that is not
  /// installed, more content than the file can hold.
  Expected<Hdf5Dataset> dataset(const std::string& name, int dimensions = -1) const;
  /// A one-dimensional dataset whose rows have all these fields, `row_bytes` each in memory. Errors:
  /// likewise.
  Expected<Hdf5Dataset> table(const std::string& name, std::span<const Hdf5Field> fields,
                              std::size_t row_bytes) const;

  bool has_attribute(const std::string& object, const std::string& name) const;
  std::optional<std::vector<double>> attribute_numbers(const std::string& object,
                                                       const std::string& name) const;
  std::optional<std::vector<std::string>> attribute_strings(const std::string& object,
                                                            const std::string& name) const;

  Status make_group(const std::string& name);
  /// Chunks of `chunk_rows` rows with shuffle and deflate level 4; the first dimension can grow.
  Expected<Hdf5Handle> make_dataset(const std::string& name, NumberType type, const Hdf5Shape& shape,
                                    std::uint64_t chunk_rows);
  Status append(const Hdf5Handle& dataset, NumberType type, std::uint64_t rows_before, std::uint64_t rows,
                const void* data);
  /// On a group or dataset; `shape` empty for a scalar.
  Status set_attribute(const std::string& object, const std::string& name, NumberType type,
                       const Hdf5Shape& shape, const void* data);
  Status set_attribute(const std::string& object, const std::string& name, const std::string& value);
  Status set_attribute(const std::string& object, const std::string& name,
                       const std::vector<std::string>& values);
  /// Errors: writing failed.
  Status close();

 private:
  /// Untried; without identifier if that fails.
  static Hdf5File opened(const std::string& path);
  /// All that the library is ever asked of a file, for nothing: every object, its attributes, the outermost
  /// rows of datasets. False if they cannot be listed.
  static bool read_through(const std::string& path);
  Error failed(const std::string& what) const;
  Status open_dataset(const std::string& name, int dimensions, Hdf5Dataset& out) const;

  std::string path_;
  std::int64_t size_ = 0;
  Hdf5Handle id_;
};

}  // namespace evpose
