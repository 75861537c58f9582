// SPDX-License-Identifier: BSD-3-Clause
// Attributes, groups and writing of Hdf5File.
#include <hdf5.h>

#include <algorithm>

#include "evpose/io/hdf5/hdf5_file.h"

namespace evpose {
namespace {

constexpr hssize_t kMostAttributeItems = 4096;
constexpr std::size_t kLongestText = 1 << 20;  // bytes of all texts of an attribute

Hdf5Handle space_of(const Hdf5Shape& shape) {
  if (shape.empty()) return Hdf5Handle(H5Screate(H5S_SCALAR), H5Sclose);
  const std::vector<hsize_t> dims(shape.begin(), shape.end());
  return Hdf5Handle(H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr), H5Sclose);
}

Hdf5Handle text_type(std::size_t size) {
  auto type = Hdf5Handle(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.get(), size);
  H5Tset_cset(type.get(), H5T_CSET_UTF8);
  return type;
}

Hdf5Handle open_attribute(hid_t file, const std::string& object, const std::string& name) {
  return Hdf5Handle(H5Aopen_by_name(file, object.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
}

/// Number of items, or -1 when there are too many.
hssize_t items_of(const Hdf5Handle& attribute) {
  const auto space = Hdf5Handle(H5Aget_space(attribute.get()), H5Sclose);
  const hssize_t items = H5Sget_simple_extent_npoints(space.get());
  return items <= kMostAttributeItems ? items : -1;
}

std::optional<std::vector<std::string>> read_variable_strings(const Hdf5Handle& attribute, hssize_t items) {
  const auto type = text_type(H5T_VARIABLE);
  const auto stored = Hdf5Handle(H5Aget_type(attribute.get()), H5Tclose);
  H5Tset_cset(type.get(), H5Tget_cset(stored.get()));
  std::vector<char*> pointers(static_cast<std::size_t>(items), nullptr);
  if (items > 0 && H5Aread(attribute.get(), type.get(), static_cast<void*>(pointers.data())) < 0)
    return std::nullopt;
  std::vector<std::string> out;
  for (char* p : pointers) {
    out.emplace_back(p != nullptr ? p : "");
    H5free_memory(p);
  }
  return out;
}

std::optional<std::vector<std::string>> read_fixed_strings(const Hdf5Handle& attribute, hssize_t items) {
  const auto type = Hdf5Handle(H5Aget_type(attribute.get()), H5Tclose);
  const std::size_t width = H5Tget_size(type.get());
  if (width == 0 || width > kLongestText || static_cast<std::size_t>(items) > kLongestText / width)
    return std::nullopt;
  std::string buffer(width * static_cast<std::size_t>(items), '\0');
  if (items > 0 && H5Aread(attribute.get(), type.get(), buffer.data()) < 0) return std::nullopt;
  std::vector<std::string> out;
  for (std::size_t i = 0; i < static_cast<std::size_t>(items); ++i) {
    std::string value = buffer.substr(i * width, width);
    value.resize(std::min(value.find('\0'), value.size()));
    out.push_back(std::move(value));
  }
  return out;
}

/// Texts of fixed length: the library follows those of variable length into a heap that has no checksum.
bool write_texts(hid_t file, const std::string& object, const std::string& name, const Hdf5Shape& shape,
                 const std::vector<std::string>& values) {
  std::size_t width = 1;
  for (const auto& v : values) width = std::max(width, v.size() + 1);
  std::string buffer;
  for (const auto& v : values) buffer += v + std::string(width - v.size(), '\0');
  const auto type = text_type(width);
  const auto space = space_of(shape);
  const auto attribute = Hdf5Handle(H5Acreate_by_name(file, object.c_str(), name.c_str(), type.get(),
                                                      space.get(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                                    H5Aclose);
  return attribute && (values.empty() || H5Awrite(attribute.get(), type.get(), buffer.data()) >= 0);
}

}  // namespace

bool Hdf5File::has_attribute(const std::string& object, const std::string& name) const {
  return (object == "/" || has(object)) &&
         H5Aexists_by_name(id_.get(), object.c_str(), name.c_str(), H5P_DEFAULT) > 0;
}

std::vector<std::string> Hdf5File::attributes(const std::string& object) const {
  std::vector<std::string> names;
  const auto visit = [](hid_t, const char* name, const H5A_info_t*, void* out) -> herr_t {
    auto& list = *static_cast<std::vector<std::string>*>(out);
    list.emplace_back(name);
    return list.size() < 1000 ? 0 : 1;
  };
  H5Aiterate_by_name(id_.get(), object.c_str(), H5_INDEX_NAME, H5_ITER_INC, nullptr, visit, &names,
                     H5P_DEFAULT);
  std::sort(names.begin(), names.end());
  return names;
}

std::optional<std::vector<double>> Hdf5File::attribute_numbers(const std::string& object,
                                                               const std::string& name) const {
  if (!has_attribute(object, name)) return std::nullopt;
  const auto attribute = open_attribute(id_.get(), object, name);
  const auto type = Hdf5Handle(H5Aget_type(attribute.get()), H5Tclose);
  const H5T_class_t kind = H5Tget_class(type.get());
  const hssize_t items = attribute ? items_of(attribute) : -1;
  if (items < 0 || (kind != H5T_INTEGER && kind != H5T_FLOAT) || !is_sound_number(type.get()))
    return std::nullopt;
  std::vector<double> out(static_cast<std::size_t>(items));
  if (items > 0 && H5Aread(attribute.get(), H5T_NATIVE_DOUBLE, out.data()) < 0) return std::nullopt;
  return out;
}

std::optional<std::vector<std::string>> Hdf5File::attribute_strings(const std::string& object,
                                                                    const std::string& name) const {
  if (!has_attribute(object, name)) return std::nullopt;
  const auto attribute = open_attribute(id_.get(), object, name);
  const auto type = Hdf5Handle(H5Aget_type(attribute.get()), H5Tclose);
  const hssize_t items = attribute ? items_of(attribute) : -1;
  if (items < 0 || H5Tget_class(type.get()) != H5T_STRING) return std::nullopt;
  return H5Tis_variable_str(type.get()) > 0 ? read_variable_strings(attribute, items)
                                            : read_fixed_strings(attribute, items);
}

Status Hdf5File::make_group(const std::string& name) {
  const auto properties = Hdf5Handle(H5Pcreate(H5P_GROUP_CREATE), H5Pclose);
  H5Pset_obj_track_times(properties.get(), false);
  const auto group =
      Hdf5Handle(H5Gcreate2(id_.get(), name.c_str(), H5P_DEFAULT, properties.get(), H5P_DEFAULT), H5Gclose);
  if (!group) return failed("cannot write group " + name);
  return {};
}

Expected<Hdf5Handle> Hdf5File::make_dataset(const std::string& name, NumberType type, const Hdf5Shape& shape,
                                            std::uint64_t chunk_rows) {
  EVPOSE_CHECK(!shape.empty());
  std::vector<hsize_t> dims(shape.begin(), shape.end()), most = dims, chunk = dims;
  most[0] = H5S_UNLIMITED;
  chunk[0] = chunk_rows;
  const auto space =
      Hdf5Handle(H5Screate_simple(static_cast<int>(dims.size()), dims.data(), most.data()), H5Sclose);
  const auto properties = Hdf5Handle(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_chunk(properties.get(), static_cast<int>(chunk.size()), chunk.data());
  H5Pset_shuffle(properties.get());
  H5Pset_deflate(properties.get(), 4);
  H5Pset_obj_track_times(properties.get(), false);
  auto dataset = Hdf5Handle(H5Dcreate2(id_.get(), name.c_str(), hdf5_types(type).file, space.get(),
                                       H5P_DEFAULT, properties.get(), H5P_DEFAULT),
                            H5Dclose);
  if (!dataset) return failed("cannot write dataset " + name);
  return dataset;
}

Status Hdf5File::append(const Hdf5Handle& dataset, NumberType type, std::uint64_t rows_before,
                        std::uint64_t rows, const void* data) {
  if (rows == 0) return {};
  auto space = Hdf5Handle(H5Dget_space(dataset.get()), H5Sclose);
  std::vector<hsize_t> dims(static_cast<std::size_t>(H5Sget_simple_extent_ndims(space.get())));
  H5Sget_simple_extent_dims(space.get(), dims.data(), nullptr);
  std::vector<hsize_t> offset(dims.size(), 0), extent = dims;
  dims[0] = rows_before + rows;
  offset[0] = rows_before;
  extent[0] = rows;
  if (H5Dset_extent(dataset.get(), dims.data()) < 0) return failed("cannot be written");
  space = Hdf5Handle(H5Dget_space(dataset.get()), H5Sclose);
  const auto memory =
      Hdf5Handle(H5Screate_simple(static_cast<int>(extent.size()), extent.data(), nullptr), H5Sclose);
  if (H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, offset.data(), nullptr, extent.data(), nullptr) < 0 ||
      H5Dwrite(dataset.get(), hdf5_types(type).memory, memory.get(), space.get(), H5P_DEFAULT, data) < 0)
    return failed("cannot be written");
  return {};
}

Status Hdf5File::set_attribute(const std::string& object, const std::string& name, NumberType type,
                               const Hdf5Shape& shape, const void* data) {
  const auto space = space_of(shape);
  const auto attribute =
      Hdf5Handle(H5Acreate_by_name(id_.get(), object.c_str(), name.c_str(), hdf5_types(type).file,
                                   space.get(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                 H5Aclose);
  if (!attribute || H5Awrite(attribute.get(), hdf5_types(type).memory, data) < 0)
    return failed("cannot write attribute " + name);
  return {};
}

Status Hdf5File::set_attribute(const std::string& object, const std::string& name, const std::string& value) {
  if (!write_texts(id_.get(), object, name, {}, {value})) return failed("cannot write attribute " + name);
  return {};
}

Status Hdf5File::set_attribute(const std::string& object, const std::string& name,
                               const std::vector<std::string>& values) {
  if (!write_texts(id_.get(), object, name, {values.size()}, values))
    return failed("cannot write attribute " + name);
  return {};
}

Status Hdf5File::close() {
  if (!id_.reset()) return failed("cannot be written");
  return {};
}

}  // namespace evpose
