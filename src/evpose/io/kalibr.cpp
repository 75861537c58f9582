// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/kalibr.h"

#include <array>
#include <charconv>
#include <cmath>

#include "evpose/io/atomic_file.h"
#include "evpose/io/yaml_document.h"

namespace evpose {
namespace {

std::string camera_name(int index) { return "cam" + std::to_string(index); }

Expected<const YamlNode*> required(const YamlDocument& document, const YamlNode& parent,
                                   const std::string& key) {
  const YamlNode* node = parent.find(key);
  if (node == nullptr)
    return document.error(parent, "'" + key + "' is missing", "add it, as Kalibr writes it");
  return node;
}

Expected<int> pixels(const YamlDocument& document, const YamlNode& node, double value) {
  if (value < 1 || value > 32767 || value != std::floor(value))
    return document.error(node, text("resolution: ", value, " is not a number of pixels"),
                          "write [width, height]");
  return static_cast<int>(value);
}

Status read_distortion(const YamlDocument& document, const YamlNode& camera, CameraIntrinsics& out) {
  const auto model = required(document, camera, "distortion_model");
  if (!model) return model.error();
  auto name = document.string(**model, "distortion_model");
  if (!name) return name.error();
  out.distortion_model = *name;
  std::size_t count = 0;
  if (*name == "radtan" || *name == "equidistant") {
    count = 4;
  } else if (*name != "none") {
    return document.error(**model, "distortion_model '" + *name + "' is not supported",
                          "calibrate with radtan, equidistant or none");
  }
  const YamlNode* coefficients = camera.find("distortion_coeffs");
  if (coefficients == nullptr && count == 0) return {};
  if (coefficients == nullptr) return required(document, camera, "distortion_coeffs").error();
  auto values = document.numbers(*coefficients, "distortion_coeffs");
  if (!values) return values.error();
  const bool with_k3 = *name == "radtan" && values->size() == 5;
  if (values->size() != count && !with_k3)
    return document.error(*coefficients,
                          text("distortion_coeffs: ", values->size(), " numbers, ", *name, " has ", count),
                          "correct the list or the model");
  out.distortion = *std::move(values);
  return {};
}

Expected<CameraIntrinsics> read_intrinsics(const YamlDocument& document, const YamlNode& camera) {
  CameraIntrinsics out;
  const auto model = required(document, camera, "camera_model");
  if (!model) return model.error();
  if ((*model)->scalar != "pinhole")
    return document.error(**model, "camera_model '" + (*model)->scalar + "' is not supported",
                          "calibrate with pinhole-radtan or pinhole-equi");
  const auto intrinsics = required(document, camera, "intrinsics");
  if (!intrinsics) return intrinsics.error();
  const auto f = document.numbers(**intrinsics, "intrinsics", 4);
  if (!f) return f.error();
  out.fx = (*f)[0], out.fy = (*f)[1], out.cx = (*f)[2], out.cy = (*f)[3];
  const auto resolution = required(document, camera, "resolution");
  if (!resolution) return resolution.error();
  const auto size = document.numbers(**resolution, "resolution", 2);
  if (!size) return size.error();
  const auto width = pixels(document, **resolution, (*size)[0]);
  if (!width) return width.error();
  const auto height = pixels(document, **resolution, (*size)[1]);
  if (!height) return height.error();
  out.size = {*width, *height};
  if (auto status = read_distortion(document, camera, out); !status) return status.error();
  if (const auto made = make_camera(out); !made)
    return document.error(**intrinsics, made.error().what, made.error().fix);
  return out;
}

/// T_cam_imu of camera `index`, by its own entry or through its neighbours of lower number.
Status read_extrinsics(const YamlDocument& document, int index, KalibrCamera& out) {
  Pose T_cam_link;
  for (int i = index; i >= 0; --i) {
    const YamlNode* camera = document.root.find(camera_name(i));
    if (camera == nullptr) return {};
    if (const YamlNode* direct = camera->find("T_cam_imu")) {
      const auto T = document.transform(*direct, "T_cam_imu");
      if (!T) return T.error();
      out.T_cam_body = T_cam_link * *T;
      out.has_extrinsics = true;
      return {};
    }
    const YamlNode* step = camera->find("T_cn_cnm1");
    if (step == nullptr) return {};
    const auto T = document.transform(*step, "T_cn_cnm1");
    if (!T) return T.error();
    T_cam_link = T_cam_link * *T;
  }
  return {};
}

Expected<double> positive(const YamlDocument& document, const YamlNode& parent, const std::string& key) {
  const auto node = required(document, parent, key);
  if (!node) return node.error();
  const auto value = document.number(**node, key);
  if (!value) return value.error();
  if (*value <= 0)
    return document.error(**node, text(key, ": ", *value, " is not positive"), "give Kalibr's value");
  return *value;
}

std::string exact(double value) {
  std::array<char, 40> buffer{};
  return {buffer.data(), std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr};
}

std::string list(const std::vector<double>& values) {
  std::string out = "[";
  for (std::size_t i = 0; i < values.size(); ++i) out += (i == 0 ? "" : ", ") + exact(values[i]);
  return out + "]";
}

}  // namespace

Expected<KalibrCamera> read_kalibr_camera(const std::string& path, int index) {
  const auto document = YamlDocument::read(path);
  if (!document) return document.error();
  const YamlNode* camera = document->root.find(camera_name(index));
  if (camera == nullptr)
    return Error{path, "no entry '" + camera_name(index) + "'",
                 "give Kalibr's camchain, or another number by events.camera in recording.yaml"};
  KalibrCamera out;
  auto intrinsics = read_intrinsics(*document, *camera);
  if (!intrinsics) return intrinsics.error();
  out.intrinsics = *std::move(intrinsics);
  if (auto status = read_extrinsics(*document, index, out); !status) return status.error();
  if (const YamlNode* shift = camera->find("timeshift_cam_imu")) {
    const auto value = document->number(*shift, "timeshift_cam_imu");
    if (!value) return value.error();
    if (std::abs(*value) > 1e6)
      return document->error(*shift, text("timeshift_cam_imu: ", *value, " s is out of range"),
                             "give seconds");
    out.timeshift_cam_imu_s = *value;
  }
  return out;
}

Status write_kalibr_camera(const std::string& path, const KalibrCamera& camera) {
  const CameraIntrinsics& c = camera.intrinsics;
  std::string out = "cam0:\n  camera_model: pinhole\n";
  out += "  distortion_coeffs: " + list(c.distortion) + "\n  distortion_model: " + c.distortion_model + "\n";
  out += "  intrinsics: " + list({c.fx, c.fy, c.cx, c.cy}) + "\n";
  out += text("  resolution: [", c.size.width, ", ", c.size.height, "]\n");
  if (camera.has_extrinsics) {
    const Eigen::Matrix4d T = camera.T_cam_body.matrix();
    out += "  T_cam_imu:\n";
    for (int r = 0; r < 4; ++r) out += "  - " + list({T(r, 0), T(r, 1), T(r, 2), T(r, 3)}) + "\n";
    out += "  timeshift_cam_imu: " + exact(camera.timeshift_cam_imu_s) + "\n";
  }
  return write_text_file(path, out);
}

Expected<ImuNoise> read_kalibr_imu(const std::string& path) {
  const auto document = YamlDocument::read(path);
  if (!document) return document.error();
  const YamlNode* nested = document->root.find("imu0");
  const YamlNode& imu = nested != nullptr ? *nested : document->root;
  if (const YamlNode* model = imu.find("model");
      model != nullptr && model->scalar.starts_with("scale-misalignment"))
    return document->error(*model, "model '" + model->scalar + "' is not supported",
                           "calibrate with model calibrated");
  ImuNoise noise;
  const std::pair<const char*, double*> values[] = {{"accelerometer_noise_density", &noise.accel_density},
                                                    {"accelerometer_random_walk", &noise.accel_walk},
                                                    {"gyroscope_noise_density", &noise.gyro_density},
                                                    {"gyroscope_random_walk", &noise.gyro_walk},
                                                    {"update_rate", &noise.rate_hz}};
  for (const auto& [key, target] : values) {
    const auto value = positive(*document, imu, key);
    if (!value) return value.error();
    *target = *value;
  }
  return noise;
}

Status write_kalibr_imu(const std::string& path, const ImuNoise& noise) {
  return write_text_file(path, "accelerometer_noise_density: " + exact(noise.accel_density) +
                                   "\naccelerometer_random_walk: " + exact(noise.accel_walk) +
                                   "\ngyroscope_noise_density: " + exact(noise.gyro_density) +
                                   "\ngyroscope_random_walk: " + exact(noise.gyro_walk) +
                                   "\nupdate_rate: " + exact(noise.rate_hz) + "\n");
}

}  // namespace evpose
