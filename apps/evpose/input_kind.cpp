// SPDX-License-Identifier: BSD-3-Clause
#include "input_kind.h"

#include <algorithm>
#include <filesystem>

#include "evpose/io/files/input_file.h"
#include "evpose/io/files/numbers.h"
#include "evpose/io/formats/event_formats.h"
#include "evpose/io/hdf5/hdf5_file.h"
#include "evpose/io/motion/imu_text.h"
#include "evpose/io/motion/trajectory.h"

namespace evpose {
namespace {

bool ends_with_any(const std::string& path, std::initializer_list<const char*> endings) {
  return std::any_of(endings.begin(), endings.end(), [&](const char* e) { return path.ends_with(e); });
}

/// Values in the first row of a text file that is no comment or heading; 0: no text.
Expected<std::size_t> columns_of(const std::string& path) {
  auto lines = LineReader::open(path);
  if (!lines) return lines.error();
  std::string_view line;
  std::vector<std::string_view> fields;
  for (int tries = 0; tries < 1000; ++tries) {
    const auto more = lines->next(line);
    if (!more || !*more) break;
    line = trimmed(line);
    double first = 0;
    split_fields(line, fields);
    if (line.empty() || line.front() == '#' || line.front() == '%' || !parse_number(fields[0], first))
      continue;
    return fields.size();
  }
  return std::size_t{0};
}

Expected<InputKind> kind_of_text(const std::string& path) {
  const auto columns = columns_of(path);
  if (!columns) return columns.error();
  if (*columns == 4) return InputKind::events;
  if (path.ends_with(".tum")) return InputKind::trajectory;
  if (*columns >= 7 && (recognise_imu_text(path) || ImuReader::open(path))) {
    // Eight columns may also be a trajectory: its last four are a unit quaternion.
    if (*columns != 8 || !read_trajectory(path)) return InputKind::imu;
  }
  if (*columns >= 8) return InputKind::trajectory;
  return Error{path, "is nothing that evpose reads",
               "give events, IMU, a trajectory, a calibration or a map"};
}

}  // namespace

Expected<InputKind> kind_of_input(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    const auto format = find_event_format(path, "");
    return format && std::string(format.value()->name) == "rosbag2" ? InputKind::events
                                                                    : InputKind::recording;
  }
  if (const auto file = open_to_read(path); !file) return file.error();
  if (ends_with_any(path, {".yaml", ".yml", ".json"}) ||
      std::filesystem::path(path).filename() == "calib.txt")
    return InputKind::calibration;
  if (ends_with_any(path, {".ply", ".pcd", ".las"})) return InputKind::map;
  const auto format = find_event_format(path, "");
  if (!format) return format.error();
  const std::string name = (*format)->name;
  if (name == "text") return kind_of_text(path);
  if (name == "h5") {
    const auto file = Hdf5File::open(path);
    if (file && file->has("/meta") && file->has("/points")) return InputKind::map;
  }
  return InputKind::events;
}

}  // namespace evpose
