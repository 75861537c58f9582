// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/motion/imu_text.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "evpose/core/log.h"
#include "evpose/io/files/row_reader.h"

namespace evpose {
namespace {

constexpr std::size_t kColumns = 7;
constexpr std::size_t kSampleRows = 1000;
const std::string kRow =
    "a sample is a stamp, three rates and three accelerations; or name the columns by imu.columns";

struct Sample {
  std::vector<std::array<double, kColumns>> rows;
  std::size_t columns = 0;
};

Expected<Sample> read_sample(const std::string& path) {
  auto rows = RowReader::open(path);
  if (!rows) return rows.error();
  Sample out;
  while (out.rows.size() < kSampleRows) {
    const auto more = rows->next();
    if (!more) return more.error();
    if (!*more) break;
    const std::size_t columns = rows->fields().size();
    if (out.rows.empty()) out.columns = columns;
    if (columns < kColumns || columns != out.columns)
      return Error{rows->where(), text(columns, " values"), kRow};
    if (auto status = rows->numbers(0, out.rows.emplace_back(), kRow); !status) return status.error();
  }
  if (out.rows.size() < 2) return Error{path, "holds fewer than two samples", kRow};
  return out;
}

/// IMUs run at 10 Hz to 10 kHz.
std::string unit_of(const Sample& sample) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < sample.rows.size(); ++i)
    steps.push_back(sample.rows[i][0] - sample.rows[i - 1][0]);
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle < 1 ? "s" : *middle <= 1e5 ? "us" : "ns";
}

bool is_gravity(const Sample& sample, std::size_t column) {
  double sum = 0;
  for (const auto& row : sample.rows) sum += std::hypot(row[column], row[column + 1], row[column + 2]);
  const double mean = sum / static_cast<double>(sample.rows.size());
  return mean > 6 && mean < 14;
}

}  // namespace

Expected<ImuReadOptions> recognise_imu_text(const std::string& path) {
  const auto sample = read_sample(path);
  if (!sample) return sample.error();
  ImuReadOptions options;
  options.time_unit = unit_of(*sample);
  const bool rates_first = is_gravity(*sample, 4);
  if (!rates_first && !is_gravity(*sample, 1))
    return Error{path, "neither columns 2 to 4 nor 5 to 7 hold accelerations of about 9.81 m/s^2",
                 "name columns and units by imu.columns and imu.accel_unit in recording.yaml"};
  if (rates_first)
    options.columns = {"timestamp_ns", "wx", "wy", "wz", "ax", "ay", "az"};
  else
    options.columns = {"timestamp_ns", "ax", "ay", "az", "wx", "wy", "wz"};
  for (std::size_t k = kColumns; k < sample->columns; ++k) options.columns.push_back(text("column_", k + 1));
  log_detail(path + ": IMU samples, time in " + options.time_unit + ", " +
             (rates_first ? "rates before accelerations" : "accelerations before rates"));
  return options;
}

}  // namespace evpose
