// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/maps/las.h"

#include <array>
#include <cmath>
#include <cstring>
#include <vector>

#include "evpose/io/files/input_file.h"

namespace evpose {
namespace {

constexpr std::size_t kShortestHeader = 227;  // of LAS 1.0 .. 1.2
constexpr std::size_t kLongHeader = 375;      // of LAS 1.4
constexpr std::size_t kShortestPoint = 14;    // x y z and intensity

template <class T>
T at(const std::vector<char>& bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

}  // namespace

Status visit_las(const std::string& path, const PointBlocks& visit) {
  const auto file = open_to_read(path);
  if (!file) return file.error();
  std::FILE* stream = file->stream.get();
  std::vector<char> head(kLongHeader, 0);
  const std::size_t got = std::fread(head.data(), 1, head.size(), stream);
  if (got < kShortestHeader || std::memcmp(head.data(), "LASF", 4) != 0)
    return Error{path, text("no LAS header (", got, " bytes)"), "is it a LAS file? copy it again"};
  const auto minor = at<std::uint8_t>(head, 25);
  const auto data = at<std::uint32_t>(head, 96);
  const auto format = at<std::uint8_t>(head, 104);
  const auto row_bytes = at<std::uint16_t>(head, 105);
  std::uint64_t points = at<std::uint32_t>(head, 107);
  if (minor >= 4 && got >= kLongHeader && at<std::uint64_t>(head, 247) > 0)
    points = at<std::uint64_t>(head, 247);
  if ((format & 0xC0) != 0)
    return Error{path, "the points are compressed (LAZ)",
                 "unpack it: laszip -i IN.laz -o OUT.las, or pdal translate"};
  if (format > 10 || row_bytes < kShortestPoint)
    return Error{path, text("point format ", int{format}, " with ", row_bytes, " bytes a point is unknown"),
                 "write LAS 1.2 or 1.4"};
  const double promised = static_cast<double>(data) + static_cast<double>(points) * row_bytes;
  if (promised > static_cast<double>(file->size))
    return Error{
        path,
        text("the header promises ", points, " points, ", promised, " bytes; the file has ", file->size),
        "the file is truncated or damaged; copy it again"};
  std::array<double, 3> scale{}, offset{};
  for (std::size_t k = 0; k < 3; ++k) {
    scale[k] = at<double>(head, 131 + 8 * k);
    offset[k] = at<double>(head, 155 + 8 * k);
    if (!std::isfinite(scale[k]) || scale[k] == 0 || !std::isfinite(offset[k]))
      return Error{path, "scale or offset of the coordinates is not a number",
                   "the file is damaged; copy it again"};
  }
  PointTable block;
  block.names = {"x", "y", "z", "intensity"};
  block.columns.resize(4);
  if (::fseeko(stream, static_cast<off_t>(data), SEEK_SET) != 0)
    return Error{path, "cannot be read", "check the disk"};
  std::vector<char> rows(std::min<std::uint64_t>(kPointBlock, points) *
                         row_bytes);  // no more than the file has
  std::uint64_t done = 0;
  do {
    const std::size_t now = static_cast<std::size_t>(std::min<std::uint64_t>(kPointBlock, points - done));
    for (auto& column : block.columns) column.clear();
    if (std::fread(rows.data(), row_bytes, now, stream) != now)
      return Error{path, text("ends after ", done, " of ", points, " points"), "copy it again"};
    for (std::size_t i = 0; i < now; ++i) {
      for (std::size_t k = 0; k < 3; ++k)
        block.columns[k].push_back(at<std::int32_t>(rows, i * row_bytes + 4 * k) * scale[k] + offset[k]);
      block.columns[3].push_back(at<std::uint16_t>(rows, i * row_bytes + 12));
    }
    if (auto status = visit(block); !status) return status;
    done += now;
  } while (done < points);
  return {};
}

Expected<PointTable> read_las(const std::string& path) {
  return joined_blocks([&](const PointBlocks& visit) { return visit_las(path, visit); });
}

}  // namespace evpose
