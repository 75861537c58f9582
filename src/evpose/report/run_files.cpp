// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/run_files.h"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "evpose/io/files/atomic_file.h"
#include "evpose/report/csv_table.h"

namespace evpose {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kMostBytes = std::size_t{4} << 30;

Health health_of(std::string_view name, bool* known) {
  for (const Health health : kHealths)
    if (name == to_string(health)) return health;
  *known = false;
  return Health::waiting;
}

Matrix6d covariance_of(CsvRow& row) {
  const char* const axes[] = {"x", "y", "z", "rx", "ry", "rz"};
  Matrix6d out;
  for (int i = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j)
      out(i, j) = out(j, i) = row.number(std::string("cov_") + axes[i] + "_" + axes[j]);
  return out;
}

RunRow run_row(CsvRow& row, bool* known) {
  RunRow out;
  out.t = row.stamp_ns("t_s");
  const Eigen::Quaterniond q(row.number("qw"), row.number("qx"), row.number("qy"), row.number("qz"));
  out.T_map_body = {q.norm() > 0.5 ? q.normalized() : Eigen::Quaterniond::Identity(),
                    {row.number("x_m"), row.number("y_m"), row.number("z_m")}};
  out.velocity = {row.number("vx_m_s"), row.number("vy_m_s"), row.number("vz_m_s")};
  out.gyro_bias = {row.number("gyro_bias_x_rad_s"), row.number("gyro_bias_y_rad_s"),
                   row.number("gyro_bias_z_rad_s")};
  out.accel_bias = {row.number("accel_bias_x_m_s2"), row.number("accel_bias_y_m_s2"),
                    row.number("accel_bias_z_m_s2")};
  out.covariance = covariance_of(row);
  out.health = health_of(row.word("health"), known);
  out.reason = row.rest("reason");
  out.events_read = static_cast<int>(row.number("events_read"));
  out.points = static_cast<int>(row.number("points"));
  out.points_matched = static_cast<int>(row.number("points_matched"));
  return out;
}

Expected<std::vector<RunRow>> read_rows(const std::string& path) {
  const auto content = read_text_file(path, kMostBytes);
  if (!content) return content.error();
  const CsvTable table(*content);
  std::vector<RunRow> out;
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    CsvRow row(table, table.rows[i]);
    bool known = true;
    out.push_back(run_row(row, &known));
    if (!row.sound() || !known)
      return Error{path, text("line ", i + 2, " is not as evpose writes it"), "give a complete run folder"};
  }
  if (out.empty()) return Error{path, "no poses", "give a run that tracked something"};
  return out;
}

/// What summary.json says of the run.
Status read_summary(const std::string& path, RunFiles& run) {
  const auto content = read_text_file(path, kMostBytes);
  if (!content) return content.error();
  const auto json = Json::parse(*content, nullptr, false);
  const auto input = json.is_object() ? json.find("input") : json.end();
  if (json.is_discarded() || !json.is_object())
    return Error{path, "is not as evpose writes it", "give a complete run folder"};
  run.interrupted = json.value("interrupted", Json(false)) == true;
  if (input == json.end() || !input->is_object()) return {};  // a live one
  const auto word = [&](const char* key) {
    const auto found = input->find(key);
    return found != input->end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  run.input = {word("recording"), word("map"), word("calibration"), word("occluders")};
  return {};
}

double widest(const Matrix6d& covariance, int from) {
  const Eigen::Matrix3d part = covariance.block<3, 3>(from, from);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(part, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues()[2]));
}

}  // namespace

double RunRow::position_sigma_m() const { return widest(covariance, 0); }

double RunRow::rotation_sigma_deg() const { return widest(covariance, 3) * 180 / M_PI; }

bool is_run_folder(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path + "/states.csv", ignored) &&
         std::filesystem::is_regular_file(path + "/summary.json", ignored);
}

Expected<RunFiles> read_run_files(const std::string& folder) {
  if (!is_run_folder(folder))
    return Error{folder, "is no run folder: it has no states.csv and summary.json",
                 "give what evpose track -o wrote"};
  RunFiles out;
  out.folder = folder;
  if (const auto ok = read_summary(folder + "/summary.json", out); !ok) return ok.error();
  out.calibration = folder + "/calibration.yaml";
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(out.calibration, ignored)) out.calibration = out.input.calibration;
  auto rows = read_rows(folder + "/states.csv");
  if (!rows) return rows.error();
  out.rows = *std::move(rows);
  return out;
}

}  // namespace evpose
