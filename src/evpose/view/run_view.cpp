// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/view/run_view.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <map>
#include <string_view>

#include "evpose/io/files/atomic_file.h"

namespace evpose {
namespace {

constexpr const char* kHealths[] = {"waiting", "initialising", "tracking", "degraded", "lost"};

/// A CSV file of our own by columns; quoted text stands only at the end of a line.
struct Table {
  std::map<std::string, std::size_t, std::less<>> columns;
  std::vector<std::vector<std::string_view>> rows;
};

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> out;
  while (true) {
    const auto comma = line.find(',');
    out.push_back(line.substr(0, comma));
    if (comma == std::string_view::npos) return out;
    line.remove_prefix(comma + 1);
  }
}

Table parse(std::string_view content) {
  Table table;
  for (bool first = true; !content.empty(); first = false) {
    const auto end = content.find('\n');
    const auto cells = split(content.substr(0, end));
    if (first)
      for (std::size_t i = 0; i < cells.size(); ++i) table.columns.emplace(cells[i], i);
    else
      table.rows.push_back(cells);
    if (end == std::string_view::npos) break;
    content.remove_prefix(end + 1);
  }
  return table;
}

/// Reads cells of a row by the names of their columns.
class Row {
 public:
  Row(const Table& table, const std::vector<std::string_view>& cells) : table_(table), cells_(cells) {}
  bool sound() const { return sound_; }
  std::string_view word(const char* name) {
    const auto found = table_.columns.find(name);
    if (found != table_.columns.end() && found->second < cells_.size()) return cells_[found->second];
    sound_ = false;
    return {};
  }
  double number(const char* name) {
    const std::string_view cell = word(name);
    double value = 0;
    const auto r = std::from_chars(cell.data(), cell.data() + cell.size(), value);
    if (r.ec != std::errc() || r.ptr != cell.data() + cell.size()) sound_ = false;
    return value;
  }

 private:
  const Table& table_;
  const std::vector<std::string_view>& cells_;
  bool sound_ = true;
};

/// From the newest event to the pose; NAN where the row does not tell.
double delay_ms(Row times) {
  const double sum = times.number("predict_ms") + times.number("choose_ms") + times.number("register_ms") +
                     times.number("fuse_ms");
  return times.sound() ? sum : NAN;
}

double number_of_health(std::string_view name) {
  const auto found = std::find(std::begin(kHealths), std::end(kHealths), name);
  return found == std::end(kHealths) ? 0 : static_cast<double>(found - std::begin(kHealths));
}

/// The largest sigma of the rotation, degrees.
double rotation_sigma_deg(Row& row) {
  double variance = 0;
  for (const char* key : {"cov_rx_rx", "cov_ry_ry", "cov_rz_rz"})
    variance = std::max(variance, row.number(key));
  return std::sqrt(variance) * 180 / M_PI;
}

/// `since_s`: since the run's first row. `span_s`: since the row before, whose events are counted.
ViewRow read_row(Row& row, double since_s, double span_s, double delay) {
  return {since_s,
          row.number("x_m"),
          row.number("y_m"),
          row.number("z_m"),
          row.number("qx"),
          row.number("qy"),
          row.number("qz"),
          row.number("qw"),
          row.number("vx_m_s"),
          row.number("vy_m_s"),
          row.number("vz_m_s"),
          row.number("cov_x_x"),
          row.number("cov_x_y"),
          row.number("cov_x_z"),
          row.number("cov_y_y"),
          row.number("cov_y_z"),
          row.number("cov_z_z"),
          rotation_sigma_deg(row),
          number_of_health(row.word("health")),
          span_s > 0 ? 1e-6 * row.number("events_read") / span_s : 0,
          delay,
          row.number("points_matched"),
          row.number("points"),
          row.number("gyro_bias_x_rad_s"),
          row.number("gyro_bias_y_rad_s"),
          row.number("gyro_bias_z_rad_s"),
          row.number("accel_bias_x_m_s2"),
          row.number("accel_bias_y_m_s2"),
          row.number("accel_bias_z_m_s2")};
}

}  // namespace

Expected<std::vector<ViewRow>> read_run(const std::string& folder, std::size_t most) {
  const std::string path = folder + "/states.csv";
  const auto content = read_text_file(path);
  if (!content)
    return Error{folder, "no run folder: " + content.error().line(), "give what evpose track -o wrote"};
  const Table states = parse(*content);
  const auto latency_text = read_text_file(folder + "/latency.csv");
  const Table latency = latency_text ? parse(*latency_text) : Table{};
  const bool timed = latency.rows.size() == states.rows.size();
  const std::size_t step = states.rows.size() / std::max<std::size_t>(most, 1) + 1;
  std::vector<ViewRow> out;
  double first = 0, before = 0;
  for (std::size_t i = 0; i < states.rows.size(); i += step) {
    Row row(states, states.rows[i]);
    const double t = row.number("t_s");
    if (i == 0) first = before = t;
    const double span_s = (t - before) / static_cast<double>(step);
    out.push_back(read_row(row, t - first, span_s, timed ? delay_ms(Row(latency, latency.rows[i])) : NAN));
    if (!row.sound())
      return Error{path, text("line ", i + 2, " is not as evpose writes it"), "give a complete run folder"};
    before = t;
  }
  if (out.empty()) return Error{path, "no poses", "give a run that tracked something"};
  return out;
}

}  // namespace evpose
