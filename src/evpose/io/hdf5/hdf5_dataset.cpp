// SPDX-License-Identifier: BSD-3-Clause
// Reading of Hdf5Dataset.
#include <hdf5.h>

#include "evpose/io/hdf5/hdf5_file.h"
#include "evpose/io/hdf5/hdf5_filters.h"

namespace evpose {

Status Hdf5Dataset::read_rows(std::uint64_t first, std::uint64_t count, void* out) const {
  EVPOSE_CHECK(static_cast<bool>(row_type_));
  return read_as(row_type_.get(), first, count, out);
}

Status Hdf5Dataset::read(NumberType type, std::uint64_t first, std::uint64_t count, void* out) const {
  return read_as(hdf5_types(type).memory, first, count, out);
}

Status Hdf5Dataset::read_as(std::int64_t memory_type, std::uint64_t first, std::uint64_t count,
                            void* out) const {
  const std::uint64_t all = rows();
  EVPOSE_CHECK(first <= all && count <= all - first);
  if (count == 0) return {};
  const auto file_space = Hdf5Handle(H5Dget_space(id_.get()), H5Sclose);
  Hdf5Handle memory_space;
  if (!shape_.empty()) {
    std::vector<hsize_t> offset(shape_.size(), 0), extent(shape_.begin(), shape_.end());
    offset[0] = first;
    extent[0] = count;
    H5Sselect_hyperslab(file_space.get(), H5S_SELECT_SET, offset.data(), nullptr, extent.data(), nullptr);
    memory_space =
        Hdf5Handle(H5Screate_simple(static_cast<int>(extent.size()), extent.data(), nullptr), H5Sclose);
  }
  const hid_t memory = shape_.empty() ? H5S_ALL : memory_space.get();
  const Hdf5ChunkBytes chunk(chunk_bytes_);
  if (H5Dread(id_.get(), memory_type, memory, shape_.empty() ? H5S_ALL : file_space.get(), H5P_DEFAULT, out) <
      0)
    return Error{path_ + ": " + name_, text("rows ", first, " to ", first + count - 1, " cannot be read"),
                 "the file is truncated or damaged; copy it again"};
  return {};
}

bool Hdf5Dataset::has_attribute(const std::string& name) const {
  return H5Aexists(id_.get(), name.c_str()) > 0;
}

std::optional<std::uint32_t> Hdf5Dataset::attribute_u32(const std::string& name) const {
  if (!has_attribute(name)) return std::nullopt;
  const auto attribute = Hdf5Handle(H5Aopen(id_.get(), name.c_str(), H5P_DEFAULT), H5Aclose);
  const auto space = Hdf5Handle(H5Aget_space(attribute.get()), H5Sclose);
  std::uint32_t value = 0;
  if (H5Sget_simple_extent_npoints(space.get()) != 1 ||
      H5Aread(attribute.get(), H5T_NATIVE_UINT32, &value) < 0)
    return std::nullopt;
  return value;
}

}  // namespace evpose
