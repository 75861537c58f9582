// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/events_h5.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "evpose/io/events/event_packer.h"
#include "evpose/io/events/event_rows.h"
#include "evpose/io/events/packed_event_reader.h"
#include "evpose/io/hdf5/hdf5_file.h"

namespace evpose {
namespace {

constexpr std::uint64_t kBlockRows = 65536;

/// The group that holds x, y, t and p.
std::string event_group(const Hdf5File& file) {
  const auto holds_events = [&](const std::string& group) {
    return file.has(group + "/x") && file.has(group + "/y") && file.has(group + "/t") &&
           file.has(group + "/p");
  };
  // Also when it lacks a column: the error then names that column.
  if (file.has("/events")) return "/events";
  for (const std::string& name : file.root_groups())
    if (holds_events("/" + name)) return "/" + name;
  return "/events";
}

struct Columns {
  Hdf5Dataset t, x, y, p;
};

Expected<Columns> open_columns(const Hdf5File& file) {
  const std::string group = event_group(file);
  Columns columns;
  for (const auto& [name, column] : {std::pair("t", &columns.t), std::pair("x", &columns.x),
                                     std::pair("y", &columns.y), std::pair("p", &columns.p)}) {
    auto dataset = file.dataset(group + "/" + name, 1);
    if (!dataset) return dataset.error();
    *column = *std::move(dataset);
    if (column->rows() != columns.t.rows())
      return Error{file.path(),
                   text(column->name(), " has ", column->rows(), " rows, ", columns.t.name(), " has ",
                        columns.t.rows()),
                   "the file is incomplete; copy it again"};
  }
  return columns;
}

/// Stamps as stored to whole microseconds.
class Clock {
 public:
  static Expected<Clock> make(const Hdf5File& file, const Columns& columns, const std::string& unit) {
    if (!unit.empty() && unit != "us" && unit != "ns" && unit != "s")
      return Error{file.path(), "events.time_unit '" + unit + "' is unknown", "use us, ns or s"};
    if (columns.t.is_floating() && unit.empty())
      return Error{file.path() + ": " + columns.t.name(),
                   "the stamps are floating-point numbers, seconds where microseconds are expected",
                   "set events.time_unit: s in recording.yaml"};
    Clock clock;
    clock.floating_ = columns.t.is_floating();
    clock.unit_ = unit.empty() ? "us" : unit;
    if (!file.has("/t_offset")) return clock;
    const auto offset = file.dataset("/t_offset");
    if (!offset) return offset.error();
    const auto& shape = offset->shape();
    if (!(shape.empty() || shape == Hdf5Shape{1}))
      return Error{file.path() + ": /t_offset", "is not one number", "store a scalar"};
    if (auto status = offset->read(NumberType::i64, 0, 1, &clock.offset_us_); !status) return status.error();
    if (clock.offset_us_ > kLargestTimeUs || clock.offset_us_ < -kLargestTimeUs)
      return Error{file.path() + ": /t_offset", text(clock.offset_us_, " us is out of range"), "correct it"};
    return clock;
  }

  const std::string& unit() const { return unit_; }
  std::int64_t offset_us() const { return offset_us_; }

  Status read(const Hdf5Dataset& t, std::uint64_t first, std::uint64_t count,
              std::vector<std::int64_t>& out) {
    out.resize(count);
    if (floating_) {
      floats_.resize(count);
      if (auto status = t.read(NumberType::f64, first, count, floats_.data()); !status) return status;
      const double scale = unit_ == "s" ? 1e6 : unit_ == "ns" ? 1e-3 : 1;
      for (std::size_t i = 0; i < count; ++i) out[i] = from_float(floats_[i] * scale);
    } else {
      if (auto status = t.read(NumberType::i64, first, count, out.data()); !status) return status;
      for (auto& value : out) value = from_integer(value);
    }
    return {};
  }

 private:
  // Beyond what has a time, both give a value that the packer refuses by name.
  static constexpr std::int64_t kBeyond = 2 * kLargestTimeUs;

  std::int64_t from_float(double us) const {
    if (!(std::abs(us) <= kLargestTimeUs)) return kBeyond;
    return std::llround(us) + offset_us_;
  }
  std::int64_t from_integer(std::int64_t value) const {
    if (unit_ == "ns") value = value / 1000 - (value % 1000 < 0 ? 1 : 0);
    const std::int64_t largest = unit_ == "s" ? kLargestTimeUs / 1'000'000 : kLargestTimeUs;
    if (value > largest || value < -largest) return kBeyond;
    return (unit_ == "s" ? value * 1'000'000 : value) + offset_us_;
  }

  bool floating_ = false;
  std::string unit_;
  std::int64_t offset_us_ = 0;
  std::vector<double> floats_;
};

Expected<ImageSize> stored_size(const Hdf5File& file) {
  const auto width = file.attribute_numbers("/", "width"), height = file.attribute_numbers("/", "height");
  if (!width || !height || width->size() != 1 || height->size() != 1) return ImageSize{};
  const double w = width->front(), h = height->front();
  if (!(w >= 1 && w <= 65536 && h >= 1 && h <= 32768))
    return Error{file.path(), text("attributes width and height are ", w, " and ", h), "correct them"};
  return ImageSize{static_cast<int>(w), static_cast<int>(h)};
}

class ColumnRows : public EventRows {
 public:
  static Expected<std::unique_ptr<EventRows>> open(const Hdf5File& file, const std::string& unit) {
    auto columns = open_columns(file);
    if (!columns) return columns.error();
    auto clock = Clock::make(file, *columns, unit);
    if (!clock) return clock.error();
    const auto size = stored_size(file);
    if (!size) return size.error();
    auto rows = std::unique_ptr<ColumnRows>(new ColumnRows(*std::move(columns), *std::move(clock), *size));
    if (file.has("/ms_to_idx"))
      if (auto index = file.dataset("/ms_to_idx", 1)) rows->index_ = *std::move(index);
    return std::unique_ptr<EventRows>(std::move(rows));
  }

  std::uint64_t count() const override { return columns_.t.rows(); }
  ImageSize size() const override { return size_; }

  Status stamps(std::uint64_t first, std::uint64_t count, std::vector<std::int64_t>& t_us) override {
    return clock_.read(columns_.t, first, count, t_us);
  }

  Status pixels(std::uint64_t first, std::uint64_t count, RawEvents& out) override {
    for (const auto& [dataset, column] :
         {std::pair(&columns_.x, &out.x), std::pair(&columns_.y, &out.y), std::pair(&columns_.p, &out.p)}) {
      column->resize(count);
      if (auto status = dataset->read(NumberType::i32, first, count, column->data()); !status) return status;
    }
    return {};
  }

  std::pair<std::uint64_t, std::uint64_t> near(std::int64_t t_us) override {
    const std::int64_t ms = (t_us - clock_.offset_us()) / 1000;
    if (!index_ || clock_.unit() != "us" || ms < 0 || index_->rows() < 2) return {0, count()};
    const std::uint64_t last = index_->rows() - 1, entry = std::min(static_cast<std::uint64_t>(ms), last);
    std::array<std::uint64_t, 2> rows = {0, count()};
    const std::uint64_t known = entry < last ? 2 : 1;
    if (!index_->read(NumberType::u64, entry, known, rows.data())) return {0, count()};
    return {std::min(rows[0], count()), std::min(rows[1], count())};
  }

 private:
  ColumnRows(Columns columns, Clock clock, ImageSize size)
      : columns_(std::move(columns)), clock_(std::move(clock)), size_(size) {}

  Columns columns_;
  Clock clock_;
  ImageSize size_;
  std::optional<Hdf5Dataset> index_;  ///< /ms_to_idx: number of the first event of each millisecond
};

/// What all members of one open file share.
struct Source {
  Hdf5File file;
  std::unique_ptr<EventRows> rows;
  std::uint64_t row = 0;

  Expected<std::int64_t> stamp(std::uint64_t i) const {
    std::vector<std::int64_t> one;
    if (auto status = rows->stamps(i, 1, one); !status) return status.error();
    return one[0];
  }

  /// First row in [low, high] at or after a time, by bisection; `high` if there is none before it.
  Expected<std::uint64_t> first_between(std::uint64_t low, std::uint64_t high, std::int64_t t_us) const {
    while (low < high) {
      const std::uint64_t middle = low + (high - low) / 2;
      const auto t = stamp(middle);
      if (!t) return t.error();
      if (*t < t_us) {
        low = middle + 1;
      } else {
        high = middle;
      }
    }
    return low;
  }

  /// First row at or after a time. An index is believed as far as the stamps agree with it.
  Expected<std::uint64_t> first_at(std::int64_t t_us) const {
    const auto [low, high] = rows->near(t_us);
    if (low > 0 || high < rows->count()) {
      const auto before = low > 0 ? stamp(low - 1) : Expected<std::int64_t>(t_us - 1);
      const auto after = high < rows->count() ? stamp(high) : Expected<std::int64_t>(t_us);
      if (low <= high && before && after && *before < t_us && *after >= t_us)
        return first_between(low, high, t_us);
    }
    return first_between(0, rows->count(), t_us);
  }

  Expected<bool> fetch(RawEvents& out) {
    const std::uint64_t count = std::min(kBlockRows, rows->count() - row);
    out.first_row = static_cast<std::int64_t>(row);
    if (auto status = rows->stamps(row, count, out.t_us); !status) return status.error();
    if (auto status = rows->pixels(row, count, out); !status) return status.error();
    row += count;
    return count > 0;
  }
};

Expected<EventExtent> extent_of(const Source& source, const EventReadOptions& options) {
  const std::uint64_t rows = source.rows->count();
  const auto first = source.stamp(0), last = source.stamp(rows - 1);
  if (!first) return first.error();
  if (!last) return last.error();
  for (const std::int64_t t : {*first, *last}) {
    if (t > kLargestTimeUs || t < -kLargestTimeUs)
      return Error{source.file.path(),
                   text("the stamps reach out of range (", t == *first ? "first" : "last", " event)"),
                   "set events.time_unit to the unit of the stored stamps"};
  }
  // Ten events each nanosecond is beyond every sensor.
  const double per_us =
      static_cast<double>(rows) / static_cast<double>(std::max<std::int64_t>(*last - *first, 1));
  if (options.time_unit.empty() && rows > 10'000 && per_us > 1e4)
    return Error{
        source.file.path(),
        text(rows, " events within ", *last - *first, " us: the stamps look like seconds, not microseconds"),
        "set events.time_unit: s in recording.yaml"};
  return make_extent(*first, *last, static_cast<std::int64_t>(rows), options);
}

Expected<std::unique_ptr<EventRows>> open_rows(const Hdf5File& file, const EventReadOptions& options) {
  const bool metavision = file.has("/CD/events");
  if (!metavision && mvsec_events(file, options.topic).empty())
    return ColumnRows::open(file, options.time_unit);
  const std::string unit = metavision ? "us" : "s";
  if (auto status = check_time_unit(file.path(), options, unit); !status) return status.error();
  return metavision ? open_metavision_rows(file) : open_mvsec_rows(file, options.topic);
}

}  // namespace

Expected<std::unique_ptr<EventReader>> open_events_h5(const std::string& path,
                                                      const EventReadOptions& options) {
  auto file = Hdf5File::open(path);
  if (!file) return file.error();
  auto rows = open_rows(*file, options);
  if (!rows) return rows.error();
  if ((*rows)->count() == 0) return Error{path, "holds no events", "record again"};
  const ImageSize size = options.size != ImageSize{} ? options.size : (*rows)->size();
  auto source = std::make_shared<Source>(Source{.file = *std::move(file), .rows = *std::move(rows)});
  const auto extent = extent_of(*source, options);
  if (!extent) return extent.error();
  auto packer =
      EventPacker::make(path, options, size, [source](RawEvents& block) { return source->fetch(block); });
  if (!packer) return packer.error();
  if (options.t_start_ns) {
    const auto row = source->first_at(packer->first_us());
    if (!row) return row.error();
    source->row = *row;
  }
  return make_packed_reader(*std::move(packer), [extent = *extent] { return extent; });
}

}  // namespace evpose
