// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/recording/depth_images.h"

#include <cstdlib>
#include <filesystem>

#include "evpose/io/files/numbers.h"
#include "evpose/io/files/row_reader.h"
#include "evpose/io/recording/frame_reader.h"

namespace evpose {
namespace {

namespace fs = std::filesystem;

bool is_file(const std::string& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

Expected<DepthImageFile> parse(const RowReader& rows, const std::string& folder) {
  const auto& fields = rows.fields();
  DepthImageFile out;
  if (fields.size() != 2 || !parse_decimal(trimmed(fields[0]), 9, out.t))
    return Error{rows.where(), text("'", rows.line(), "' is no row of a list of depth images"),
                 "write rows of `timestamp filename`, seconds"};
  if (std::abs(out.t) > kLargestTimeNs) return Error{rows.where(), "time is out of range", "give seconds"};
  const std::string name(trimmed(fields[1]));
  if (name.empty() || name.find("..") != std::string::npos || name.front() == '/')
    return Error{rows.where(), "'" + name + "' does not stay inside the folder", "name a file below it"};
  out.path = folder + "/" + name;
  if (!is_file(out.path))
    return Error{rows.where(), "the depth image '" + name + "' is not there", "copy it to " + folder};
  return out;
}

Expected<std::vector<DepthImageFile>> read_text_list(const std::string& folder, const std::string& list) {
  auto rows = RowReader::open(list);
  if (!rows) return rows.error();
  std::vector<DepthImageFile> out;
  while (true) {
    const auto more = rows->next();
    if (!more) return more.error();
    if (!*more) break;
    auto image = parse(*rows, folder);
    if (!image) return image.error();
    if (!out.empty() && image->t <= out.back().t)
      return Error{rows->where(), "the depth image does not come after the one before",
                   "sort the rows and remove repeated ones"};
    out.push_back(*std::move(image));
  }
  if (out.empty()) return Error{list, "lists no depth images", "write rows of `timestamp filename`, seconds"};
  return out;
}

}  // namespace

Expected<std::vector<DepthImageFile>> list_depth_images(const std::string& folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error))
    return Error{folder, "is no folder", "name the folder that holds depth.txt and the depth images"};
  if (const std::string list = folder + "/depth.txt"; is_file(list)) return read_text_list(folder, list);
  const std::string csv = folder + "/timestamps.csv";
  if (!is_file(csv))
    return Error{folder, "holds no depth.txt",
                 "list the depth images there, in rows of `timestamp filename`"};
  const auto reader = FrameReader::open(csv, {});
  if (!reader) return reader.error();
  std::vector<DepthImageFile> out;
  for (const FrameReader::Row& row : reader->rows()) out.push_back({row.t, row.path});
  return out;
}

}  // namespace evpose
