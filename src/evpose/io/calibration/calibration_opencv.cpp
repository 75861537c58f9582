// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>

#include "evpose/io/calibration/calibration_kinds.h"
#include "evpose/io/files/numbers.h"

namespace evpose {
namespace {

/// Members of `node` by name, those from the first optional one on only if they are there.
Expected<std::vector<double>> named_numbers(const YamlDocument& document, const YamlNode& node,
                                            const std::vector<const char*>& names) {
  std::vector<double> out;
  for (const char* name : names) {
    const auto value = required_number(document, node, name);
    if (!value) return value.error();
    out.push_back(*value);
  }
  return out;
}

/// Rotation and translation that stand apart.
Expected<std::optional<Pose>> split_transform(const YamlDocument& document, const std::string& rotation,
                                              const std::string& translation) {
  const YamlNode *r = document.root.find(rotation), *t = document.root.find(translation);
  if (r == nullptr && t == nullptr) return std::optional<Pose>();
  const auto R = required_numbers(document, document.root, rotation, 9);
  if (!R) return R.error();
  const auto p = required_numbers(document, document.root, translation, 3);
  if (!p) return p.error();
  const auto pose =
      document.rigid(*r, rotation, Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(R->data()),
                     {(*p)[0], (*p)[1], (*p)[2]});
  if (!pose) return pose.error();
  return std::optional<Pose>(*pose);
}

bool is_set(const YamlNode& root, const std::string& key) {
  const YamlNode* node = root.find(key);
  return node != nullptr && (node->scalar == "1" || node->scalar == "true");
}

/// Intrinsics of a camera from the file that a VINS file names; nothing if it is not there.
Status take_named_file(const YamlDocument& document, const std::string& key, CalibratedCamera& camera,
                       std::vector<Error>& notes) {
  const YamlNode* name = document.root.find(key);
  if (name == nullptr || name->scalar.empty()) return {};
  const std::filesystem::path file(name->scalar);
  const auto path = file.is_absolute() ? file : std::filesystem::path(document.path).parent_path() / file;
  if (std::error_code ignored; !std::filesystem::is_regular_file(path, ignored)) {
    notes.push_back(document.error(*name, camera.name + ": no intrinsics, " + name->scalar + " is not there",
                                   "put it beside this file"));
    return {};
  }
  const auto other = YamlDocument::read(path.string());
  if (!other) return other.error();
  if (other->root.find("model_type") == nullptr) return {};  // never this file itself again
  const auto read = read_opencv_pinhole(*other);
  if (!read) return read.error();
  camera.intrinsics = read->cameras.front().intrinsics;
  return {};
}

/// The keys of one camera in a VINS file and its relatives.
struct VinsCamera {
  const char *name, *sees;
  const char *rotation, *translation, *matrix;
  const char* inverse_flag;  ///< set where rotation and translation are IMU to camera
  std::vector<const char*> files;
};

Expected<std::optional<CalibratedCamera>> vins_camera(const YamlDocument& document, const VinsCamera& keys,
                                                      std::vector<Error>& notes) {
  auto split = split_transform(document, keys.rotation, keys.translation);
  if (!split) return split.error();
  const auto whole = optional_transform(document, document.root, keys.matrix);
  if (!whole) return whole.error();
  if (!*split && !*whole) return std::optional<CalibratedCamera>();
  CalibratedCamera camera;
  camera.name = keys.name;
  camera.sees = keys.sees;
  // Camera to IMU, unless the file's own flag says the opposite.
  if (*split)
    camera.T_cam_imu = is_set(document.root, keys.inverse_flag) ? **split : (*split)->inverse();
  else
    camera.T_cam_imu = (*whole)->inverse();
  if (const YamlNode* td = document.root.find("td")) {
    const auto value = document.number(*td, "td");  // t_imu = t_cam + td, as Kalibr
    if (!value) return value.error();
    camera.has_timeshift = true;
    camera.timeshift_cam_imu_s = *value;
  }
  for (const char* file : keys.files)
    if (auto status = take_named_file(document, file, camera, notes); !status) return status.error();
  return std::optional<CalibratedCamera>(std::move(camera));
}

}  // namespace

Expected<CalibrationFile> read_opencv_pinhole(const YamlDocument& document) {
  const YamlNode& root = document.root;
  CalibrationFile out;
  out.kind = "OpenCV camera";
  CalibratedCamera camera;
  camera.name = "cam0";
  if (const YamlNode* name = root.find("camera_name"); name != nullptr && !name->scalar.empty())
    camera.name = name->scalar;
  const auto type = required(document, root, "model_type");
  if (!type) return type.error();
  camera.model_line = (*type)->line;
  const auto projection = required(document, root, "projection_parameters");
  if (!projection) return projection.error();
  camera.numbers_line = (*projection)->line;
  CameraIntrinsics c;
  const bool kannala = (*type)->scalar == "KANNALA_BRANDT";
  const bool pinhole = (*type)->scalar == "PINHOLE";
  if (!kannala && !pinhole)
    return document.error(**type, "model_type '" + (*type)->scalar + "' is not supported",
                          "calibrate with PINHOLE or KANNALA_BRANDT");
  const auto numbers = named_numbers(document, **projection,
                                     kannala ? std::vector<const char*>{"mu", "mv", "u0", "v0"}
                                             : std::vector<const char*>{"fx", "fy", "cx", "cy"});
  if (!numbers) return numbers.error();
  c.fx = (*numbers)[0], c.fy = (*numbers)[1], c.cx = (*numbers)[2], c.cy = (*numbers)[3];
  const YamlNode* from = *projection;
  if (pinhole) {
    const auto distortion = required(document, root, "distortion_parameters");
    if (!distortion) return distortion.error();
    from = *distortion;
  }
  const auto coefficients = named_numbers(document, *from,
                                          kannala ? std::vector<const char*>{"k2", "k3", "k4", "k5"}
                                                  : std::vector<const char*>{"k1", "k2", "p1", "p2"});
  if (!coefficients) return coefficients.error();
  if (auto status = set_distortion(document, *from, kannala ? "equidistant" : "radtan", *coefficients, c);
      !status)
    return status.error();
  const auto size = image_size_of(document, root, "image_width", "image_height");
  if (!size) return size.error();
  c.size = *size;
  camera.intrinsics = std::move(c);
  out.cameras.push_back(std::move(camera));
  return out;
}

Expected<CalibrationFile> read_canny_evt(const YamlDocument& document) {
  const YamlNode& root = document.root;
  CalibrationFile out;
  out.kind = "Canny-EVT settings";
  CalibratedCamera camera;
  camera.name = "cam0";
  camera.sees = "event";
  const auto K = required_numbers(document, root, "K", 9);
  if (!K) return K.error();
  camera.numbers_line = root.find("K")->line;
  CameraIntrinsics c;
  c.fx = (*K)[0], c.cx = (*K)[2], c.fy = (*K)[4], c.cy = (*K)[5];
  std::string model = "plumb_bob";
  if (const YamlNode* named = root.find("model")) {
    model = named->scalar;
    camera.model_line = named->line;
  }
  const auto D = required_numbers(document, root, "distortion");
  if (!D) return D.error();
  if (auto status = set_distortion(document, *root.find("distortion"), distortion_name(model), *D, c);
      !status)
    return status.error();
  const auto size = image_size_of(document, root, "width", "height");
  if (!size) return size.error();
  c.size = *size;
  camera.intrinsics = std::move(c);
  const auto T_imu_cam = split_transform(document, "Rbc", "tbc");
  if (!T_imu_cam) return T_imu_cam.error();
  if (*T_imu_cam) camera.T_cam_imu = (*T_imu_cam)->inverse();
  out.cameras.push_back(std::move(camera));
  return out;
}

Expected<CalibrationFile> read_vins(const YamlDocument& document) {
  const YamlNode& root = document.root;
  CalibrationFile out;
  out.kind = "VINS settings";
  const VinsCamera cameras[] = {{"event",
                                 "event",
                                 "extrinsicRotation_event",
                                 "extrinsicTranslation_event",
                                 "body_T_event0",
                                 "T_event_imu",
                                 {"event_left_calib"}},
                                {"event right", "event", "", "", "body_T_event1", "", {"event_right_calib"}},
                                {"cam0",
                                 "",
                                 "extrinsicRotation",
                                 "extrinsicTranslation",
                                 "body_T_cam0",
                                 "T_camera_imu",
                                 {"cam0_calib", "cam_left_calib"}},
                                {"cam1", "", "", "", "body_T_cam1", "", {"cam1_calib", "cam_right_calib"}}};
  for (const VinsCamera& keys : cameras) {
    auto camera = vins_camera(document, keys, out.notes);
    if (!camera) return camera.error();
    if (*camera) out.cameras.push_back(**std::move(camera));
  }
  if (root.find("acc_n") != nullptr)
    out.notes.push_back(document.error(*root.find("acc_n"),
                                       "the IMU's noise is tuned for one estimator, no density",
                                       "give imu.yaml with the sensor's noise densities"));
  return out;
}

Expected<CalibrationFile> read_orb_slam(const YamlDocument& document) {
  const YamlNode& root = document.root;
  CalibrationFile out;
  out.kind = "ORB-SLAM3 settings";
  // Version 1.0 of its files numbers the cameras.
  const std::string word = root.find("Camera1.fx") != nullptr ? "Camera1." : "Camera.";
  CalibratedCamera camera;
  camera.name = "cam0";
  CameraIntrinsics c;
  const std::pair<const char*, double*> numbers[] = {
      {"fx", &c.fx}, {"fy", &c.fy}, {"cx", &c.cx}, {"cy", &c.cy}};
  for (const auto& [key, target] : numbers) {
    const auto value = required_number(document, root, word + key);
    if (!value) return value.error();
    *target = *value;
  }
  camera.numbers_line = root.find(word + "fx")->line;
  const YamlNode* type = root.find("Camera.type");
  if (type != nullptr) camera.model_line = type->line;
  const std::string model = type == nullptr ? "radtan" : distortion_name(type->scalar);
  std::vector<double> distortion;
  const std::vector<const char*> names = model == "equidistant"
                                             ? std::vector<const char*>{"k1", "k2", "k3", "k4"}
                                             : std::vector<const char*>{"k1", "k2", "p1", "p2", "k3"};
  for (const char* name : names) {
    if (root.find(word + name) == nullptr) {
      distortion.push_back(0);
      continue;
    }
    const auto value = required_number(document, root, word + name);
    if (!value) return value.error();
    distortion.push_back(*value);
  }
  if (auto status = set_distortion(document, *root.find(word + "fx"), model, distortion, c); !status)
    return status.error();
  const auto size = image_size_of(document, root, "Camera.width", "Camera.height");
  if (!size) return size.error();
  c.size = *size;
  camera.intrinsics = std::move(c);
  for (const char* key : {"IMU.T_b_c1", "Tbc"}) {  // camera to body
    const auto T_b_c = optional_transform(document, root, key);
    if (!T_b_c) return T_b_c.error();
    if (*T_b_c) camera.T_cam_imu = (*T_b_c)->inverse();
  }
  out.cameras.push_back(std::move(camera));
  return out;
}

Expected<CalibrationFile> read_calib_txt(const YamlDocument& document) {
  std::vector<std::string_view> fields;
  split_fields(trimmed(document.root.scalar), fields);
  std::vector<double> v;
  for (const std::string_view field : fields) {
    double value = 0;
    if (!parse_number(field, value))
      return Error{document.path, "is no calibration of a known kind",
                   "give one of Kalibr, Basalt, ROS camera_info, OpenCV, DSEC, ncamera or EuRoC"};
    v.push_back(value);
  }
  if (v.size() != 4 && v.size() != 8 && v.size() != 9)
    return Error{document.path, text(v.size(), " numbers"), "calib.txt holds fx fy cx cy k1 k2 p1 p2 k3"};
  CalibrationFile out;
  out.kind = "calib.txt";
  CalibratedCamera camera;
  camera.name = "cam0";
  CameraIntrinsics c;
  c.fx = v[0], c.fy = v[1], c.cx = v[2], c.cy = v[3];
  v.erase(v.begin(), v.begin() + 4);
  if (auto status = set_distortion(document, document.root, v.empty() ? "none" : "radtan", v, c); !status)
    return status.error();
  camera.intrinsics = std::move(c);
  out.cameras.push_back(std::move(camera));
  out.notes.push_back({document.path, "calib.txt does not say the image's size",
                       "it is taken from the events; else write a ROS camera_info file"});
  return out;
}

}  // namespace evpose
