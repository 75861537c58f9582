// SPDX-License-Identifier: BSD-3-Clause
// What HDF5 files of events hold beside these.
#include <algorithm>
#include <array>
#include <cmath>

#include "evpose/io/events/event_packer.h"
#include "evpose/io/events/event_rows.h"
#include "evpose/io/events/events_h5.h"

namespace evpose {
namespace {

constexpr std::uint64_t kBlockRows = 16384;
constexpr const char* kTriggers = "/EXT_TRIGGER/events";

struct StoredTrigger {
  std::int64_t t_us = 0;
  std::int16_t p = 0, id = 0;
};

Expected<Hdf5Dataset> open_triggers(const Hdf5File& file) {
  constexpr Hdf5Field kFields[] = {{"t", offsetof(StoredTrigger, t_us), NumberType::i64},
                                   {"p", offsetof(StoredTrigger, p), NumberType::i16},
                                   {"id", offsetof(StoredTrigger, id), NumberType::i16}};
  return file.table(kTriggers, kFields, sizeof(StoredTrigger));
}

Status read_triggers(const Hdf5File& file, const SensorSink& sink) {
  const auto table = open_triggers(file);
  if (!table) return table.error();
  std::vector<StoredTrigger> rows;
  for (std::uint64_t first = 0; first < table->rows(); first += rows.size()) {
    rows.resize(std::min(kBlockRows, table->rows() - first));
    if (auto status = table->read_rows(first, rows.size(), rows.data()); !status) return status;
    for (const StoredTrigger& row : rows) {
      if (row.t_us > kLargestTimeUs || row.t_us < -kLargestTimeUs)
        return Error{file.path() + ": " + kTriggers, text("the stamp ", row.t_us, " us is out of range"),
                     "the file is damaged; copy it again"};
      sink.trigger({row.t_us * kNsPerUs, row.p > 0, row.id});
    }
  }
  return {};
}

/// MVSEC: acceleration (m/s^2), then rate (rad/s); stamps are Unix seconds.
Status read_mvsec_imu(const Hdf5File& file, const std::string& group, const SensorSink& sink) {
  const auto values = file.dataset(group + "/imu", 2), stamps = file.dataset(group + "/imu_ts", 1);
  if (!values) return values.error();
  if (!stamps) return stamps.error();
  if (values->shape()[1] != 6 || stamps->rows() != values->rows())
    return Error{file.path() + ": " + values->name(), "has not six numbers for each stamp",
                 "the file is incomplete; copy it again"};
  std::vector<std::array<double, 6>> rows;
  std::vector<double> seconds;
  for (std::uint64_t first = 0; first < values->rows(); first += rows.size()) {
    rows.resize(std::min(kBlockRows, values->rows() - first));
    seconds.resize(rows.size());
    if (auto status = values->read(NumberType::f64, first, rows.size(), rows.data()); !status) return status;
    if (auto status = stamps->read(NumberType::f64, first, rows.size(), seconds.data()); !status)
      return status;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (!(std::abs(seconds[i]) * 1e6 <= static_cast<double>(kLargestTimeUs)))
        return Error{file.path() + ": " + stamps->name(),
                     text("the stamp ", seconds[i], " s is out of range"),
                     "the file is damaged; copy it again"};
      ImuSample sample;
      sample.t = std::llround(seconds[i] * 1e6) * kNsPerUs;
      sample.accel = {rows[i][0], rows[i][1], rows[i][2]};
      sample.gyro = {rows[i][3], rows[i][4], rows[i][5]};
      sink.imu(sample);
    }
  }
  return {};
}

/// The group of the MVSEC camera, "/davis/left"; empty if it is another kind of file.
std::string mvsec_group(const Hdf5File& file) {
  const std::string events = mvsec_events(file, "");
  return events.substr(0, events.rfind('/'));
}

}  // namespace

Expected<std::vector<StreamInfo>> list_h5_streams(const std::string& path) {
  const auto file = Hdf5File::open(path);
  if (!file) return file.error();
  std::vector<StreamInfo> infos;
  const auto add = [&](StreamKind kind, const std::string& name, const char* type, const auto& dataset) {
    if (dataset) infos.push_back({kind, name, type, static_cast<std::int64_t>(dataset->rows())});
  };
  if (file->has("/CD/events")) {
    const auto rows = open_metavision_rows(*file);
    if (!rows) return rows.error();
    infos.push_back(
        {StreamKind::events, "/CD/events", "Metavision", static_cast<std::int64_t>((*rows)->count())});
    if (file->has(kTriggers)) add(StreamKind::triggers, kTriggers, "Metavision", open_triggers(*file));
    return infos;
  }
  if (mvsec_group(*file).empty()) {
    // Columns without a unit are told, not refused.
    for (const std::string& name : file->datasets())
      if (name.ends_with("/t"))
        add(StreamKind::events, name.substr(0, name.size() - 2), "HDF5", file->dataset(name, 1));
    if (infos.empty()) return Error{path, "holds no events", "is it the right file?"};
    return infos;
  }
  for (const char* name : {"left", "right"}) {
    const std::string events = mvsec_events(*file, name);
    if (!events.empty()) add(StreamKind::events, name, "MVSEC", file->dataset(events, 2));
  }
  const std::string imu = mvsec_group(*file) + "/imu";
  if (file->has(imu)) add(StreamKind::imu, imu, "MVSEC", file->dataset(imu, 2));
  return infos;
}

Status read_h5_sensors(const std::string& path, const SensorSink& sink) {
  const auto file = Hdf5File::open(path);
  if (!file) return file.error();
  if (sink.trigger && file->has(kTriggers))
    if (auto status = read_triggers(*file, sink); !status) return status;
  const std::string group = mvsec_group(*file);
  if (sink.imu && !group.empty() && file->has(group + "/imu")) return read_mvsec_imu(*file, group, sink);
  return {};
}

}  // namespace evpose
