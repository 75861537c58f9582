// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/maps/pcd.h"

#include <array>
#include <cmath>
#include <cstring>
#include <span>

#include "evpose/core/log.h"
#include "evpose/io/files/compression.h"
#include "evpose/io/files/input_file.h"
#include "evpose/io/files/numbers.h"

namespace evpose {
namespace {

constexpr int kMostHeaderLines = 1000;
constexpr std::int64_t kMostColumns = 10'000;

struct Field {
  std::string name;
  std::size_t size = 4;   ///< bytes of an item
  char type = 'F';        ///< F float, I signed, U unsigned
  std::size_t count = 1;  ///< items
};

struct Header {
  std::vector<Field> fields;
  std::int64_t points = -1, width = -1, height = 1;
  std::optional<std::array<double, 3>> viewpoint;
  std::string data;  ///< ascii, binary or binary_compressed

  std::size_t row_bytes() const {
    std::size_t bytes = 0;
    for (const auto& f : fields) bytes += f.size * f.count;
    return bytes;
  }
  std::size_t columns() const {
    std::size_t n = 0;
    for (const auto& f : fields) n += f.count;
    return n;
  }
};

template <class T>
double as(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return static_cast<double>(value);
}

double decode(const Field& field, const char* bytes) {
  switch (field.type) {
    case 'F':
      return field.size == 4 ? as<float>(bytes) : as<double>(bytes);
    case 'I':
      return field.size == 1   ? as<std::int8_t>(bytes)
             : field.size == 2 ? as<std::int16_t>(bytes)
             : field.size == 4 ? as<std::int32_t>(bytes)
                               : as<std::int64_t>(bytes);
    default:
      return field.size == 1   ? as<std::uint8_t>(bytes)
             : field.size == 2 ? as<std::uint16_t>(bytes)
             : field.size == 4 ? as<std::uint32_t>(bytes)
                               : as<std::uint64_t>(bytes);
  }
}

bool is_known(const Field& f) {
  if (f.type == 'F') return f.size == 4 || f.size == 8;
  return (f.type == 'I' || f.type == 'U') && (f.size == 1 || f.size == 2 || f.size == 4 || f.size == 8);
}

/// One line of the header; false when it is not understood.
bool add_header_line(const std::vector<std::string_view>& words, Header& header) {
  const std::string_view key = words[0];
  if (key == "VERSION") return true;
  if (key == "VIEWPOINT") {
    std::array<double, 3> at{};
    bool known = words.size() >= 4;
    for (std::size_t k = 0; k < 3 && known; ++k)
      known = parse_number(words[k + 1], at[k]) && std::isfinite(at[k]);
    if (known && at != std::array<double, 3>{}) header.viewpoint = at;
    return true;
  }
  if (key == "FIELDS") {
    for (std::size_t i = 1; i < words.size(); ++i) header.fields.push_back({.name = std::string(words[i])});
    return words.size() > 1;
  }
  std::int64_t value = 0;
  if (key == "SIZE" || key == "TYPE" || key == "COUNT") {
    if (words.size() != header.fields.size() + 1) return false;
    for (std::size_t i = 1; i < words.size(); ++i) {
      Field& field = header.fields[i - 1];
      if (key == "TYPE") {
        if (words[i].size() != 1) return false;
        field.type = words[i][0];
        continue;
      }
      if (!parse_integer(words[i], value) || value < 1 || value > kMostColumns) return false;
      (key == "SIZE" ? field.size : field.count) = static_cast<std::size_t>(value);
    }
    return true;
  }
  if (words.size() != 2) return false;
  if (key == "DATA") {
    header.data = words[1];
    return true;
  }
  std::int64_t* target = key == "WIDTH"    ? &header.width
                         : key == "HEIGHT" ? &header.height
                         : key == "POINTS" ? &header.points
                                           : nullptr;
  return target != nullptr && parse_integer(words[1], *target) && *target >= 0 &&
         *target < (std::int64_t{1} << 31);
}

Expected<Header> read_header(LineReader& lines, const std::string& path) {
  Header header;
  std::vector<std::string_view> words;
  std::string_view line;
  for (int i = 0; i < kMostHeaderLines && header.data.empty(); ++i) {
    const auto more = lines.next(line);
    if (!more) return more.error();
    if (!*more)
      return Error{path, text("the PCD header has no DATA line (", lines.size(), " bytes)"), "copy it again"};
    line = trimmed(line);
    if (line.empty() || line.front() == '#') continue;
    split_fields(line, words);
    if (!add_header_line(words, header))
      return Error{lines.where(),
                   text("PCD header: a line '", words[0].substr(0, 40), " ...' that is not understood"),
                   "write a PCD 0.7 file"};
  }
  if (header.points < 0 && header.width >= 0) header.points = header.width * header.height;
  if (header.points < 0 || header.points >= (std::int64_t{1} << 31) || header.fields.empty())
    return Error{path, "PCD header: FIELDS or POINTS is missing", "write a PCD 0.7 file"};
  for (const Field& f : header.fields)
    if (!is_known(f))
      return Error{path, text("PCD header: field '", f.name, "' of type ", f.type, f.size, " is unknown"),
                   "use F 4 or 8, I or U 1, 2, 4 or 8"};
  if (header.columns() > static_cast<std::size_t>(kMostColumns))
    return Error{path, text("PCD header: ", header.columns(), " columns"), "write a PCD 0.7 file"};
  return header;
}

PointTable empty_table(const Header& header) {
  PointTable table;
  for (const Field& f : header.fields)
    for (std::size_t i = 0; i < f.count; ++i)
      table.names.push_back(f.count == 1 ? f.name : f.name + "_" + std::to_string(i));
  table.columns.resize(table.names.size());
  return table;
}

Status read_ascii(LineReader& lines, const Header& header, PointTable& table) {
  std::vector<std::string_view> words;
  std::string_view line;
  std::int64_t rows = 0;
  while (true) {
    const auto more = lines.next(line);
    if (!more) return more.error();
    if (!*more) break;
    if (trimmed(line).empty()) continue;
    split_fields(line, words);
    if (++rows > header.points)
      return Error{lines.where(), text("more rows than the header's ", header.points),
                   "correct the header or the data"};
    if (words.size() != table.columns.size())
      return Error{lines.where(), text(words.size(), " values instead of ", table.columns.size()),
                   "the file is truncated or damaged; copy it again"};
    for (std::size_t k = 0; k < words.size(); ++k) {
      double value = 0;
      if (!parse_number(words[k], value))
        return Error{lines.where(), text("'", words[k], "' is not a number"), "correct the line"};
      table.columns[k].push_back(value);
    }
  }
  if (rows != header.points)
    return Error{lines.where(), text("the file ends after ", rows, " of ", header.points, " points"),
                 "the file is truncated; copy it again"};
  return {};
}

/// `stride` bytes from one point to the next in `bytes`, whose fields stand at their `offset`.
void decode_column(const Field& field, const char* bytes, std::size_t stride, std::size_t points,
                   std::vector<double>& out) {
  out.resize(points);
  for (std::size_t i = 0; i < points; ++i) out[i] = decode(field, bytes + i * stride);
}

Error wrong_size(const std::string& path, double expected, std::int64_t found) {
  return Error{path, text("the header promises ", expected, " bytes of data, the file has ", found),
               "the file is truncated or damaged; copy it again"};
}

Status read_binary(const std::string& path, const std::string& data, const Header& header,
                   PointTable& table) {
  const auto points = static_cast<std::size_t>(header.points);
  const double expected = static_cast<double>(header.row_bytes()) * static_cast<double>(points);
  if (expected != static_cast<double>(data.size()))
    return wrong_size(path, expected, static_cast<std::int64_t>(data.size()));
  std::size_t offset = 0, column = 0;
  for (const Field& f : header.fields)
    for (std::size_t i = 0; i < f.count; ++i, offset += f.size)
      decode_column(f, data.data() + offset, header.row_bytes(), points, table.columns[column++]);
  return {};
}

Status read_compressed(const std::string& path, const std::string& data, const Header& header,
                       PointTable& table) {
  const auto points = static_cast<std::size_t>(header.points);
  if (data.size() < 8) return wrong_size(path, 8, static_cast<std::int64_t>(data.size()));
  std::uint32_t packed = 0, unpacked = 0;
  std::memcpy(&packed, data.data(), 4);
  std::memcpy(&unpacked, data.data() + 4, 4);
  // Some writers pad after the block.
  if (packed > data.size() - 8) return wrong_size(path, 8.0 + packed, static_cast<std::int64_t>(data.size()));
  const double expected = static_cast<double>(header.row_bytes()) * static_cast<double>(points);
  if (expected != unpacked)
    return Error{path,
                 text("the compressed block stands for ", unpacked, " bytes, the header for ", expected),
                 "the file is damaged; copy it again"};
  // LZF makes at most 264 bytes of 3.
  if (static_cast<double>(unpacked) > 88.0 * packed)
    return Error{path, text(packed, " packed bytes cannot stand for ", unpacked),
                 "the file is damaged; copy it again"};
  std::vector<std::byte> bytes(unpacked);
  if (!decompress_lzf(std::as_bytes(std::span(data.data() + 8, packed)), bytes))
    return Error{path, "the compressed block is damaged", "copy the file again"};
  // Field after field; within a field, point after point with its items together.
  const char* field_begin = reinterpret_cast<const char*>(bytes.data());
  std::size_t column = 0;
  for (const Field& f : header.fields) {
    for (std::size_t i = 0; i < f.count; ++i)
      decode_column(f, field_begin + i * f.size, f.size * f.count, points, table.columns[column++]);
    field_begin += f.size * f.count * points;
  }
  return {};
}

/// Removes rows without a position, which organised clouds use for pixels without depth.
void drop_absent(const std::string& path, PointTable& table) {
  std::vector<const std::vector<double>*> position;
  for (const char* name : {"x", "y", "z"})
    if (const auto* column = table.find(name)) position.push_back(column);
  const std::size_t rows = table.rows();
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < rows; ++i) {
    bool present = true;
    for (const auto* column : position) present &= std::isfinite((*column)[i]);
    if (present) kept.push_back(i);
  }
  if (kept.size() == rows) return;
  for (auto& column : table.columns) {
    for (std::size_t i = 0; i < kept.size(); ++i) column[i] = column[kept[i]];
    column.resize(kept.size());
  }
  log_warning(
      text(path, ": ", rows - kept.size(), " of ", rows, " points have no finite position and are left out"));
}

Expected<std::string> read_rest(const std::string& path, std::int64_t offset) {
  const auto file = open_to_read(path);
  if (!file) return file.error();
  std::string data(static_cast<std::size_t>(file->size - offset), '\0');
  if (::fseeko(file->stream.get(), offset, SEEK_SET) != 0 ||
      std::fread(data.data(), 1, data.size(), file->stream.get()) != data.size())
    return Error{path, "cannot be read to its end", "check the disk"};
  return data;
}

Expected<PointTable> read_all_rows(const std::string& path) {
  auto lines = LineReader::open(path);
  if (!lines) return lines.error();
  const auto header = read_header(*lines, path);
  if (!header) return header.error();
  PointTable table = empty_table(*header);
  table.viewpoint = header->viewpoint;
  Status status;
  if (header->data == "ascii") {
    status = read_ascii(*lines, *header, table);
  } else if (header->data == "binary" || header->data == "binary_compressed") {
    const auto data = read_rest(path, lines->offset());
    if (!data) return data.error();
    status = header->data == "binary" ? read_binary(path, *data, *header, table)
                                      : read_compressed(path, *data, *header, table);
  } else {
    return Error{lines->where(), "DATA '" + header->data + "' is unknown",
                 "use ascii, binary or binary_compressed"};
  }
  if (!status) return status.error();
  return table;
}

}  // namespace

Expected<PointTable> read_pcd(const std::string& path) {
  auto table = read_all_rows(path);
  if (table) drop_absent(path, *table);
  return table;
}

Status visit_pcd(const std::string& path, const PointBlocks& visit) {
  const auto table = read_all_rows(path);
  return table ? visit(*table) : Status(table.error());
}

}  // namespace evpose
