// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>

#include "evpose/io/calibration/calibration_kinds.h"

namespace evpose {
namespace {

/// Basalt's camera types: our name and the numbers besides fx fy cx cy.
struct Model {
  const char* theirs;
  const char* ours;
  std::vector<const char*> numbers;
};
const std::array<Model, 7> kModels = {
    {{"pinhole", "none", {}},
     {"kb4", "equidistant", {"k1", "k2", "k3", "k4"}},
     {"ds", "ds", {"xi", "alpha"}},
     {"eucm", "eucm", {"alpha", "beta"}},
     {"ucm", "ucm", {"alpha"}},
     {"fov", "fov", {"w"}},
     {"pinhole-radtan8", "rational_polynomial", {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}}}};

/// {px, py, pz, qx, qy, qz, qw}
Expected<Pose> named_pose(const YamlDocument& document, const YamlNode& node, const std::string& key) {
  std::array<double, 7> v{};
  constexpr std::array<const char*, 7> kNames = {"px", "py", "pz", "qx", "qy", "qz", "qw"};
  for (std::size_t i = 0; i < v.size(); ++i) {
    const auto value = required_number(document, node, kNames[i]);
    if (!value) return value.error();
    v[i] = *value;
  }
  const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
  if (!(std::abs(q.norm() - 1) <= 1e-3))
    return document.error(node, text(key, ": the quaternion's norm is ", q.norm(), ", not 1"),
                          "give a unit quaternion");
  return Pose{q.normalized(), {v[0], v[1], v[2]}};
}

Expected<CameraIntrinsics> read_camera(const YamlDocument& document, const YamlNode& node,
                                       CalibratedCamera& camera) {
  const auto type = required(document, node, "camera_type");
  if (!type) return type.error();
  const auto model = std::find_if(kModels.begin(), kModels.end(),
                                  [&](const Model& m) { return (*type)->scalar == m.theirs; });
  if (model == kModels.end())
    return document.error(**type, "camera_type '" + (*type)->scalar + "' is not known",
                          "Basalt has pinhole, pinhole-radtan8, kb4, ds, eucm, ucm and fov");
  camera.model_line = (*type)->line;
  const auto numbers = required(document, node, "intrinsics");
  if (!numbers) return numbers.error();
  camera.numbers_line = (*numbers)->line;
  CameraIntrinsics c;
  const std::pair<const char*, double*> pinhole[] = {
      {"fx", &c.fx}, {"fy", &c.fy}, {"cx", &c.cx}, {"cy", &c.cy}};
  for (const auto& [key, target] : pinhole) {
    const auto value = required_number(document, **numbers, key);
    if (!value) return value.error();
    *target = *value;
  }
  std::vector<double> others;
  for (const char* key : model->numbers) {
    const auto value = required_number(document, **numbers, key);
    if (!value) return value.error();
    others.push_back(*value);
  }
  if (auto status = set_distortion(document, **numbers, model->ours, others, c); !status)
    return status.error();
  return c;
}

Expected<std::vector<CalibratedCamera>> read_cameras(const YamlDocument& document, const YamlNode& value0) {
  const auto intrinsics = required(document, value0, "intrinsics");
  if (!intrinsics) return intrinsics.error();
  const auto poses = required(document, value0, "T_imu_cam");
  if (!poses) return poses.error();
  const std::size_t count = (*intrinsics)->items.size();
  const auto sizes = required_numbers(document, value0, "resolution", 2 * count);
  if (!sizes) return sizes.error();
  if (count == 0 || (*poses)->items.size() != count)
    return document.error(**poses,
                          text((*poses)->items.size(), " transforms T_imu_cam for ", count, " cameras"),
                          "correct the lists");
  const YamlNode* offset = value0.find("cam_time_offset_ns");
  std::int64_t offset_ns = 0;
  if (offset != nullptr) {
    const auto value = document.integer(*offset, "cam_time_offset_ns");
    if (!value) return value.error();
    offset_ns = *value;
  }
  std::vector<CalibratedCamera> out;
  for (std::size_t i = 0; i < count; ++i) {
    CalibratedCamera camera;
    camera.name = text("cam", i);
    auto read = read_camera(document, (*intrinsics)->items[i], camera);
    if (!read) return read.error();
    const auto size = image_size(document, *value0.find("resolution"), (*sizes)[2 * i], (*sizes)[2 * i + 1]);
    if (!size) return size.error();
    read->size = *size;
    camera.intrinsics = *std::move(read);
    const auto T_imu_cam = named_pose(document, (*poses)->items[i], "T_imu_cam");
    if (!T_imu_cam) return T_imu_cam.error();
    camera.T_cam_imu = T_imu_cam->inverse();
    camera.has_timeshift = offset != nullptr;
    camera.timeshift_cam_imu_s = 1e-9 * static_cast<double>(offset_ns);
    out.push_back(std::move(camera));
  }
  return out;
}

/// The largest component of a noise given for each axis, or as one number.
Expected<double> largest(const YamlDocument& document, const YamlNode& value0, const std::string& key) {
  const auto node = required(document, value0, key);
  if (!node) return node.error();
  if ((*node)->kind == YamlNode::Kind::scalar) return document.number(**node, key);
  const auto values = document.numbers(**node, key, 3);
  if (!values) return values.error();
  return *std::max_element(values->begin(), values->end());
}

Expected<ImuNoise> read_noise(const YamlDocument& document, const YamlNode& value0) {
  ImuNoise noise;
  const std::pair<const char*, double*> values[] = {{"accel_noise_std", &noise.accel_density},
                                                    {"accel_bias_std", &noise.accel_walk},
                                                    {"gyro_noise_std", &noise.gyro_density},
                                                    {"gyro_bias_std", &noise.gyro_walk},
                                                    {"imu_update_rate", &noise.rate_hz}};
  for (const auto& [key, target] : values) {
    const auto value = largest(document, value0, key);
    if (!value) return value.error();
    if (*value <= 0)
      return document.error(*value0.find(key), text(key, ": ", *value, " is not positive"),
                            "give Basalt's value");
    *target = *value;
  }
  return noise;
}

}  // namespace

Expected<CalibrationFile> read_basalt(const YamlDocument& document) {
  const YamlNode& value0 = *document.root.find("value0");
  CalibrationFile out;
  const bool has_cameras = value0.find("intrinsics") != nullptr;
  out.kind = has_cameras ? "Basalt cameras with IMU" : "Basalt motion capture";
  for (const char* key : {"T_imu_marker", "T_mocap_world"}) {
    const YamlNode* node = value0.find(key);
    if (node == nullptr) continue;
    const auto pose = named_pose(document, *node, key);
    if (!pose) return pose.error();
    out.transforms.push_back({key, *pose});
  }
  if (!has_cameras) {
    if (out.transforms.empty()) return required(document, value0, "intrinsics").error();
    return out;
  }
  auto cameras = read_cameras(document, value0);
  if (!cameras) return cameras.error();
  out.cameras = *std::move(cameras);
  if (value0.find("imu_update_rate") == nullptr && value0.find("accel_noise_std") == nullptr) return out;
  const auto noise = read_noise(document, value0);
  if (!noise) return noise.error();
  out.imu_noise = *noise;
  return out;
}

}  // namespace evpose
