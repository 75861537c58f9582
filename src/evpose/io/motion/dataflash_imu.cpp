// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <map>
#include <numbers>
#include <optional>

#include "evpose/io/files/numbers.h"
#include "evpose/io/motion/dataflash.h"

namespace evpose {
namespace {

constexpr std::array<const char*, 7> kColumns = {"TimeUS", "GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ"};
constexpr std::int64_t kLongestTimeUs = kLargestTimeNs / kNsPerUs;

bool is_imu(const DataFlashType& type) {
  return type.name.starts_with("IMU") && std::all_of(kColumns.begin(), kColumns.end(),
                                                     [&](const char* c) { return type.find(c) != nullptr; });
}

/// "IMU2", or "IMU[1]" where records have the number of their sensor.
std::string stream_of(const DataFlashRecord& record) {
  const auto* instance = record.type->find("I");
  if (!is_imu(*record.type) || instance == nullptr) return record.type->name;
  return text(record.type->name, "[", record.integer(*instance), "]");
}

/// Angular rates are stored in rad/s; a log may say otherwise.
double rate_factor(const std::string& unit) {
  return unit.starts_with("deg") || unit == "d/s" ? std::numbers::pi / 180 : 1;
}

Expected<ImuSample> sample_of(const DataFlashRecord& record, const std::string& where) {
  std::array<const DataFlashType::Field*, 7> fields{};
  for (std::size_t k = 0; k < fields.size(); ++k) fields[k] = record.type->find(kColumns[k]);
  const std::int64_t t_us = record.integer(*fields[0]);
  if (t_us < 0 || t_us > kLongestTimeUs)
    return Error{where, text("the stamp ", t_us, " us is out of range"), "is the log damaged?"};
  ImuSample out;
  out.t = t_us * kNsPerUs;
  const double rates = rate_factor(fields[1]->unit);
  for (int k = 0; k < 3; ++k) {
    out.gyro[k] = rates * record.number(*fields[static_cast<std::size_t>(1 + k)]);
    out.accel[k] = record.number(*fields[static_cast<std::size_t>(4 + k)]);
  }
  if (!out.gyro.allFinite() || !out.accel.allFinite())
    return Error{where, "an angular rate or acceleration is not a finite number", "is the log damaged?"};
  return out;
}

}  // namespace

Status read_dataflash_sensors(const std::string& path, const std::string& name, const SensorSink& sink) {
  auto reader = DataFlashReader::open(path);
  if (!reader) return reader.error();
  if (!sink.imu) return {};
  std::string chosen = name;
  bool found = false;
  DataFlashRecord record;
  while (reader->next(record)) {
    if (!is_imu(*record.type)) continue;
    const std::string stream = stream_of(record);
    if (chosen.empty()) chosen = stream;
    if (stream != chosen) continue;
    found = true;
    const auto sample = sample_of(record, text(path, ", byte ", reader->byte()));
    if (!sample) return sample.error();
    sink.imu(*sample);
  }
  if (!found && !name.empty())
    return Error{path, "has no IMU records '" + name + "'", "`evpose info` lists the log's records"};
  return {};
}

Expected<std::vector<StreamInfo>> list_dataflash_streams(const std::string& path) {
  auto reader = DataFlashReader::open(path);
  if (!reader) return reader.error();
  std::vector<StreamInfo> out;
  std::map<std::string, std::size_t> index;
  DataFlashRecord record;
  while (reader->next(record)) {
    const std::string stream = stream_of(record);
    const auto [at, is_new] = index.emplace(stream, out.size());
    if (is_new)
      out.push_back(
          {is_imu(*record.type) ? StreamKind::imu : StreamKind::other, stream, record.type->name, 0});
    ++out[at->second].messages;
  }
  return out;
}

}  // namespace evpose
