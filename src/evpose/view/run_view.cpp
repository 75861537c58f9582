// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/view/run_view.h"

#include <charconv>
#include <cmath>
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
    double delay_ms = NAN;
    if (timed) {
      Row times(latency, latency.rows[i]);
      delay_ms = times.number("predict_ms") + times.number("choose_ms") + times.number("register_ms") +
                 times.number("fuse_ms");
      if (!times.sound()) delay_ms = NAN;
    }
    double health = 0;
    const std::string_view name = row.word("health");
    for (int k = 0; k < 5; ++k)
      if (name == kHealths[k]) health = k;
    const double span = (t - before) / static_cast<double>(step);
    const double rate = span > 0 ? 1e-6 * row.number("events_read") / span : 0;
    double rotation = 0;
    for (const char* key : {"cov_rx_rx", "cov_ry_ry", "cov_rz_rz"})
      rotation = std::max(rotation, row.number(key));
    out.push_back({t - first,
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
                   std::sqrt(rotation) * 180 / M_PI,
                   health,
                   rate,
                   delay_ms,
                   row.number("points_matched"),
                   row.number("points"),
                   row.number("gyro_bias_x_rad_s"),
                   row.number("gyro_bias_y_rad_s"),
                   row.number("gyro_bias_z_rad_s"),
                   row.number("accel_bias_x_m_s2"),
                   row.number("accel_bias_y_m_s2"),
                   row.number("accel_bias_z_m_s2")});
    if (!row.sound())
      return Error{path, text("line ", i + 2, " is not as evpose writes it"), "give a complete run folder"};
    before = t;
  }
  if (out.empty()) return Error{path, "no poses", "give a run that tracked something"};
  return out;
}

}  // namespace evpose
