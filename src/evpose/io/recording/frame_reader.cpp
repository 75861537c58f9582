// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/recording/frame_reader.h"

#include <sys/stat.h>

#include "evpose/io/files/numbers.h"
#include "evpose/io/files/png_file.h"
#include "evpose/io/files/row_reader.h"

namespace evpose {
namespace {

constexpr const char* kLayout = "write rows of t_ns,file[,exposure_ns]";
constexpr TimeNs kLongestExposure = 10 * kNsPerS;

bool exists(const std::string& path) {
  struct stat info = {};
  return ::stat(path.c_str(), &info) == 0;
}

/// Beside the list, or in `data` there.
Expected<std::string> find_picture(const std::string& csv, const std::string& name,
                                   const std::string& where) {
  const std::string folder = csv.substr(0, csv.rfind('/') + 1);
  for (const std::string& path : {folder + name, folder + "data/" + name})
    if (exists(path)) return path;
  return Error{where, "the picture '" + name + "' is not there", "copy it to " + folder + "data"};
}

Expected<FrameReader::Row> parse(const RowReader& rows, const std::string& csv,
                                 const FrameReadOptions& options) {
  const auto& fields = rows.fields();
  FrameReader::Row row{0, options.exposure, ""};
  if (fields.size() < 2 || !parse_integer(trimmed(fields[0]), row.t))
    return Error{rows.where(), text("'", rows.line(), "' is no row of a list of frames"), kLayout};
  if (fields.size() > 2 && !parse_integer(trimmed(fields[2]), row.exposure))
    return Error{rows.where(), text("'", fields[2], "' is no exposure in nanoseconds"), kLayout};
  if (row.exposure < 0 || row.exposure > kLongestExposure || std::abs(row.t) > kLargestTimeNs)
    return Error{rows.where(), "time or exposure is out of range", "give nanoseconds"};
  const std::string name(trimmed(fields[1]));
  if (name.empty() || name.find("..") != std::string::npos || name.front() == '/')
    return Error{rows.where(), "'" + name + "' does not stay inside the folder", "name a file below it"};
  auto path = find_picture(csv, name, rows.where());
  if (!path) return path.error();
  row.path = *std::move(path);
  row.t += options.offset_ns;
  if (options.stamp == FrameReadOptions::Stamp::start) row.t += row.exposure / 2;
  if (options.stamp == FrameReadOptions::Stamp::end) row.t -= row.exposure / 2;
  return row;
}

bool inside(const FrameReadOptions& options, TimeNs t) {
  return (!options.t_start_ns || t >= *options.t_start_ns) && (!options.t_end_ns || t < *options.t_end_ns);
}

}  // namespace

Expected<FrameReader> FrameReader::open(const std::string& csv, const FrameReadOptions& options) {
  auto rows = RowReader::open(csv);
  if (!rows) return rows.error();
  std::vector<Row> out;
  std::optional<TimeNs> last;
  while (true) {
    const auto more = rows->next();
    if (!more) return more.error();
    if (!*more) break;
    auto row = parse(*rows, csv, options);
    if (!row) return row.error();
    if (last && row->t <= *last)
      return Error{rows->where(), "the frame does not come after the one before",
                   "sort the rows and remove repeated ones"};
    last = row->t;
    if (inside(options, row->t)) out.push_back(*std::move(row));
  }
  if (!last) return Error{csv, "lists no frames", "remove it, or record again"};
  return FrameReader(std::move(out), options.size);
}

Expected<bool> FrameReader::next(Frame& frame) {
  if (next_ == rows_.size()) return false;
  const Row& row = rows_[next_++];
  auto picture = read_png_grey8(row.path);
  if (!picture) return picture.error();
  const ImageSize size{picture->width, picture->height};
  if (size_ != ImageSize{} && size != size_)
    return Error{row.path,
                 text("is ", size.width, " x ", size.height, " pixels, the calibration's are ", size_.width,
                      " x ", size_.height),
                 "frames have to be of the event camera's own pixels"};
  frame = {row.t, row.exposure, size, std::move(picture->pixels)};
  return true;
}

}  // namespace evpose
