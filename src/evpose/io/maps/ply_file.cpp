// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/maps/ply_file.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "evpose/io/files/numbers.h"

namespace evpose {
namespace {

static_assert(std::endian::native == std::endian::little, "files are read and written by copying bytes");

constexpr int kMostHeaderLines = 10'000;
constexpr std::uint64_t kMostRows = std::uint64_t{1} << 31;

std::size_t size_of(PlyType type) {
  switch (type) {
    case PlyType::i8:
    case PlyType::u8:
      return 1;
    case PlyType::i16:
    case PlyType::u16:
      return 2;
    case PlyType::i32:
    case PlyType::u32:
    case PlyType::f32:
      return 4;
    case PlyType::f64:
      return 8;
  }
  return 0;
}

std::optional<PlyType> type_of(std::string_view name) {
  constexpr std::pair<std::string_view, PlyType> kNames[] = {
      {"char", PlyType::i8},    {"int8", PlyType::i8},     {"uchar", PlyType::u8},
      {"uint8", PlyType::u8},   {"short", PlyType::i16},   {"int16", PlyType::i16},
      {"ushort", PlyType::u16}, {"uint16", PlyType::u16},  {"int", PlyType::i32},
      {"int32", PlyType::i32},  {"uint", PlyType::u32},    {"uint32", PlyType::u32},
      {"float", PlyType::f32},  {"float32", PlyType::f32}, {"double", PlyType::f64},
      {"float64", PlyType::f64}};
  for (const auto& [known, type] : kNames)
    if (known == name) return type;
  return std::nullopt;
}

template <class T>
double as(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return static_cast<double>(value);
}

double decode(PlyType type, const char* bytes) {
  switch (type) {
    case PlyType::i8:
      return as<std::int8_t>(bytes);
    case PlyType::u8:
      return as<std::uint8_t>(bytes);
    case PlyType::i16:
      return as<std::int16_t>(bytes);
    case PlyType::u16:
      return as<std::uint16_t>(bytes);
    case PlyType::i32:
      return as<std::int32_t>(bytes);
    case PlyType::u32:
      return as<std::uint32_t>(bytes);
    case PlyType::f32:
      return as<float>(bytes);
    case PlyType::f64:
      return as<double>(bytes);
  }
  return 0;
}

/// Bytes of a row, lists at their shortest.
std::size_t least_bytes(const PlyElement& element) {
  std::size_t bytes = 0;
  for (const auto& p : element.properties) bytes += size_of(p.count_type.value_or(p.type));
  return bytes;
}

bool has_lists(const PlyElement& element) {
  return std::any_of(element.properties.begin(), element.properties.end(),
                     [](const PlyProperty& p) { return p.count_type.has_value(); });
}

}  // namespace

const PlyProperty* PlyElement::find(const std::string& property) const {
  for (const auto& p : properties)
    if (p.name == property) return &p;
  return nullptr;
}

Expected<PlyFile> PlyFile::open(const std::string& path) {
  auto lines = LineReader::open(path);
  if (!lines) return lines.error();
  PlyFile file(*std::move(lines));
  file.path_ = path;
  if (auto status = file.read_header(); !status) return status.error();
  file.data_bytes_ = file.lines_.size() - file.lines_.offset();
  if (auto status = file.check_size(); !status) return status.error();
  if (file.format_ == PlyFormat::ascii) return file;
  auto binary = open_to_read(path);
  if (!binary) return binary.error();
  file.binary_ = *std::move(binary);
  if (::fseeko(file.binary_.stream.get(), file.lines_.offset(), SEEK_SET) != 0)
    return Error{path, "cannot be read", "check the disk"};
  return file;
}

Error PlyFile::header_error(const std::string& what) const {
  return Error{lines_.where(), "PLY header: " + what, "write a PLY 1.0 file"};
}

Status PlyFile::read_header() {
  std::string_view line;
  bool has_format = false;
  for (int i = 0; i < kMostHeaderLines; ++i) {
    const auto more = lines_.next(line);
    if (!more) return more.error();
    if (!*more)
      return Error{path_, text("the PLY header has no end_header (", lines_.size(), " bytes)"),
                   "copy it again"};
    split_fields(line, words_);
    if (i == 0) {
      if (line != "ply")
        return Error{path_, "is not a PLY file: its first line is not 'ply'", "check the format"};
      continue;
    }
    // Free text: commas in it are no separators.
    if (words_.empty() || line.starts_with("comment") || line.starts_with("obj_info")) continue;
    if (words_[0] == "end_header") {
      if (!has_format) return header_error("no format line");
      return {};
    }
    has_format |= words_[0] == "format";
    if (auto status = add_header_line(words_); !status) return status;
  }
  return header_error("too long");
}

Status PlyFile::add_header_line(const std::vector<std::string_view>& words) {
  const std::string line_start(words[0]);
  if (line_start == "format" && words.size() == 3) {
    if (words[1] == "ascii") {
      format_ = PlyFormat::ascii;
    } else if (words[1] == "binary_little_endian") {
      format_ = PlyFormat::little;
    } else if (words[1] == "binary_big_endian") {
      format_ = PlyFormat::big;
    } else {
      return header_error(text("format '", words[1], "' is unknown"));
    }
    return {};
  }
  if (line_start == "element" && words.size() == 3) {
    std::int64_t count = 0;
    if (!parse_integer(words[2], count) || count < 0 || static_cast<std::uint64_t>(count) >= kMostRows)
      return header_error(text("'", words[2], "' is not a number of rows"));
    elements_.push_back({std::string(words[1]), static_cast<std::uint64_t>(count), {}});
    return {};
  }
  if (line_start == "property" && !elements_.empty()) {
    const bool is_list = words.size() == 5 && words[1] == "list";
    const auto type = words.size() >= 3 ? type_of(words[is_list ? 3 : 1]) : std::nullopt;
    const auto count_type = is_list ? type_of(words[2]) : std::nullopt;
    if ((words.size() == 3 || is_list) && type && is_list == count_type.has_value()) {
      PlyProperty property{std::string(words.back()), *type, count_type};
      if (elements_.back().find(property.name) != nullptr)
        return header_error("property '" + property.name + "' twice");
      elements_.back().properties.push_back(std::move(property));
      return {};
    }
  }
  return header_error("a line '" + line_start + " ...' that is not understood");
}

Status PlyFile::check_size() {
  double least = 0;
  bool exact = format_ != PlyFormat::ascii;
  for (const auto& element : elements_) {
    // In text a value takes a digit and what parts it from the next.
    const std::size_t row =
        format_ == PlyFormat::ascii ? 2 * element.properties.size() : least_bytes(element);
    least += static_cast<double>(row) * static_cast<double>(element.count);
    exact &= !has_lists(element);
  }
  if (format_ == PlyFormat::ascii) least -= 1;  // the last line may lack its end
  if (least > static_cast<double>(data_bytes_) || (exact && least != static_cast<double>(data_bytes_)))
    return Error{path_,
                 text("the header promises ", exact ? "" : "at least ", least,
                      " bytes of data, the file has ", data_bytes_),
                 "the file is truncated or damaged; copy it again"};
  return {};
}

Error PlyFile::ended() const {
  return Error{path_, text("the data end early, after ", read_bytes_, " of ", data_bytes_, " bytes of data"),
               "the file is truncated or damaged; copy it again"};
}

bool PlyFile::scalar(PlyType type, double& out) {
  std::array<char, 8> bytes{};
  const std::size_t size = size_of(type);
  if (std::fread(bytes.data(), 1, size, binary_.stream.get()) != size) return false;
  if (format_ == PlyFormat::big)
    std::reverse(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
  out = decode(type, bytes.data());
  read_bytes_ += static_cast<std::int64_t>(size);
  return true;
}

Status PlyFile::list(const PlyProperty& property, std::vector<double>& out) {
  out.clear();
  double count = 0;
  if (!scalar(*property.count_type, count)) return ended();
  const double most =
      static_cast<double>(data_bytes_ - read_bytes_) / static_cast<double>(size_of(property.type));
  if (!(count >= 0 && count <= most))
    return Error{path_,
                 text("a list of ", count, " at byte ", read_bytes_, " of the data, the rest holds ", most),
                 "the file is truncated or damaged; copy it again"};
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    double value = 0;
    if (!scalar(property.type, value)) return ended();
    out.push_back(value);
  }
  return {};
}

Status PlyFile::read_binary(const PlyElement& element, std::vector<double>& values,
                            std::vector<std::vector<double>>& lists) {
  std::size_t list_number = 0;
  for (const auto& property : element.properties) {
    if (property.count_type) {
      if (auto status = list(property, lists[list_number++]); !status) return status;
      continue;
    }
    double value = 0;
    if (!scalar(property.type, value)) return ended();
    values.push_back(value);
  }
  return {};
}

Status PlyFile::read_ascii(const PlyElement& element, std::vector<double>& values,
                           std::vector<std::vector<double>>& lists) {
  std::string_view line;
  const auto more = lines_.next(line);
  if (!more) return more.error();
  if (!*more)
    return Error{text(path_, ":", lines_.number()), "the file ends before the last " + element.name,
                 "the file is truncated; copy it again"};
  split_fields(line, words_);
  std::size_t word = 0, list_number = 0;
  const auto number = [&](double& out) { return word < words_.size() && parse_number(words_[word++], out); };
  const Error wrong{lines_.where(), "not the numbers that the header promises for '" + element.name + "'",
                    "the file is truncated or damaged; copy it again"};
  for (const auto& property : element.properties) {
    double value = 0;
    if (!number(value)) return wrong;
    if (!property.count_type) {
      values.push_back(value);
      continue;
    }
    if (!(value >= 0 && value <= static_cast<double>(words_.size()))) return wrong;
    auto& list = lists[list_number++];
    list.resize(static_cast<std::size_t>(value));
    for (double& item : list)
      if (!number(item)) return wrong;
  }
  if (word != words_.size()) return wrong;
  return {};
}

Status PlyFile::read_row(const PlyElement& element, std::vector<double>& values,
                         std::vector<std::vector<double>>& lists) {
  values.clear();
  lists.resize(element.properties.size());
  if (element.properties.empty()) return {};
  return format_ == PlyFormat::ascii ? read_ascii(element, values, lists)
                                     : read_binary(element, values, lists);
}

Status PlyFile::finish() {
  if (format_ != PlyFormat::ascii) {
    if (read_bytes_ != data_bytes_)
      return Error{path_, text(data_bytes_, " bytes of data, the header promises ", read_bytes_),
                   "copy the file again"};
    return {};
  }
  std::string_view line;
  while (true) {
    const auto more = lines_.next(line);
    if (!more) return more.error();
    if (!*more) return {};
    if (!trimmed(line).empty())
      return Error{lines_.where(), "more lines than the header promises", "correct the header or the data"};
  }
}

}  // namespace evpose
