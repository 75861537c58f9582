// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/hdf5/hdf5_file.h"

#include <hdf5.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <limits>
#include <system_error>

#include "evpose/io/files/atomic_file.h"
#include "evpose/io/files/byte_stream.h"
#include "evpose/io/files/input_file.h"
#include "evpose/io/hdf5/hdf5_filters.h"
#include "evpose/io/hdf5/hdf5_trial.h"

namespace evpose {
namespace {

void prepare() {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  register_hdf5_filters();
}

std::string filter_name(H5Z_filter_t id) {
  switch (id) {
    case 307:
      return "bzip2";
    case 32000:
      return "LZF";
    case 32001:
      return "Blosc";
    case 32004:
      return "LZ4";
    case 32008:
      return "bitshuffle";
    case 32015:
      return "Zstandard";
    case 0x8ECF:
      return "ECF";
    default:
      return "filter";
  }
}

/// The first filter of the dataset that cannot be run here, in words; empty if none.
std::string missing_filter(hid_t properties) {
  for (int i = 0; i < H5Pget_nfilters(properties); ++i) {
    unsigned flags = 0, config = 0;
    std::size_t values = 0;
    const H5Z_filter_t id =
        H5Pget_filter2(properties, static_cast<unsigned>(i), &flags, &values, nullptr, 0, nullptr, &config);
    if (id >= 0 && H5Zfilter_avail(id) <= 0) return text(filter_name(id), " (HDF5 filter ", id, ")");
  }
  return "";
}

/// Bytes of one stored chunk; 0 when the dataset has none.
double chunk_bytes(hid_t properties, std::size_t item) {
  if (H5Pget_layout(properties) != H5D_CHUNKED) return 0;
  hsize_t dims[H5S_MAX_RANK] = {};
  const int rank = H5Pget_chunk(properties, H5S_MAX_RANK, dims);
  double bytes = static_cast<double>(item);
  for (int i = 0; i < rank; ++i) bytes *= static_cast<double>(dims[i]);
  return bytes;
}

/// Bytes that the file has by its own word, if it is of the usual form, nothing before its superblock; 0
/// otherwise.
std::uint64_t claimed_bytes(std::FILE* file) {
  std::array<std::byte, 48> head{};
  if (std::fread(head.data(), 1, head.size(), file) != head.size()) return 0;
  if (std::memcmp(head.data(), "\x89HDF", 4) != 0) return 0;
  const auto version = load<std::uint8_t>(head, 8);
  const bool known = version == 0 || version == 2 || version == 3;
  if (!known || load<std::uint8_t>(head, version == 0 ? 13 : 9) != 8) return 0;  // bytes of an address
  return load<std::uint64_t>(head, version == 0 ? 40 : 28);
}

}  // namespace

Hdf5File Hdf5File::opened(const std::string& path) {
  Hdf5File file;
  file.path_ = path;
  std::error_code failed;
  const auto bytes = std::filesystem::file_size(path, failed);
  if (failed) return file;
  file.size_ = static_cast<std::int64_t>(bytes);
  file.id_ = Hdf5Handle(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  return file;
}

Expected<Hdf5File> Hdf5File::open(const std::string& path) {
  prepare();
  const auto plain = open_to_read(path);
  if (!plain) return plain.error();
  if (plain->size == 0) return Error{path, "the file is empty", "copy it again"};
  if (H5Fis_hdf5(path.c_str()) <= 0)
    return Error{path, text("is not an HDF5 file (", plain->size, " bytes)"),
                 "copy it again, or name another format"};
  Hdf5File file;
  // A file that was cut, which is most of the damaged ones, costs no child.
  const bool cut = claimed_bytes(plain->stream.get()) > static_cast<std::uint64_t>(plain->size);
  if (!cut && survives(path, read_through)) file = opened(path);
  if (!file.id_)
    return Error{path, text("truncated or damaged HDF5 file (", plain->size, " bytes)"), "copy it again"};
  return file;
}

Expected<Hdf5File> Hdf5File::create(const TemporaryFile& temporary) {
  prepare();
  Hdf5File file;
  file.path_ = temporary.target();
  const auto access = Hdf5Handle(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_libver_bounds(access.get(), H5F_LIBVER_V110, H5F_LIBVER_V110);
  const auto root = Hdf5Handle(H5Pcreate(H5P_FILE_CREATE), H5Pclose);
  H5Pset_obj_track_times(root.get(), false);
  file.id_ =
      Hdf5Handle(H5Fcreate(temporary.path().c_str(), H5F_ACC_TRUNC, root.get(), access.get()), H5Fclose);
  if (!file.id_) return file.failed("cannot be written");
  return file;
}

Error Hdf5File::failed(const std::string& what) const {
  return Error{path_, what, "check the free space of the disk"};
}

bool Hdf5File::has(const std::string& object) const {
  // Each link on the way must exist before the next may be asked for.
  for (std::size_t slash = object.find('/', 1);; slash = object.find('/', slash + 1)) {
    if (H5Lexists(id_.get(), object.substr(0, slash).c_str(), H5P_DEFAULT) <= 0) return false;
    if (slash == std::string::npos) break;
  }
  return H5Oexists_by_name(id_.get(), object.c_str(), H5P_DEFAULT) > 0;
}

std::vector<std::string> Hdf5File::root_groups() const {
  std::vector<std::string> names;
  const auto visit = [](hid_t, const char* name, const H5L_info_t*, void* out) -> herr_t {
    auto& list = *static_cast<std::vector<std::string>*>(out);
    list.emplace_back(name);
    return list.size() < 1000 ? 0 : 1;
  };
  H5Literate(id_.get(), H5_INDEX_NAME, H5_ITER_INC, nullptr, visit, &names);
  std::erase_if(names, [&](const std::string& name) {
    const auto object = Hdf5Handle(H5Oopen(id_.get(), name.c_str(), H5P_DEFAULT), H5Oclose);
    return !object || H5Iget_type(object.get()) != H5I_GROUP;
  });
  return names;
}

std::vector<std::string> Hdf5File::datasets() const {
  std::vector<std::string> names;
  const auto visit = [](hid_t, const char* name, const H5O_info_t* info, void* out) -> herr_t {
    auto& list = *static_cast<std::vector<std::string>*>(out);
    if (info->type == H5O_TYPE_DATASET) list.push_back(std::string("/") + name);
    return list.size() < 10'000 ? 0 : 1;
  };
  H5Ovisit2(id_.get(), H5_INDEX_NAME, H5_ITER_INC, visit, &names, H5O_INFO_BASIC);
  std::sort(names.begin(), names.end());
  return names;
}

/// What datasets of numbers and tables have in common: everything but their type.
Status Hdf5File::open_dataset(const std::string& name, int dimensions, Hdf5Dataset& out) const {
  const std::string where = path_ + ": " + name;
  if (!has(name)) return Error{path_, "no dataset " + name, "is it the right file?"};
  out.path_ = path_;
  out.name_ = name;
  out.id_ = Hdf5Handle(H5Dopen2(id_.get(), name.c_str(), H5P_DEFAULT), H5Dclose);
  if (!out.id_) return Error{where, "is not a readable dataset", "copy the file again"};
  const auto space = Hdf5Handle(H5Dget_space(out.id_.get()), H5Sclose);
  const int rank = H5Sget_simple_extent_ndims(space.get());
  if (rank < 0 || (dimensions >= 0 && rank != dimensions))
    return Error{where, text("has ", rank, " dimensions instead of ", dimensions), "is it the right file?"};
  hsize_t dims[H5S_MAX_RANK] = {};
  H5Sget_simple_extent_dims(space.get(), dims, nullptr);
  out.shape_.assign(dims, dims + rank);
  const auto properties = Hdf5Handle(H5Dget_create_plist(out.id_.get()), H5Pclose);
  if (const std::string filter = missing_filter(properties.get()); !filter.empty())
    return Error{where, "is compressed with " + filter + ", which is not installed",
                 "install that HDF5 plug-in, or rewrite the file by h5repack -f GZIP=4"};
  const auto type = Hdf5Handle(H5Dget_type(out.id_.get()), H5Tclose);
  // Deflate makes at most 1032 bytes of one; anything beyond is a damaged header, or content that was never
  // written.
  double bytes = static_cast<double>(H5Tget_size(type.get()));
  const double most = size_ > 0 ? 1100.0 * static_cast<double>(size_) : std::numeric_limits<double>::max();
  const double chunk = chunk_bytes(properties.get(), static_cast<std::size_t>(bytes));
  if (chunk > std::min(most, 1e9))
    return Error{where, "has larger chunks than the file can hold", "the file is damaged; copy it again"};
  out.chunk_bytes_ = static_cast<std::size_t>(chunk);
  for (const auto n : out.shape_) bytes *= static_cast<double>(n);
  if (bytes > most)
    return Error{where, text("claims ", bytes, " bytes, the file has ", size_),
                 "the file is damaged; copy it again"};
  // The library reads a dataset inside of its header as far as the shape says, from wherever its content
  // ends.
  const bool compact = H5Pget_layout(properties.get()) == H5D_COMPACT;
  if (compact && static_cast<double>(H5Dget_storage_size(out.id_.get())) < bytes)
    return Error{where, text("claims ", bytes, " bytes and holds fewer"),
                 "the file is damaged; copy it again"};
  return {};
}

Expected<Hdf5Dataset> Hdf5File::dataset(const std::string& name, int dimensions) const {
  const std::string where = path_ + ": " + name;
  Hdf5Dataset out;
  if (auto status = open_dataset(name, dimensions, out); !status) return status.error();
  const auto type = Hdf5Handle(H5Dget_type(out.id_.get()), H5Tclose);
  const H5T_class_t kind = H5Tget_class(type.get());
  if (kind != H5T_INTEGER && kind != H5T_FLOAT && kind != H5T_ENUM)
    return Error{where, "does not hold numbers", "is it the right file?"};
  const auto number = number_type(type.get());
  if (!number)
    return Error{where, "holds numbers of an unusual type", "use integers and floats of 8 to 64 bits"};
  out.type_ = *number;
  return out;
}

Expected<Hdf5Dataset> Hdf5File::table(const std::string& name, std::span<const Hdf5Field> fields,
                                      std::size_t row_bytes) const {
  const std::string where = path_ + ": " + name;
  Hdf5Dataset out;
  if (auto status = open_dataset(name, 1, out); !status) return status.error();
  const auto type = Hdf5Handle(H5Dget_type(out.id_.get()), H5Tclose);
  if (H5Tget_class(type.get()) != H5T_COMPOUND)
    return Error{where, "is not a table", "is it the right file?"};
  if (!are_sound_rows(type.get()))
    return Error{where, "its rows are not numbers and texts one after the other", "is it the right file?"};
  out.row_type_ = Hdf5Handle(H5Tcreate(H5T_COMPOUND, row_bytes), H5Tclose);
  for (const Hdf5Field& field : fields) {
    const int index = H5Tget_member_index(type.get(), field.name);
    const H5T_class_t kind =
        index < 0 ? H5T_NO_CLASS : H5Tget_member_class(type.get(), static_cast<unsigned>(index));
    if (kind != H5T_INTEGER && kind != H5T_FLOAT)
      return Error{where, text("its rows have no number '", field.name, "'"), "is it the right file?"};
    H5Tinsert(out.row_type_.get(), field.name, field.offset, hdf5_types(field.type).memory);
  }
  return out;
}

}  // namespace evpose
