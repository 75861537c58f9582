// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/view/run_view.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string_view>

#include "evpose/io/files/atomic_file.h"
#include "evpose/report/csv_table.h"

namespace evpose {
namespace {

/// From the newest event to the pose; NAN where the row does not tell.
double delay_ms(CsvRow times) {
  const double sum = times.number("predict_ms") + times.number("register_ms") + times.number("fuse_ms");
  return times.sound() ? sum : NAN;
}

double number_of_health(std::string_view name) {
  const auto found = std::ranges::find_if(kHealths, [&](Health h) { return name == to_string(h); });
  return found == kHealths.end() ? 0 : static_cast<double>(found - kHealths.begin());
}

/// The largest sigma of the rotation, degrees.
double rotation_sigma_deg(CsvRow& row) {
  double variance = 0;
  for (const char* key : {"cov_rx_rx", "cov_ry_ry", "cov_rz_rz"})
    variance = std::max(variance, row.number(key));
  return std::sqrt(variance) * 180 / M_PI;
}

/// `since_s`: since the run's first row. `span_s`: since the row before, whose events are counted.
ViewRow read_row(CsvRow& row, double since_s, double span_s, double delay) {
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
  const CsvTable states(*content);
  const auto latency_text = read_text_file(folder + "/latency.csv");
  const CsvTable latency(latency_text ? std::string_view(*latency_text) : std::string_view());
  const bool timed = latency.rows.size() == states.rows.size();
  const std::size_t step = states.rows.size() / std::max<std::size_t>(most, 1) + 1;
  std::vector<ViewRow> out;
  double first = 0, before = 0;
  for (std::size_t i = 0; i < states.rows.size(); i += step) {
    CsvRow row(states, states.rows[i]);
    const double t = row.number("t_s");
    if (i == 0) first = before = t;
    const double span_s = (t - before) / static_cast<double>(step);
    out.push_back(read_row(row, t - first, span_s, timed ? delay_ms(CsvRow(latency, latency.rows[i])) : NAN));
    if (!row.sound())
      return Error{path, text("line ", i + 2, " is not as evpose writes it"), "give a complete run folder"};
    before = t;
  }
  if (out.empty()) return Error{path, "no poses", "give a run that tracked something"};
  return out;
}

}  // namespace evpose
