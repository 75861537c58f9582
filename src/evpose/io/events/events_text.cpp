// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/events_text.h"

#include <algorithm>
#include <array>
#include <cctype>

#include "evpose/core/log.h"
#include "evpose/io/events/packed_event_reader.h"
#include "evpose/io/files/input_file.h"
#include "evpose/io/files/numbers.h"

namespace evpose {
namespace {

constexpr std::size_t kSampleLines = 1000;
constexpr std::int64_t kTailBytes = 64 << 10;

/// How the columns of a file are read.
struct Layout {
  std::size_t t = 0, x = 1, y = 2, p = 3;
  std::string unit;  ///< us, ns or s
};

bool is_polarity(std::string_view s) {
  return s == "0" || s == "1" || s == "-1" || s == "+1" || s == "1.0" || s == "0.0";
}

/// "%geometry:640,480"; nothing changes if it is another line.
void read_geometry(std::string_view line, ImageSize& size) {
  constexpr std::string_view kKey = "%geometry:";
  if (!line.starts_with(kKey)) return;
  std::vector<std::string_view> fields;
  split_fields(line.substr(kKey.size()), fields);
  std::int64_t width = 0, height = 0;
  if (fields.size() == 2 && parse_integer(fields[0], width) && parse_integer(fields[1], height) &&
      width > 0 && height > 0 && width <= 65536 && height <= 32768)
    size = {static_cast<int>(width), static_cast<int>(height)};
}

/// No event: empty, a comment, or a heading such as `t,x,y,p`.
bool is_aside(std::string_view line, std::int64_t number) {
  if (line.empty() || line.front() == '#' || line.front() == '%') return true;
  return number == 1 && std::isalpha(static_cast<unsigned char>(line.front())) != 0;
}

using Row = std::array<std::string, 4>;

struct Sample {
  std::vector<Row> rows;
  ImageSize size;
};

Expected<Sample> read_sample(const std::string& path) {
  auto lines = LineReader::open(path);
  if (!lines) return lines.error();
  Sample sample;
  std::vector<std::string_view> fields;
  std::string_view line;
  while (sample.rows.size() < kSampleLines) {
    const auto more = lines->next(line);
    if (!more) return more.error();
    if (!*more) break;
    line = trimmed(line);
    read_geometry(line, sample.size);
    if (is_aside(line, lines->number())) continue;
    split_fields(line, fields);
    if (fields.size() != 4)
      return Error{lines->where(), text(fields.size(), " values instead of 4"),
                   "an event is `t x y p` or `x,y,p,t`"};
    sample.rows.push_back(
        {std::string(fields[0]), std::string(fields[1]), std::string(fields[2]), std::string(fields[3])});
  }
  if (sample.rows.empty()) return Error{path, "holds no events", "record again"};
  return sample;
}

bool all_polarities(const std::vector<Row>& rows, std::size_t column) {
  return std::all_of(rows.begin(), rows.end(), [=](const Row& r) { return is_polarity(r[column]); });
}

Expected<Layout> detect(const std::string& path, const std::vector<Row>& rows, const std::string& unit) {
  if (!unit.empty() && unit != "us" && unit != "ns" && unit != "s")
    return Error{path, "events.time_unit '" + unit + "' is unknown", "use us, ns or s"};
  Layout layout;
  if (!all_polarities(rows, 3)) {
    if (!all_polarities(rows, 2))
      return Error{path, "neither the last column nor the third holds only polarities 0, 1 or -1",
                   "an event is `t x y p` or `x,y,p,t`"};
    layout = {.t = 3, .x = 0, .y = 1, .p = 2, .unit = {}};
  }
  const bool seconds = std::any_of(rows.begin(), rows.end(), [&](const Row& r) {
    return r[layout.t].find_first_of(".eE") != std::string::npos;
  });
  layout.unit = !unit.empty() ? unit : seconds ? "s" : "us";
  log_detail(path + ": columns " + (layout.t == 0 ? "t x y p" : "x y p t") + ", time in " + layout.unit +
             (unit.empty() ? " (found from its first lines)" : ""));
  return layout;
}

bool parse_time(std::string_view field, const std::string& unit, std::int64_t& t_us) {
  return parse_decimal(field, unit == "s" ? 6 : unit == "us" ? 0 : -3, t_us);
}

/// A pixel or polarity: a whole number, also when written with a fraction of zeros.
bool parse_small(std::string_view field, std::int32_t& out) {
  if (const auto point = field.find('.'); point != std::string_view::npos) {
    if (field.find_first_not_of('0', point + 1) != std::string_view::npos) return false;
    field = field.substr(0, point);
  }
  std::int64_t value = 0;
  if (!parse_integer(field, value) || value < -1'000'000 || value > 1'000'000) return false;
  out = static_cast<std::int32_t>(value);
  return true;
}

struct Row4 {
  std::int64_t t_us = 0;
  std::int32_t x = 0, y = 0, p = 0;
};

/// Reads lines written the common way: digits, single separators, no signs. Where one is written otherwise
/// the general way, four times slower, decides. Every line has its end, so that no digit has to be held
/// against the end of the buffer.
class PlainRows {
 public:
  PlainRows(std::string_view whole_lines, const Layout& layout)
      : begin_(whole_lines.data()),
        at_(begin_),
        end_(begin_ + whole_lines.size()),
        time_first_(layout.t == 0),
        seconds_(layout.unit == "s") {}

  /// False, and nothing taken, when the next line is none of these or there is none.
  bool read(Row4& row) {
    if (at_ == end_) return false;
    const char* const line = at_;
    separator_ = 0;
    if (take_row(row)) return true;
    at_ = line;
    return false;
  }
  std::size_t bytes() const { return static_cast<std::size_t>(at_ - begin_); }

 private:
  static constexpr int kMostDigits = 17, kMostOfPixel = 6, kMostOfSeconds = 10, kDecimals = 6;

  bool take_row(Row4& row) {
    if (time_first_ && !(take_time(row.t_us) && take_separator())) return false;
    if (!take_small(row.x) || !take_separator() || !take_small(row.y) || !take_separator()) return false;
    if (!take_small(row.p) || row.p > 1) return false;
    if (!time_first_ && !(take_separator() && take_time(row.t_us))) return false;
    if (*at_ == '\r') ++at_;
    return *at_++ == '\n';
  }
  static unsigned digit(char c) { return static_cast<unsigned char>(c) - unsigned{'0'}; }
  /// One to `most` digits.
  template <class T>
  bool take_digits(int most, T& value) {
    const char* const begin = at_;
    T sum = 0;
    for (unsigned d = digit(*at_); d <= 9 && at_ - begin <= most; d = digit(*++at_))
      sum = 10 * sum + static_cast<T>(d);
    value = sum;
    return at_ > begin && at_ - begin <= most;
  }
  bool take_small(std::int32_t& value) { return take_digits(kMostOfPixel, value); }
  /// Whatever stands behind the microseconds is rounded down.
  bool take_time(std::int64_t& t_us) {
    if (!seconds_) return take_digits(kMostDigits, t_us);
    std::int64_t sum = 0;
    if (!take_digits(kMostOfSeconds, sum) || *at_ != '.') return false;
    ++at_;
    int decimals = 0;
    for (; decimals < kDecimals && digit(*at_) <= 9; ++at_, ++decimals) sum = 10 * sum + digit(*at_);
    for (; decimals < kDecimals; ++decimals) sum *= 10;
    while (digit(*at_) <= 9) ++at_;
    t_us = sum;
    return true;
  }
  bool take_separator() {
    if (*at_ != ' ' && *at_ != ',') return false;
    if (separator_ == 0) separator_ = *at_;
    return *at_++ == separator_;
  }

  const char* begin_;
  const char* at_;
  const char* end_;
  bool time_first_, seconds_;
  char separator_ = 0;  ///< of this line
};

class Source {
 public:
  Source(LineReader lines, Layout layout)
      : lines_(std::move(lines)), layout_(std::move(layout)), plain_(layout_.unit != "ns") {}

  Expected<bool> fetch(RawEvents& out) {
    resize(out, kBlockEvents);
    std::size_t count = 0;
    std::string_view line;
    while (true) {
      if (plain_) fetch_plain(out, count);
      if (count == kBlockEvents) break;
      const auto more = lines_.next(line);
      if (!more) return more.error();
      if (!*more) break;
      line = trimmed(line);
      if (is_aside(line, lines_.number())) continue;
      Row4 row;
      if (auto status = parse(line, row); !status) return status.error();
      put(row, lines_.number(), count++, out);
    }
    resize(out, count);
    return count > 0;
  }

 private:
  void fetch_plain(RawEvents& out, std::size_t& count) {
    PlainRows rows(lines_.whole_lines(), layout_);
    const std::size_t before = count;
    const std::int64_t first_line = lines_.number() + 1;
    for (Row4 row; count < kBlockEvents && rows.read(row); ++count)
      put(row, first_line + static_cast<std::int64_t>(count - before), count, out);
    lines_.skip(rows.bytes(), static_cast<std::int64_t>(count - before));
  }

  Status parse(std::string_view line, Row4& row) {
    split_fields(line, fields_);
    if (fields_.size() != 4)
      return Error{lines_.where(), text(fields_.size(), " values instead of 4"),
                   "is the line cut off? an event has time, column, row and polarity"};
    if (!parse_time(fields_[layout_.t], layout_.unit, row.t_us))
      return Error{lines_.where(), text("'", fields_[layout_.t], "' is not a time in ", layout_.unit),
                   "correct the line, or set events.time_unit"};
    if (!parse_small(fields_[layout_.x], row.x) || !parse_small(fields_[layout_.y], row.y))
      return Error{lines_.where(),
                   text("'", fields_[layout_.x], "', '", fields_[layout_.y], "' is not a pixel"),
                   "columns and rows are whole numbers"};
    if (!parse_small(fields_[layout_.p], row.p))
      return Error{lines_.where(), text("'", fields_[layout_.p], "' is not a polarity"), "use 0/1 or -1/+1"};
    return {};
  }

  static void resize(RawEvents& out, std::size_t count) {
    out.t_us.resize(count), out.x.resize(count), out.y.resize(count), out.p.resize(count);
    out.line.resize(count);
  }
  static void put(const Row4& row, std::int64_t line, std::size_t i, RawEvents& out) {
    out.t_us[i] = row.t_us;
    out.x[i] = row.x;
    out.y[i] = row.y;
    out.p[i] = row.p;
    out.line[i] = line;
  }

  LineReader lines_;
  Layout layout_;
  bool plain_;  ///< may be written the common way
  std::vector<std::string_view> fields_;
};

/// Stamp of the last whole event, found from the end of the file; `first` when there is none.
Expected<std::int64_t> last_stamp(const std::string& path, const Layout& layout, std::int64_t first) {
  const auto file = open_to_read(path);
  if (!file) return file.error();
  std::string tail(static_cast<std::size_t>(std::min(file->size, kTailBytes)), '\0');
  if (::fseeko(file->stream.get(), file->size - static_cast<std::int64_t>(tail.size()), SEEK_SET) != 0 ||
      std::fread(tail.data(), 1, tail.size(), file->stream.get()) != tail.size())
    return Error{path, "cannot be read to its end", "check the disk"};
  std::vector<std::string_view> fields;
  for (std::size_t end = tail.size(); end > 0;) {
    const std::size_t newline = tail.rfind('\n', end - 1);
    const std::size_t begin = newline == std::string::npos ? 0 : newline + 1;
    split_fields(trimmed(std::string_view(tail).substr(begin, end - begin)), fields);
    std::int64_t t = 0;
    if (fields.size() == 4 && parse_time(fields[layout.t], layout.unit, t)) return t;
    end = newline == std::string::npos ? 0 : newline;
  }
  return first;
}

}  // namespace

Expected<std::unique_ptr<EventReader>> open_events_text(const std::string& path,
                                                        const EventReadOptions& options) {
  const auto sample = read_sample(path);
  if (!sample) return sample.error();
  const auto layout = detect(path, sample->rows, options.time_unit);
  if (!layout) return layout.error();
  std::int64_t first = 0;
  if (!parse_time(sample->rows.front()[layout->t], layout->unit, first) || first > kLargestTimeUs ||
      first < -kLargestTimeUs)
    return Error{
        path,
        text("the first stamp, '", sample->rows.front()[layout->t], "' ", layout->unit, ", is out of range"),
        "set events.time_unit, e.g. ns"};
  const auto last = last_stamp(path, *layout, first);
  if (!last) return last.error();
  auto lines = LineReader::open(path);
  if (!lines) return lines.error();
  auto source = std::make_shared<Source>(*std::move(lines), *layout);
  const ImageSize size = options.size == ImageSize{} ? sample->size : options.size;
  auto packer =
      EventPacker::make(path, options, size, [source](RawEvents& block) { return source->fetch(block); });
  if (!packer) return packer.error();
  const auto extent = make_extent(first, std::clamp(*last, first, kLargestTimeUs), -1, options);
  return make_packed_reader(*std::move(packer), [extent] { return extent; });
}

}  // namespace evpose
