// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <numbers>

#include "evpose/camera/placement.h"
#include "info_parts.h"

namespace evpose {
namespace {

nlohmann::ordered_json pose_json(const Pose& T) {
  return {{"p", {T.p.x(), T.p.y(), T.p.z()}}, {"q_xyzw", {T.q.x(), T.q.y(), T.q.z(), T.q.w()}}};
}

std::string pose_text(const Pose& T) {
  return "(" + fixed(T.p.x(), 4) + ", " + fixed(T.p.y(), 4) + ", " + fixed(T.p.z(), 4) + ") m, turned " +
         fixed(2 * std::acos(std::min(1.0, std::abs(T.q.w()))) * 180 / std::numbers::pi, 2) + " deg";
}

/// Full angles of view along the middle row and column; 0 where rays are missing.
std::pair<double, double> view_deg(const Camera& camera) {
  const double w = camera.size().width - 1, h = camera.size().height - 1;
  const auto angle = [&](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    const auto ra = camera.unproject(a), rb = camera.unproject(b);
    if (!ra || !rb) return 0.0;
    const Eigen::Vector3d axis(0, 0, 1);
    return (std::acos(ra->dot(axis)) + std::acos(rb->dot(axis))) * 180 / std::numbers::pi;
  };
  return {angle({0, h / 2}, {w, h / 2}), angle({w / 2, 0}, {w / 2, h})};
}

void describe_intrinsics(Sheet& sheet, const CameraIntrinsics& c, nlohmann::ordered_json& json) {
  std::string numbers;
  for (const double k : c.distortion) numbers += (numbers.empty() ? "" : ", ") + text(k);
  sheet.note("model", c.distortion_model + (numbers.empty() ? "" : " [" + numbers + "]"));
  sheet.note("intrinsics", text("f ", c.fx, ", ", c.fy, " px, centre (", c.cx, ", ", c.cy, ")"));
  json["distortion_model"] = c.distortion_model;
  json["distortion"] = c.distortion;
  json["intrinsics"] = {c.fx, c.fy, c.cx, c.cy};
  json["resolution"] = {c.size.width, c.size.height};
  const auto camera = make_camera(c);
  std::string size =
      c.size == ImageSize{} ? "size not stated" : text(c.size.width, " x ", c.size.height, " pixels");
  if (camera) {
    const auto [across, down] = view_deg(**camera);
    if (across > 0 && down > 0) size += ", sees " + fixed(across, 0) + " x " + fixed(down, 0) + " deg";
    json["view_deg"] = {across, down};
  }
  json["can_be_tracked_with"] = camera.ok();
  sheet.note("image", size);
}

}  // namespace

void describe_camera(Sheet& sheet, const CalibratedCamera& camera, const std::string& key) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  sheet.section("camera " + camera.name + (camera.sees.empty() ? "" : " (" + camera.sees + " camera)"), "");
  json["sees"] = camera.sees;
  if (camera.intrinsics)
    describe_intrinsics(sheet, *camera.intrinsics, json);
  else
    sheet.note("model", "not in this file");
  if (camera.T_cam_imu) {
    const Pose T_imu_cam = camera.T_cam_imu->inverse();
    sheet.note("on the body", placement_in_words(T_imu_cam));
    sheet.note("", "(of the IMU's axes, taken as x forward, y left, z up)");
    json["placement"] = placement_in_words(T_imu_cam);
    json["T_cam_imu"] = pose_json(*camera.T_cam_imu);
  } else {
    sheet.note("on the body", "not told: no transform to an IMU");
  }
  if (camera.T_cam_cam0) json["T_cam_cam0"] = pose_json(*camera.T_cam_cam0);
  if (camera.T_cam_cam0 && camera.T_cam_cam0->p.norm() > 0)
    sheet.note("first camera", pose_text(*camera.T_cam_cam0) + ", as this one sees it");
  if (camera.has_timeshift) {
    const double ms = 1e3 * camera.timeshift_cam_imu_s;
    sheet.note("clock", ms == 0 ? "the IMU's"
                                : fixed(std::abs(ms), 3) + " ms " + (ms > 0 ? "behind" : "ahead of") +
                                      " the IMU's: t_imu = t_cam " + (ms > 0 ? "+ " : "- ") +
                                      fixed(std::abs(ms), 3) + " ms");
    json["timeshift_cam_imu_s"] = camera.timeshift_cam_imu_s;
  }
  sheet.row("", "", key, json);
}

Status describe_calibration(Sheet& sheet, const std::string& path) {
  const auto file = read_calibration(path);
  if (!file) return file.error();
  sheet.section("calibration: " + path, "calibration");
  sheet.row("kind", file->kind, "kind", file->kind);
  sheet.row("cameras", text(file->cameras.size()), "cameras", file->cameras.size());
  nlohmann::ordered_json transforms = nlohmann::ordered_json::object();
  for (const NamedTransform& t : file->transforms) {
    sheet.note(t.name, pose_text(t.pose));
    transforms[t.name] = pose_json(t.pose);
  }
  if (!transforms.empty()) sheet.row("", "", "transforms", transforms);
  for (const CalibratedCamera& camera : file->cameras)
    describe_camera(sheet, camera, "camera " + camera.name);
  if (file->imu_noise) {
    const ImuNoise& n = *file->imu_noise;
    sheet.section("IMU noise", "imu_noise");
    sheet.row("gyroscope", text(n.gyro_density, " rad/s/sqrt(Hz), walk ", n.gyro_walk, " rad/s^2/sqrt(Hz)"),
              "gyro_density", n.gyro_density);
    sheet.row("accelerom.", text(n.accel_density, " m/s^2/sqrt(Hz), walk ", n.accel_walk, " m/s^3/sqrt(Hz)"),
              "accel_density", n.accel_density);
    sheet.row("rate", text(n.rate_hz, " Hz"), "rate_hz", n.rate_hz);
    sheet.row("", "", "gyro_walk", n.gyro_walk);
    sheet.row("", "", "accel_walk", n.accel_walk);
  }
  for (const Error& note : file->notes) sheet.find(note);
  return {};
}

}  // namespace evpose
