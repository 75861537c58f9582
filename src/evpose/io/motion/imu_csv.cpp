// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/motion/imu_csv.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "evpose/core/log.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/io/files/numbers.h"
#include "evpose/io/files/row_reader.h"

namespace evpose {
namespace {

constexpr double kStandardGravity = 9.80665;  // m/s^2 in one g, by definition
const std::string kHeader = "#timestamp_ns,wx,wy,wz,ax,ay,az";
const std::vector<std::string> kColumns = {"timestamp_ns", "wx", "wy", "wz", "ax", "ay", "az"};
// The same columns under EuRoC's names.
const std::string kEurocHeader = "#timestamp [ns],w_RS_S_x [rad s^-1],";

/// Where each of kColumns stands in a row.
Expected<std::array<std::size_t, 7>> places_of(const std::vector<std::string>& columns,
                                               const std::string& path) {
  std::array<std::size_t, 7> places{};
  for (std::size_t k = 0; k < kColumns.size(); ++k) {
    const auto it = std::find(columns.begin(), columns.end(), kColumns[k]);
    if (it == columns.end())
      return Error{
          path, "imu.columns names no column '" + kColumns[k] + "'",
          "imu.columns needs timestamp_ns, wx, wy, wz, ax, ay, az, and any other name for what is ignored"};
    places[k] = static_cast<std::size_t>(it - columns.begin());
  }
  return places;
}

Status read_header(LineReader& lines) {
  std::string_view line;
  const auto more = lines.next(line);
  if (!more) return more.error();
  if (!*more) return Error{lines.where(), "the file is empty", "store the IMU's samples, or remove it"};
  if (line != kHeader && !line.starts_with(kEurocHeader))
    return Error{lines.where(), "the first line is not '" + kHeader + "'",
                 "write that line, or name the columns by imu.columns in recording.yaml"};
  return {};
}

}  // namespace

struct ImuReader::Impl {
  Impl(std::optional<RowReader> reader, ImuReadOptions how)
      : rows(std::move(reader)), options(std::move(how)) {}

  std::optional<RowReader> rows;  ///< unset: samples
  std::string path;
  std::shared_ptr<const std::vector<ImuSample>> samples;
  std::size_t next_sample = 0;
  ImuReadOptions options;
  std::array<std::size_t, 7> places{};
  std::size_t columns = 7;
  bool first = true;
  TimeNs last = 0;
  int gaps = 0;
  double longest_gap_s = 0;
  std::int64_t longest_gap_line = 0;

  std::int64_t number() const { return rows ? rows->number() : static_cast<std::int64_t>(next_sample) - 1; }
  std::string where() const {
    return rows ? rows->where() : text(path, ": IMU sample ", number(), " (from 0)");
  }
  Expected<bool> read_one(ImuSample& sample);
  Expected<bool> read_row(ImuSample& sample);
  Status parse(ImuSample& sample) const;
  Status check_time(TimeNs t);
};

Status ImuReader::Impl::parse(ImuSample& sample) const {
  const auto& fields = rows->fields();
  if (fields.size() != columns)
    return Error{where(), text(fields.size(), " values instead of ", columns),
                 "is the line cut off, or does imu.columns fit?"};
  const int decimals = options.time_unit == "s" ? 9 : options.time_unit == "us" ? 3 : 0;
  if (!parse_decimal(fields[places[0]], decimals, sample.t))
    return Error{where(), text("'", fields[places[0]], "' is not a stamp in ", options.time_unit),
                 "correct the line, or set imu.time_unit"};
  std::array<double, 6> values{};
  for (std::size_t k = 0; k < 6; ++k) {
    const std::string_view field = fields[places[k + 1]];
    if (!parse_number(field, values[k]) || !std::isfinite(values[k]) || std::abs(values[k]) > 1e9)
      return Error{where(), text(kColumns[k + 1], " = '", field, "' is not a finite number"),
                   "correct or remove the sample"};
  }
  const double gyro_scale = options.gyro_in_degrees ? std::numbers::pi / 180 : 1;
  const double accel_scale = options.accel_in_g ? kStandardGravity : 1;
  sample.gyro = gyro_scale * Eigen::Vector3d(values[0], values[1], values[2]);
  sample.accel = accel_scale * Eigen::Vector3d(values[3], values[4], values[5]);
  return {};
}

Status ImuReader::Impl::check_time(TimeNs t) {
  if (t > kLargestTimeNs || t < -kLargestTimeNs)
    return Error{where(), text("the stamp ", t, " ns is out of range"), "set imu.time_unit"};
  if (first) return {};
  if (t <= last)
    return Error{where(),
                 t == last ? text("the stamp ", t, " ns stands twice")
                           : text("the stamp ", t, " ns goes back behind ", last, " ns"),
                 "sort the file and remove repeated samples"};
  const double gap_s = to_seconds(t - last);
  if (gap_s > options.max_gap_s)
    return Error{where(),
                 text("a gap of ", gap_s, " s before this sample, more than ", options.max_gap_s, " s"),
                 "crop the recording by time.t_start_s and time.t_end_s, or remove the IMU file"};
  if (gap_s > options.warn_gap_s) {
    ++gaps;
    if (gap_s > longest_gap_s) longest_gap_s = gap_s, longest_gap_line = number();
  }
  return {};
}

Expected<bool> ImuReader::Impl::read_one(ImuSample& sample) {
  if (!rows) {
    if (next_sample == samples->size()) return false;
    sample = (*samples)[next_sample++];
    return true;
  }
  const auto more = rows->next();
  if (!more || !*more) return more;
  if (auto status = parse(sample); !status) return status.error();
  return true;
}

Expected<bool> ImuReader::Impl::read_row(ImuSample& sample) {
  while (true) {
    auto more = read_one(sample);
    if (!more || !*more) return more;
    const TimeNs margin = from_seconds(options.max_gap_s);
    if (options.t_end_ns && sample.t > *options.t_end_ns && sample.t - margin > *options.t_end_ns)
      return false;
    if (options.t_start_ns && sample.t < *options.t_start_ns && sample.t + margin < *options.t_start_ns)
      continue;
    return true;
  }
}

ImuReader::ImuReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ImuReader::ImuReader(ImuReader&& other) noexcept = default;
ImuReader& ImuReader::operator=(ImuReader&& other) noexcept = default;
ImuReader::~ImuReader() = default;

Expected<ImuReader> ImuReader::open(const std::string& path, const ImuReadOptions& options) {
  if (options.time_unit != "ns" && options.time_unit != "us" && options.time_unit != "s")
    return Error{path, "imu.time_unit '" + options.time_unit + "' is unknown", "use ns, us or s"};
  auto lines = LineReader::open(path);
  if (!lines) return lines.error();
  const auto& columns = options.columns.empty() ? kColumns : options.columns;
  const auto places = places_of(columns, path);
  if (!places) return places.error();
  // With named columns the first line may be data already.
  if (options.columns.empty()) {
    if (auto status = read_header(*lines); !status) return status.error();
  }
  auto impl = std::make_unique<Impl>(RowReader(*std::move(lines)), options);
  impl->places = *places;
  impl->columns = columns.size();
  return ImuReader(std::move(impl));
}

Expected<ImuReader> ImuReader::of_samples(const std::string& path,
                                          std::shared_ptr<const std::vector<ImuSample>> samples,
                                          const ImuReadOptions& options) {
  auto impl = std::make_unique<Impl>(std::nullopt, options);
  impl->path = path;
  impl->samples = std::move(samples);
  return ImuReader(std::move(impl));
}

Expected<bool> ImuReader::next(ImuSample& sample) {
  Impl& m = *impl_;
  const auto more = m.read_row(sample);
  if (!more) return more.error();
  if (!*more) {
    if (m.gaps > 0)
      log_warning(text(m.where(), ": ", m.gaps, " gaps of more than ", m.options.warn_gap_s,
                       " s, the longest ", m.longest_gap_s, " s before line ", m.longest_gap_line));
    m.gaps = 0;
    return false;
  }
  if (auto status = m.check_time(sample.t); !status) return status.error();
  m.first = false;
  m.last = sample.t;
  return true;
}

Expected<std::vector<ImuSample>> read_imu_csv(const std::string& path, const ImuReadOptions& options) {
  auto reader = ImuReader::open(path, options);
  if (!reader) return reader.error();
  std::vector<ImuSample> samples;
  ImuSample sample;
  while (true) {
    const auto more = reader->next(sample);
    if (!more) return more.error();
    if (!*more) return samples;
    samples.push_back(sample);
  }
}

Status write_imu_csv(const std::string& path, const std::vector<ImuSample>& samples) {
  auto file = AtomicFile::create(path);
  if (!file) return file.error();
  file->write(kHeader + "\n");
  const ImuSample* before = nullptr;
  for (const ImuSample& s : samples) {
    EVPOSE_CHECK(before == nullptr || before->t < s.t);
    EVPOSE_CHECK(s.gyro.allFinite() && s.accel.allFinite() && s.gyro.norm() < 1e9 && s.accel.norm() < 1e9);
    std::string line = std::to_string(s.t);
    for (const Eigen::Vector3d& v : {s.gyro, s.accel})
      for (int k = 0; k < 3; ++k) append_number(line, ',', v[k], 9);
    file->write(line + "\n");
    before = &s;
  }
  return file->commit();
}

}  // namespace evpose
