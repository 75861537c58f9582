// SPDX-License-Identifier: BSD-3-Clause
// HDF5 files that hold events as rows instead of columns.
#include <algorithm>
#include <cmath>

#include "evpose/io/events/event_rows.h"
#include "evpose/io/files/numbers.h"
#include "evpose/io/hdf5/ecf.h"

namespace evpose {
namespace {

class MetavisionRows : public EventRows {
 public:
  MetavisionRows(Hdf5Dataset table, ImageSize size) : table_(std::move(table)), size_(size) {}

  std::uint64_t count() const override { return table_.rows(); }
  ImageSize size() const override { return size_; }

  Status stamps(std::uint64_t first, std::uint64_t count, std::vector<std::int64_t>& t_us) override {
    if (auto status = read(first, count); !status) return status;
    t_us.resize(count);
    std::transform(rows_.begin(), rows_.end(), t_us.begin(), [](const EcfEvent& e) { return e.t_us; });
    return {};
  }

  Status pixels(std::uint64_t first, std::uint64_t count, RawEvents& out) override {
    if (auto status = read(first, count); !status) return status;
    out.x.resize(count), out.y.resize(count), out.p.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      out.x[i] = rows_[i].x;
      out.y[i] = rows_[i].y;
      out.p[i] = rows_[i].p;
    }
    return {};
  }

 private:
  /// Times and pixels stand together: read once.
  Status read(std::uint64_t first, std::uint64_t count) {
    if (first == first_ && count == rows_.size() && count > 0) return {};
    rows_.resize(count);
    first_ = first;
    auto status = table_.read_rows(first, count, rows_.data());
    if (!status) rows_.clear();
    return status;
  }

  Hdf5Dataset table_;
  ImageSize size_;
  std::uint64_t first_ = 0;
  std::vector<EcfEvent> rows_;
};

/// The attribute `geometry`, such as 1280x720.
ImageSize geometry_of(const Hdf5File& file) {
  const auto values = file.attribute_strings("/", "geometry");
  if (!values || values->size() != 1) return {};
  const std::string_view geometry = values->front();
  const auto cross = geometry.find('x');
  std::int64_t width = 0, height = 0;
  if (cross == std::string_view::npos || !parse_integer(trimmed(geometry.substr(0, cross)), width) ||
      !parse_integer(trimmed(geometry.substr(cross + 1)), height) || width < 1 || width > 65536 ||
      height < 1 || height > 32768)
    return {};
  return {static_cast<int>(width), static_cast<int>(height)};
}

class MvsecRows : public EventRows {
 public:
  explicit MvsecRows(Hdf5Dataset events) : events_(std::move(events)) {}

  std::uint64_t count() const override { return events_.rows(); }
  ImageSize size() const override { return {346, 260}; }  // all recordings are of DAVIS346 cameras

  Status stamps(std::uint64_t first, std::uint64_t count, std::vector<std::int64_t>& t_us) override {
    if (auto status = read(first, count); !status) return status;
    t_us.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      const double us = rows_[i][2] * 1e6;
      t_us[i] = std::abs(us) <= static_cast<double>(kLargestTimeUs) ? std::llround(us) : 2 * kLargestTimeUs;
    }
    return {};
  }

  Status pixels(std::uint64_t first, std::uint64_t count, RawEvents& out) override {
    if (auto status = read(first, count); !status) return status;
    out.x.resize(count), out.y.resize(count), out.p.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      out.x[i] = whole(rows_[i][0]);
      out.y[i] = whole(rows_[i][1]);
      out.p[i] = whole(rows_[i][3]);
    }
    return {};
  }

 private:
  using Row = std::array<double, 4>;

  /// What is no small number becomes one that no pixel has.
  static std::int32_t whole(double value) {
    return std::abs(value) < 1e6 ? static_cast<std::int32_t>(std::lround(value)) : INT32_MAX;
  }
  Status read(std::uint64_t first, std::uint64_t count) {
    if (first == first_ && count == rows_.size() && count > 0) return {};
    rows_.resize(count);
    first_ = first;
    auto status = events_.read(NumberType::f64, first, count, rows_.data());
    if (!status) rows_.clear();
    return status;
  }

  Hdf5Dataset events_;
  std::uint64_t first_ = 0;
  std::vector<Row> rows_;
};

}  // namespace

Expected<std::unique_ptr<EventRows>> open_metavision_rows(const Hdf5File& file) {
  constexpr Hdf5Field kFields[] = {{"x", offsetof(EcfEvent, x), NumberType::u16},
                                   {"y", offsetof(EcfEvent, y), NumberType::u16},
                                   {"p", offsetof(EcfEvent, p), NumberType::i16},
                                   {"t", offsetof(EcfEvent, t_us), NumberType::i64}};
  auto table = file.table("/CD/events", kFields, sizeof(EcfEvent));
  if (!table) return table.error();
  return std::unique_ptr<EventRows>(std::make_unique<MetavisionRows>(*std::move(table), geometry_of(file)));
}

std::string mvsec_events(const Hdf5File& file, const std::string& camera) {
  for (const char* name : {"left", "right"}) {
    std::string dataset = std::string("/davis/") + name + "/events";
    if ((camera.empty() || camera == name) && file.has(dataset)) return dataset;
  }
  return "";
}

Expected<std::unique_ptr<EventRows>> open_mvsec_rows(const Hdf5File& file, const std::string& camera) {
  auto events = file.dataset(mvsec_events(file, camera), 2);
  if (!events) return events.error();
  if (events->shape()[1] != 4)
    return Error{file.path() + ": " + events->name(), text("has rows of ", events->shape()[1], " numbers"),
                 "an event is x, y, t and polarity"};
  return std::unique_ptr<EventRows>(std::make_unique<MvsecRows>(*std::move(events)));
}

}  // namespace evpose
