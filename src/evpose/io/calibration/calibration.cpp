// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/calibration/calibration.h"

#include <algorithm>
#include <cmath>

#include "evpose/io/calibration/calibration_kinds.h"

namespace evpose {
namespace {

constexpr double kFarFromImu_m = 0.5;
constexpr double kLongShift_s = 0.1;

using Reader = Expected<CalibrationFile> (*)(const YamlDocument&);

bool has(const YamlNode& node, const char* key) { return node.find(key) != nullptr; }

/// A member whose name begins so, followed by a digit; nullptr if there is none.
const YamlNode* numbered(const YamlNode& node, const std::string& word) {
  for (const auto& [key, value] : node.members)
    if (key.size() > word.size() && key.starts_with(word) && key[word.size()] >= '0' &&
        key[word.size()] <= '9')
      return &value;
  return nullptr;
}

bool any_key(const YamlNode& node, const std::string& word) {
  return std::any_of(node.members.begin(), node.members.end(),
                     [&](const auto& member) { return member.key.find(word) != std::string::npos; });
}

/// The reader for a file, by its keys; the more telling first.
Reader reader_for(const YamlNode& root) {
  if (root.kind == YamlNode::Kind::scalar) return read_calib_txt;
  if (has(root, "value0")) return read_basalt;
  if (has(root, "cameras")) return read_ncamera;
  if (has(root, "intrinsics") && has(root, "extrinsics")) return read_dsec;
  if (has(root, "camera_matrix")) return read_camera_info;
  if (has(root, "projection_parameters") || has(root, "mirror_parameters")) return read_opencv_pinhole;
  if (has(root, "K") && has(root, "distortion")) return read_canny_evt;
  if (any_key(root, "Camera.fx") || any_key(root, "Camera1.fx")) return read_orb_slam;
  if (any_key(root, "extrinsicRotation") || any_key(root, "body_T_cam")) return read_vins;
  if (has(root, "raw") && has(*root.find("raw"), "intrinsics")) return read_raw_camera;
  if (has(root, "T_BS") || has(root, "sensor_type")) return read_euroc_sensor;
  if (const YamlNode* camera = numbered(root, "cam")) {
    if (has(*camera, "intrinsics")) return read_kalibr_chain;
    return read_vector_extrinsics;
  }
  if (has(root, "imu0") || has(root, "accelerometer_noise_density") || has(root, "gyroscope_noise_density"))
    return read_kalibr_imu_file;
  return nullptr;
}

/// Transforms at the root that no reader knows better.
Status take_transforms(const YamlDocument& document, CalibrationFile& file) {
  for (const auto& [key, value] : document.root.members) {
    if (!key.starts_with("T_")) continue;
    const auto known = std::find_if(file.transforms.begin(), file.transforms.end(),
                                    [name = key](const auto& t) { return t.name == name; });
    if (known != file.transforms.end() || value.kind == YamlNode::Kind::scalar) continue;
    const auto pose = document.transform(value, key);
    if (!pose) return pose.error();
    file.transforms.push_back({key, *pose});
  }
  return {};
}

/// How far the principal point lies from the middle of an image, in shares of its size.
double off_centre(const CameraIntrinsics& c, ImageSize size) {
  return std::hypot(c.cx / size.width - 0.5, c.cy / size.height - 0.5);
}

void look_at_intrinsics(const CalibratedCamera& camera, CalibrationFile& file) {
  const CameraIntrinsics& c = *camera.intrinsics;
  if (c.size == ImageSize{}) return;
  const std::string where = text(file.path, ":", camera.numbers_line);
  const ImageSize turned{c.size.height, c.size.width};
  if (c.size != turned && off_centre(c, turned) + 0.1 < off_centre(c, c.size)) {
    file.notes.push_back(
        {where,
         text(camera.name, ": the principal point (", std::round(c.cx), ", ", std::round(c.cy), ") fits ",
              turned.width, " x ", turned.height, " pixels better than ", c.size.width, " x ", c.size.height),
         "write the resolution as [width, height]"});
  } else if (c.cx < 0 || c.cy < 0 || c.cx >= c.size.width || c.cy >= c.size.height) {
    file.notes.push_back({where, camera.name + ": the principal point lies outside of the image",
                          "check resolution and intrinsics"});
  }
  if (const auto made = make_camera(c); !made)
    file.notes.push_back({where, camera.name + ": " + made.error().where + " " + made.error().what,
                          "it can be shown, but not tracked with: " + made.error().fix});
}

void look_at_placement(const CalibratedCamera& camera, CalibrationFile& file) {
  if (camera.T_cam_imu && camera.T_cam_imu->p.norm() > kFarFromImu_m)
    file.notes.push_back({file.path,
                          text(camera.name, ": the camera is ",
                               1e-2 * std::round(1e2 * camera.T_cam_imu->p.norm()), " m away from the IMU"),
                          "check the unit (metres) if the rig is smaller"});
  if (std::abs(camera.timeshift_cam_imu_s) > kLongShift_s)
    file.notes.push_back({file.path,
                          text(camera.name, ": the clocks are ", camera.timeshift_cam_imu_s, " s apart"),
                          "check the unit (seconds)"});
}

/// What each camera's pose against the first one follows from.
void relate_to_first(CalibrationFile& file) {
  if (file.cameras.empty()) return;
  for (CalibratedCamera& camera : file.cameras) {
    const auto& first = file.cameras.front();
    if (!camera.T_cam_cam0 && camera.T_cam_imu && first.T_cam_imu)
      camera.T_cam_cam0 = *camera.T_cam_imu * first.T_cam_imu->inverse();
  }
}

}  // namespace

Expected<CalibrationFile> read_calibration(const std::string& path) {
  const auto document = YamlDocument::read(path);
  if (!document) return document.error();
  const Reader reader = reader_for(document->root);
  const bool transforms_only = reader == nullptr && any_key(document->root, "T_");
  if (reader == nullptr && !transforms_only)
    return Error{path, "is no calibration of a known kind",
                 "give one of Kalibr, Basalt, ROS camera_info, OpenCV, DSEC, ncamera or EuRoC"};
  CalibrationFile out;
  if (transforms_only) {
    out.kind = "transforms";
  } else {
    auto read = reader(*document);
    if (!read) return read.error();
    out = *std::move(read);
  }
  out.path = path;
  if (auto status = take_transforms(*document, out); !status) return status.error();
  relate_to_first(out);
  for (const CalibratedCamera& camera : out.cameras) {
    if (camera.intrinsics) look_at_intrinsics(camera, out);
    look_at_placement(camera, out);
  }
  return out;
}

Expected<CalibratedCamera> choose_camera(const CalibrationFile& file, int index) {
  const auto& cameras = file.cameras;
  if (index >= static_cast<int>(cameras.size()) || cameras.empty())
    return Error{file.path,
                 text("no entry 'cam", std::max(index, 0), "' in a file with ", cameras.size(), " cameras"),
                 "give the camera's calibration, or another number by events.camera in recording.yaml"};
  std::size_t chosen = static_cast<std::size_t>(std::max(index, 0));
  if (index < 0)
    for (std::size_t i = cameras.size(); i-- > 0;)
      if (cameras[i].sees == "event") chosen = i;
  const CalibratedCamera& camera = cameras[chosen];
  if (!camera.intrinsics)
    return Error{file.path, camera.name + ": no intrinsics, only its place",
                 "give the file with focal lengths and distortion"};
  if (const auto made = make_camera(*camera.intrinsics); !made) {
    const bool model = made.error().where == "distortion_model";
    return Error{text(file.path, ":", model ? camera.model_line : camera.numbers_line),
                 camera.name + ": " + made.error().where + " " + made.error().what, made.error().fix};
  }
  return camera;
}

}  // namespace evpose
