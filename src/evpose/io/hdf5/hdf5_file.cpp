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
#include <type_traits>
#include <utility>

#include "evpose/io/files/atomic_file.h"
#include "evpose/io/files/byte_stream.h"
#include "evpose/io/files/input_file.h"
#include "evpose/io/hdf5/hdf5_filters.h"
#include "evpose/io/hdf5/hdf5_trial.h"

namespace evpose {
namespace {

static_assert(std::is_same_v<hid_t, std::int64_t>, "Hdf5Handle holds identifiers as 64-bit numbers");

void prepare() {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  register_hdf5_filters();
}

Hdf5Handle own(hid_t id, herr_t (*close)(hid_t)) { return {id, close}; }

hid_t memory_type(NumberType type) {
  switch (type) {
    case NumberType::i8:
      return H5T_NATIVE_INT8;
    case NumberType::u8:
      return H5T_NATIVE_UINT8;
    case NumberType::i16:
      return H5T_NATIVE_INT16;
    case NumberType::u16:
      return H5T_NATIVE_UINT16;
    case NumberType::i32:
      return H5T_NATIVE_INT32;
    case NumberType::u32:
      return H5T_NATIVE_UINT32;
    case NumberType::i64:
      return H5T_NATIVE_INT64;
    case NumberType::u64:
      return H5T_NATIVE_UINT64;
    case NumberType::f32:
      return H5T_NATIVE_FLOAT;
    case NumberType::f64:
      return H5T_NATIVE_DOUBLE;
  }
  return H5I_INVALID_HID;
}

/// The type whose values are those of a stored one; half and long floats are read as double.
std::optional<NumberType> number_type(hid_t type) {
  hid_t number = type;
  Hdf5Handle base;
  if (H5Tget_class(type) == H5T_ENUM) {
    base = own(H5Tget_super(type), H5Tclose);
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

/// It takes the word of a file, too, for where the members of a row are, all of which it moves about. `type`
/// is compound.
bool are_sound_rows(hid_t type) {
  std::vector<std::pair<std::size_t, std::size_t>> members;  // begin, size
  for (int i = 0; i < H5Tget_nmembers(type); ++i) {
    const auto index = static_cast<unsigned>(i);
    const auto member = own(H5Tget_member_type(type, index), H5Tclose);
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

std::size_t size_of(NumberType type) { return H5Tget_size(memory_type(type)); }

Hdf5File Hdf5File::opened(const std::string& path) {
  Hdf5File file;
  file.path_ = path;
  std::error_code failed;
  const auto bytes = std::filesystem::file_size(path, failed);
  if (failed) return file;
  file.size_ = static_cast<std::int64_t>(bytes);
  file.id_ = own(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
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
  const auto access = own(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_libver_bounds(access.get(), H5F_LIBVER_V110, H5F_LIBVER_V110);
  const auto root = own(H5Pcreate(H5P_FILE_CREATE), H5Pclose);
  H5Pset_obj_track_times(root.get(), false);
  file.id_ = own(H5Fcreate(temporary.path().c_str(), H5F_ACC_TRUNC, root.get(), access.get()), H5Fclose);
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
    const auto object = own(H5Oopen(id_.get(), name.c_str(), H5P_DEFAULT), H5Oclose);
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
  out.id_ = own(H5Dopen2(id_.get(), name.c_str(), H5P_DEFAULT), H5Dclose);
  if (!out.id_) return Error{where, "is not a readable dataset", "copy the file again"};
  const auto space = own(H5Dget_space(out.id_.get()), H5Sclose);
  const int rank = H5Sget_simple_extent_ndims(space.get());
  if (rank < 0 || (dimensions >= 0 && rank != dimensions))
    return Error{where, text("has ", rank, " dimensions instead of ", dimensions), "is it the right file?"};
  hsize_t dims[H5S_MAX_RANK] = {};
  H5Sget_simple_extent_dims(space.get(), dims, nullptr);
  out.shape_.assign(dims, dims + rank);
  const auto properties = own(H5Dget_create_plist(out.id_.get()), H5Pclose);
  if (const std::string filter = missing_filter(properties.get()); !filter.empty())
    return Error{where, "is compressed with " + filter + ", which is not installed",
                 "install that HDF5 plug-in, or rewrite the file by h5repack -f GZIP=4"};
  const auto type = own(H5Dget_type(out.id_.get()), H5Tclose);
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
  const auto type = own(H5Dget_type(out.id_.get()), H5Tclose);
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
  const auto type = own(H5Dget_type(out.id_.get()), H5Tclose);
  if (H5Tget_class(type.get()) != H5T_COMPOUND)
    return Error{where, "is not a table", "is it the right file?"};
  if (!are_sound_rows(type.get()))
    return Error{where, "its rows are not numbers and texts one after the other", "is it the right file?"};
  out.row_type_ = own(H5Tcreate(H5T_COMPOUND, row_bytes), H5Tclose);
  for (const Hdf5Field& field : fields) {
    const int index = H5Tget_member_index(type.get(), field.name);
    const H5T_class_t kind =
        index < 0 ? H5T_NO_CLASS : H5Tget_member_class(type.get(), static_cast<unsigned>(index));
    if (kind != H5T_INTEGER && kind != H5T_FLOAT)
      return Error{where, text("its rows have no number '", field.name, "'"), "is it the right file?"};
    H5Tinsert(out.row_type_.get(), field.name, field.offset, memory_type(field.type));
  }
  return out;
}

Status Hdf5Dataset::read_rows(std::uint64_t first, std::uint64_t count, void* out) const {
  EVPOSE_CHECK(static_cast<bool>(row_type_));
  return read_as(row_type_.get(), first, count, out);
}

Status Hdf5Dataset::read(NumberType type, std::uint64_t first, std::uint64_t count, void* out) const {
  return read_as(memory_type(type), first, count, out);
}

Status Hdf5Dataset::read_as(std::int64_t memory_type, std::uint64_t first, std::uint64_t count,
                            void* out) const {
  const std::uint64_t all = rows();
  EVPOSE_CHECK(first <= all && count <= all - first);
  if (count == 0) return {};
  const auto file_space = own(H5Dget_space(id_.get()), H5Sclose);
  Hdf5Handle memory_space;
  if (!shape_.empty()) {
    std::vector<hsize_t> offset(shape_.size(), 0), extent(shape_.begin(), shape_.end());
    offset[0] = first;
    extent[0] = count;
    H5Sselect_hyperslab(file_space.get(), H5S_SELECT_SET, offset.data(), nullptr, extent.data(), nullptr);
    memory_space = own(H5Screate_simple(static_cast<int>(extent.size()), extent.data(), nullptr), H5Sclose);
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
  const auto attribute = own(H5Aopen(id_.get(), name.c_str(), H5P_DEFAULT), H5Aclose);
  const auto space = own(H5Aget_space(attribute.get()), H5Sclose);
  std::uint32_t value = 0;
  if (H5Sget_simple_extent_npoints(space.get()) != 1 ||
      H5Aread(attribute.get(), H5T_NATIVE_UINT32, &value) < 0)
    return std::nullopt;
  return value;
}

}  // namespace evpose
