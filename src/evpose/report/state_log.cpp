// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/state_log.h"

#include "evpose/core/error.h"
#include "evpose/fusion/state.h"

namespace evpose {
namespace {

std::array<double, 5> stages_ms(const StageTimes& t) {
  return {1e3 * t.choose_s, 1e3 * t.events_s, 1e3 * t.predict_s, 1e3 * t.register_s, 1e3 * t.fuse_s};
}

void append(std::string* row, double value) { append_csv(*row, value); }

void append(std::string* row, const Eigen::Vector3d& v) {
  for (int i = 0; i < 3; ++i) append(row, v[i]);
}

const char* const kStateColumns =
    "t_s,x_m,y_m,z_m,qx,qy,qz,qw,vx_m_s,vy_m_s,vz_m_s,gyro_bias_x_rad_s,gyro_bias_y_rad_s,gyro_bias_z_rad_s,"
    "accel_bias_x_m_s2,accel_bias_y_m_s2,accel_bias_z_m_s2";

/// Upper triangle of the covariance of (translation in the map, rotation in the body), m and rad.
std::string covariance_columns() {
  std::string out;
  const char* const axes[] = {"x", "y", "z", "rx", "ry", "rz"};
  for (int i = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j) out += std::string(",cov_") + axes[i] + "_" + axes[j];
  return out;
}

void append(std::string* row, const Pose& T) {
  append(row, T.p);
  for (const double c : {T.q.x(), T.q.y(), T.q.z(), T.q.w()}) append(row, c);
}

void append(std::string* row, const Matrix6d& covariance) {
  for (int i = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j) append(row, covariance(i, j));
}

/// Text as a CSV field.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"') out += '"';
    out += c == '\n' || c == '\r' ? ' ' : c;
  }
  return out + '"';
}

}  // namespace

Matrix6d StateRow::covariance_matrix() const {
  Matrix6d out;
  std::size_t k = 0;
  for (int i = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j, ++k) out(i, j) = out(j, i) = covariance[k];
  return out;
}

void StateLog::add(const Update& u) {
  StateRow row;
  row.t = u.t;
  row.T_map_body = u.T_map_body;
  row.velocity = u.velocity;
  row.velocity_sigma = u.velocity_covariance.diagonal().cwiseMax(0).cwiseSqrt().cast<float>();
  row.gyro_bias = u.gyro_bias.cast<float>();
  row.accel_bias = u.accel_bias.cast<float>();
  std::size_t k = 0;
  for (int i = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j, ++k) row.covariance[k] = static_cast<float>(u.covariance(i, j));
  row.health = u.health;
  row.events_read = u.events_read;
  row.events_kept = u.events_kept;
  row.points = u.points;
  row.points_matched = u.points_matched;
  const std::array<double, 5> ms = stages_ms(u.times);
  for (std::size_t i = 0; i < ms.size(); ++i) row.stages_ms[i] = static_cast<float>(ms[i]);
  if (health.empty() || health.back().health != u.health) health.push_back({u.t, u.health, u.reason});
  rows.push_back(row);
}

std::string states_csv_header() {
  return kStateColumns + covariance_columns() +
         ",health,accepted,events_read,events_kept,points,points_matched,residual,innovation,probability,"
         "reason\n";
}

std::string states_csv_row(const Update& u) {
  std::string row = csv_seconds(u.t);
  append(&row, u.T_map_body);
  append(&row, u.velocity);
  append(&row, u.gyro_bias);
  append(&row, u.accel_bias);
  append(&row, u.covariance);
  char counts[100];
  std::snprintf(counts, sizeof counts, ",%s,%d,%d,%d,%d,%d", to_string(u.health), u.accepted ? 1 : 0,
                u.events_read, u.events_kept, u.points, u.points_matched);
  row += counts;
  append(&row, u.residual);
  append(&row, u.innovation);
  append(&row, u.probability);
  row += ',';
  if (!u.reason.empty()) row += quoted(u.reason);
  row += '\n';
  return row;
}

std::string imu_states_csv_header() {
  return text(kStateColumns, ",rate_x_rad_s,rate_y_rad_s,rate_z_rad_s", covariance_columns(), "\n");
}

std::string imu_states_csv_row(const FusionState& s) {
  std::string row = csv_seconds(s.t);
  append(&row, s.nav.T_map_body);
  append(&row, s.nav.velocity);
  append(&row, s.gyro_bias);
  append(&row, s.accel_bias);
  append(&row, s.angular_rate);
  append(&row, s.pose_covariance());
  return row + "\n";
}

std::string latency_csv_header() {
  std::string out = "t_s";
  for (const char* name : kStageNames) out += std::string(",") + name + "_ms";
  return out + "\n";
}

std::string latency_csv_row(const Update& u) {
  std::string row = csv_seconds(u.t);
  for (const double ms : stages_ms(u.times)) append(&row, ms);
  return row + "\n";
}

}  // namespace evpose
