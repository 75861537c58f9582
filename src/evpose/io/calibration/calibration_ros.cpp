// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "evpose/io/calibration/calibration_kinds.h"

namespace evpose {
namespace {

/// {rows, cols, data} whose rows and cols do not count the data: a known slip, worth a note.
void note_wrong_count(const YamlDocument& document, const YamlNode& node, const std::string& key,
                      std::size_t count, std::vector<Error>& notes) {
  const YamlNode *rows = node.find("rows"), *cols = node.find("cols");
  if (rows == nullptr || cols == nullptr) return;
  const auto r = document.number(*rows, "rows"), c = document.number(*cols, "cols");
  if (!r || !c || *r * *c == static_cast<double>(count)) return;
  notes.push_back(document.error(node, text(key, " says ", *r, " x ", *c, " but lists ", count, " numbers"),
                                 "all of them are taken; correct rows and cols"));
}

Expected<CameraIntrinsics> camera_info(const YamlDocument& document, CalibratedCamera& camera,
                                       std::vector<Error>& notes) {
  const YamlNode& root = document.root;
  CameraIntrinsics out;
  const auto K = required_numbers(document, root, "camera_matrix", 9);
  if (!K) return K.error();
  camera.numbers_line = root.find("camera_matrix")->line;
  out.fx = (*K)[0], out.cx = (*K)[2], out.fy = (*K)[4], out.cy = (*K)[5];
  // VECtor writes the distortion's name under camera_model.
  const char* key = root.find("distortion_model") != nullptr ? "distortion_model" : "camera_model";
  const auto model = required(document, root, key);
  if (!model) return model.error();
  camera.model_line = (*model)->line;
  const auto D = required_numbers(document, root, "distortion_coefficients");
  if (!D) return D.error();
  const YamlNode& node = *root.find("distortion_coefficients");
  note_wrong_count(document, node, "distortion_coefficients", D->size(), notes);
  if (auto status = set_distortion(document, node, distortion_name((*model)->scalar), *D, out); !status)
    return status.error();
  const auto size = image_size_of(document, root, "image_width", "image_height");
  if (!size) return size.error();
  out.size = *size;
  return out;
}

}  // namespace

Expected<CalibrationFile> read_camera_info(const YamlDocument& document) {
  const YamlNode& root = document.root;
  CalibrationFile out;
  CalibratedCamera camera;
  camera.name = "cam0";
  if (const YamlNode* name = root.find("camera_name"); name != nullptr && !name->scalar.empty())
    camera.name = name->scalar;
  if (camera.name.find("event") != std::string::npos) camera.sees = "event";
  if (camera.name.find("regular") != std::string::npos) camera.sees = "frame";
  auto intrinsics = camera_info(document, camera, out.notes);
  if (!intrinsics) return intrinsics.error();
  camera.intrinsics = *std::move(intrinsics);
  // ESVO2: camera to body, its body being the IMU.
  const auto T_b_c = optional_transform(document, root, "T_b_c");
  if (!T_b_c) return T_b_c.error();
  if (*T_b_c) camera.T_cam_imu = (*T_b_c)->inverse();
  out.kind = *T_b_c ? "ESVO2 camera" : root.find("distortion_model") ? "ROS camera_info" : "VECtor camera";
  out.cameras.push_back(std::move(camera));
  return out;
}

Expected<CalibrationFile> read_ncamera(const YamlDocument& document) {
  const YamlNode& list = *document.root.find("cameras");
  CalibrationFile out;
  out.kind = "ncamera rig";
  for (const YamlNode& item : list.items) {
    const auto node = required(document, item, "camera");
    if (!node) return node.error();
    const YamlNode& entry = **node;
    CalibratedCamera camera;
    camera.name = text("cam", out.cameras.size());
    if (const YamlNode* label = entry.find("label")) camera.name = label->scalar;
    if (camera.name.find("dvs") != std::string::npos || camera.name.find("event") != std::string::npos)
      camera.sees = "event";
    const auto f = required_numbers(document, entry, "intrinsics");
    if (!f) return f.error();
    camera.numbers_line = entry.find("intrinsics")->line;
    const auto type = required(document, entry, "type");
    if (!type) return type.error();
    camera.model_line = (*type)->line;
    CameraIntrinsics c;
    std::string model = (*type)->scalar;
    std::vector<double> others;
    if (f->size() < 4)
      return document.error(*entry.find("intrinsics"), text("intrinsics: ", f->size(), " numbers"),
                            "give [fu, fv, pu, pv]");
    const std::size_t lead = f->size() - 4;  // omni: xi before the four
    others.assign(f->begin(), f->begin() + static_cast<std::ptrdiff_t>(lead));
    c.fx = (*f)[lead], c.fy = (*f)[lead + 1], c.cx = (*f)[lead + 2], c.cy = (*f)[lead + 3];
    std::string distortion = "none";
    const YamlNode* blamed = entry.find("intrinsics");
    if (const YamlNode* d = entry.find("distortion"); d != nullptr && d->find("type") != nullptr) {
      distortion = distortion_name(d->find("type")->scalar);
      if (distortion != "none") {
        const auto values = required_numbers(document, *d, "parameters");
        if (!values) return values.error();
        others.insert(others.end(), values->begin(), values->end());
        blamed = d->find("parameters");
      }
    }
    model = model == "pinhole" ? distortion : distortion == "none" ? model : model + "-" + distortion;
    if (auto status = set_distortion(document, *blamed, model, others, c); !status) return status.error();
    const auto size = image_size_of(document, entry, "image_width", "image_height");
    if (!size) return size.error();
    c.size = *size;
    camera.intrinsics = std::move(c);
    const auto T_B_C = optional_transform(document, item, "T_B_C");  // camera to body
    if (!T_B_C) return T_B_C.error();
    if (*T_B_C) camera.T_cam_imu = (*T_B_C)->inverse();
    out.cameras.push_back(std::move(camera));
  }
  if (out.cameras.empty()) return document.error(list, "cameras: an empty list", "list the cameras");
  return out;
}

Expected<CalibrationFile> read_vector_extrinsics(const YamlDocument& document) {
  CalibrationFile out;
  out.kind = "VECtor extrinsics";
  for (const auto& [key, node] : document.root.members) {
    if (!key.starts_with("cam")) continue;
    CalibratedCamera camera;
    camera.name = key;
    const auto T_cam0_cam = optional_transform(document, node, "T_cam0_" + key);
    if (!T_cam0_cam) return T_cam0_cam.error();
    if (*T_cam0_cam) camera.T_cam_cam0 = (*T_cam0_cam)->inverse();
    const auto T_cam_imu = optional_transform(document, node, "T_cam_imu");
    if (!T_cam_imu) return T_cam_imu.error();
    camera.T_cam_imu = *T_cam_imu;
    for (const char* body : {"T_cam_body", "T_body_cam"}) {
      const auto T = optional_transform(document, node, body);
      if (!T) return T.error();
      if (*T) out.transforms.push_back({key + "." + body, **T});
    }
    const bool tells = camera.T_cam_cam0 || camera.T_cam_imu;
    if (tells) out.cameras.push_back(std::move(camera));
  }
  if (out.cameras.empty() && out.transforms.empty())
    return Error{document.path, "cameras without intrinsics or transforms", "give the whole calibration"};
  return out;
}

Expected<CalibrationFile> read_euroc_sensor(const YamlDocument& document) {
  const YamlNode& root = document.root;
  CalibrationFile out;
  const auto T_BS = optional_transform(document, root, "T_BS");  // sensor to body, the body being the IMU
  if (!T_BS) return T_BS.error();
  if (root.find("gyroscope_noise_density") != nullptr) {
    out.kind = "EuRoC IMU";
    ImuNoise noise;
    const std::pair<const char*, double*> values[] = {{"accelerometer_noise_density", &noise.accel_density},
                                                      {"accelerometer_random_walk", &noise.accel_walk},
                                                      {"gyroscope_noise_density", &noise.gyro_density},
                                                      {"gyroscope_random_walk", &noise.gyro_walk},
                                                      {"rate_hz", &noise.rate_hz}};
    for (const auto& [key, target] : values) {
      const auto value = required_number(document, root, key);
      if (!value) return value.error();
      if (*value <= 0)
        return document.error(*root.find(key), text(key, ": ", *value, " is not positive"), "correct it");
      *target = *value;
    }
    out.imu_noise = noise;
    return out;
  }
  out.kind = "EuRoC camera";
  CalibratedCamera camera;
  camera.name = "cam0";
  const auto f = required_numbers(document, root, "intrinsics", 4);
  if (!f) return f.error();
  camera.numbers_line = root.find("intrinsics")->line;
  CameraIntrinsics c;
  c.fx = (*f)[0], c.fy = (*f)[1], c.cx = (*f)[2], c.cy = (*f)[3];
  const auto model = required(document, root, "distortion_model");
  if (!model) return model.error();
  camera.model_line = (*model)->line;
  const auto D = required_numbers(document, root, "distortion_coefficients");
  if (!D) return D.error();
  if (auto status = set_distortion(document, *root.find("distortion_coefficients"),
                                   distortion_name((*model)->scalar), *D, c);
      !status)
    return status.error();
  const auto size = required_numbers(document, root, "resolution", 2);
  if (!size) return size.error();
  const auto pixels = image_size(document, *root.find("resolution"), (*size)[0], (*size)[1]);
  if (!pixels) return pixels.error();
  c.size = *pixels;
  camera.intrinsics = std::move(c);
  if (*T_BS) camera.T_cam_imu = (*T_BS)->inverse();
  out.cameras.push_back(std::move(camera));
  return out;
}

Expected<CalibrationFile> read_raw_camera(const YamlDocument& document) {
  const YamlNode& raw = *document.root.find("raw");
  CalibrationFile out;
  out.kind = "raw and rectified camera";
  CalibratedCamera camera;
  camera.name = "cam0";
  const auto f = required_numbers(document, raw, "intrinsics", 4);
  if (!f) return f.error();
  camera.numbers_line = raw.find("intrinsics")->line;
  CameraIntrinsics c;
  c.fx = (*f)[0], c.fy = (*f)[1], c.cx = (*f)[2], c.cy = (*f)[3];
  const auto model = required(document, raw, "model");
  if (!model) return model.error();
  camera.model_line = (*model)->line;
  const auto D = required_numbers(document, raw, "distortion");
  if (!D) return D.error();
  if (auto status =
          set_distortion(document, *raw.find("distortion"), distortion_name((*model)->scalar), *D, c);
      !status)
    return status.error();
  const auto size = image_size_of(document, document.root, "width", "height");
  if (!size) return size.error();
  c.size = *size;
  camera.intrinsics = std::move(c);
  out.cameras.push_back(std::move(camera));
  return out;
}

}  // namespace evpose
