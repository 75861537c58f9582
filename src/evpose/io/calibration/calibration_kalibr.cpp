// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "evpose/io/calibration/calibration_kinds.h"

namespace evpose {
namespace {

constexpr double kLongestShift_s = 1e6, kDegree = M_PI / 180;
constexpr double kLongestGap_s = 10;
constexpr double kLargestFault = 0.5;  // of an element of an IMU's axes

/// Kalibr's camera models: how many of their numbers stand before fu, fv, pu, pv.
std::size_t leading_numbers(const std::string& model) {
  return model == "ds" || model == "eucm" ? 2 : model == "omni" ? 1 : 0;
}

/// One name for projection and distortion: pinhole's is the distortion's.
std::string model_name(const std::string& camera, const std::string& distortion) {
  if (camera == "pinhole") return distortion;
  return distortion == "none" ? camera : camera + "-" + distortion;
}

Status read_model(const YamlDocument& document, const YamlNode& node, CalibratedCamera& out) {
  const auto model = required(document, node, "camera_model");
  if (!model) return model.error();
  const auto projection = document.string(**model, "camera_model");
  if (!projection) return projection.error();
  if (*projection != "pinhole" && leading_numbers(*projection) == 0)
    return document.error(**model, "camera_model '" + *projection + "' is not known",
                          "Kalibr has pinhole, omni, eucm and ds");
  const auto distortion = required(document, node, "distortion_model");
  if (!distortion) return distortion.error();
  const auto distortion_word = document.string(**distortion, "distortion_model");
  if (!distortion_word) return distortion_word.error();
  out.model_line = *projection == "pinhole" ? (*distortion)->line : (*model)->line;

  // DSEC's rectified style writes the numbers as camera_matrix.
  const char* key = node.find("intrinsics") == nullptr && node.find("camera_matrix") != nullptr
                        ? "camera_matrix"
                        : "intrinsics";
  const std::size_t lead = leading_numbers(*projection);
  const auto numbers = required_numbers(document, node, key, 4 + lead);
  if (!numbers) return numbers.error();
  out.numbers_line = node.find(key)->line;
  CameraIntrinsics c;
  c.fx = (*numbers)[lead], c.fy = (*numbers)[lead + 1];
  c.cx = (*numbers)[lead + 2], c.cy = (*numbers)[lead + 3];
  std::vector<double> others(numbers->begin(), numbers->begin() + static_cast<std::ptrdiff_t>(lead));
  const YamlNode* coefficients = node.find("distortion_coeffs");
  const std::string name = distortion_name(*distortion_word);
  if (coefficients != nullptr) {
    const auto values = document.numbers(*coefficients, "distortion_coeffs");
    if (!values) return values.error();
    others.insert(others.end(), values->begin(), values->end());
  } else if (name != "none") {
    return required(document, node, "distortion_coeffs").error();
  }
  const YamlNode& blamed = coefficients != nullptr ? *coefficients : **distortion;
  if (auto status = set_distortion(document, blamed, model_name(*projection, name), others, c); !status)
    return status;

  const auto size = required_numbers(document, node, "resolution", 2);
  if (!size) return size.error();
  const auto pixels = image_size(document, *node.find("resolution"), (*size)[0], (*size)[1]);
  if (!pixels) return pixels.error();
  c.size = *pixels;
  out.intrinsics = c;
  return {};
}

Status read_shift(const YamlDocument& document, const YamlNode& node, CalibratedCamera& out) {
  const YamlNode* shift = node.find("timeshift_cam_imu");
  if (shift == nullptr) return {};
  const auto value = document.number(*shift, "timeshift_cam_imu");
  if (!value) return value.error();
  if (std::abs(*value) > kLongestShift_s)
    return document.error(*shift, text("timeshift_cam_imu: ", *value, " s is out of range"), "give seconds");
  out.has_timeshift = true;
  out.timeshift_cam_imu_s = *value;
  return {};
}

/// Numbers that are standard deviations; none if the key is not there.
Expected<std::vector<double>> read_sigmas(const YamlDocument& document, const YamlNode& node, const char* key,
                                          std::initializer_list<std::size_t> counts) {
  const YamlNode* at = node.find(key);
  if (at == nullptr) return std::vector<double>{};
  auto values = document.numbers(*at, key);
  if (!values) return values.error();
  if (std::find(counts.begin(), counts.end(), values->size()) == counts.end())
    return document.error(*at, text(key, ": ", values->size(), " numbers instead of ", *counts.begin()),
                          "give one for each number, or leave the key out");
  for (const double value : *values)
    if (!(value >= 0) || !std::isfinite(value))
      return document.error(*at, text(key, ": ", value, " is no standard deviation"),
                            "give numbers from 0 on; 0 means known");
  return values;
}

/// Of all numbers with the placement and the time, or of the camera's alone.
Status read_correlation(const YamlDocument& document, const YamlNode& node, CalibratedCamera& out) {
  const YamlNode* at = node.find("calibration_correlation");
  if (at == nullptr) return {};
  const auto values = document.numbers(*at, "calibration_correlation");
  if (!values) return values.error();
  const std::size_t camera = 4 + out.intrinsics->distortion.size(), all = camera + 7;
  const std::size_t n = values->size() == camera * camera ? camera : all;
  if (values->size() != n * n)
    return document.error(*at,
                          text("calibration_correlation: ", values->size(), " numbers instead of ",
                               camera * camera, " or ", all * all),
                          "give a row for each sigma, or leave the key out");
  const auto size = static_cast<Eigen::Index>(n);
  const Eigen::MatrixXd R = Eigen::Map<const Eigen::MatrixXd>(values->data(), size, size);
  constexpr double kRounding = 1e-6;
  if (!((R.diagonal().array() - 1).abs().maxCoeff() < kRounding) ||
      !((R - R.transpose()).cwiseAbs().maxCoeff() < kRounding) ||
      !(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(R).eigenvalues()(0) > -kRounding))
    return document.error(*at, "calibration_correlation: is no correlation matrix",
                          "give a symmetric, positive one with 1 on its diagonal, or leave the key out");
  out.sigma.correlation = R;
  return {};
}

/// Keys of our own, beside Kalibr's.
Status read_stated_sigma(const YamlDocument& document, const YamlNode& node, CalibratedCamera& out) {
  const auto intrinsics = read_sigmas(document, node, "intrinsics_sigma", {4});
  if (!intrinsics) return intrinsics.error();
  if (!intrinsics->empty()) out.sigma.intrinsics = *intrinsics;
  const std::size_t terms = out.intrinsics->distortion.size();
  const auto distortion = read_sigmas(document, node, "distortion_sigma", {terms});
  if (!distortion) return distortion.error();
  if (!distortion->empty()) out.sigma.distortion = *distortion;
  // Rotation in degrees, then translation in metres: one number each, or one for each axis.
  const auto placement = read_sigmas(document, node, "T_cam_imu_sigma", {2, 6});
  if (!placement) return placement.error();
  if (!placement->empty()) {
    const auto axes = [&](std::size_t part) -> Eigen::Vector3d {
      const std::vector<double>& v = *placement;
      if (v.size() == 2) return Eigen::Vector3d::Constant(v[part]);
      return {v[3 * part], v[3 * part + 1], v[3 * part + 2]};
    };
    out.sigma.rotation_rad = kDegree * axes(0);
    out.sigma.translation_m = axes(1);
  }
  if (const YamlNode* shift = node.find("timeshift_sigma")) {
    const auto time = document.number(*shift, "timeshift_sigma");
    if (!time) return time.error();
    if (!(*time >= 0) || !std::isfinite(*time))
      return document.error(*shift, text("timeshift_sigma: ", *time, " is no standard deviation"),
                            "give seconds from 0 on; 0 means known");
    out.sigma.time_s = *time;
  }
  return read_correlation(document, node, out);
}

/// What the sensor drops of the events, likewise.
Status read_trail_filter(const YamlDocument& document, const YamlNode& node, CalibratedCamera& out) {
  const YamlNode* kind = node.find("trail_filter");
  if (kind == nullptr) return {};
  const auto word = document.string(*kind, "trail_filter");
  if (!word) return word.error();
  const auto known = std::find_if(kTrailFilters.begin(), kTrailFilters.end(),
                                  [&](const auto& filter) { return filter.first == *word; });
  if (known == kTrailFilters.end())
    return document.error(*kind, "trail_filter '" + *word + "' is not known",
                          "give none, first, second or all_but_first");
  out.trail_filter.kind = known->second;
  if (known->second == TrailFilterKind::none) return {};
  const auto gap = required_number(document, node, "trail_filter_gap");
  if (!gap) return gap.error();
  if (!(*gap > 0 && *gap <= kLongestGap_s))
    return document.error(*node.find("trail_filter_gap"),
                          text("trail_filter_gap: ", *gap, " s is out of range"),
                          text("give seconds, above 0 and up to ", kLongestGap_s));
  out.trail_filter.longest_gap_s = *gap;
  return {};
}

/// Where a camera sits, by its own entries or through the camera before it.
Status read_placement(const YamlDocument& document, const YamlNode& node, const CalibratedCamera* before,
                      CalibratedCamera& out) {
  auto direct = optional_transform(document, node, "T_cam_imu");
  if (!direct) return direct.error();
  out.T_cam_imu = *direct;
  // OpenVINS also knows the inverse, by its name.
  const auto inverse = optional_transform(document, node, "T_imu_cam");
  if (!inverse) return inverse.error();
  if (!out.T_cam_imu && *inverse) out.T_cam_imu = (*inverse)->inverse();
  const auto step = optional_transform(document, node, "T_cn_cnm1");
  if (!step) return step.error();
  if (!*step || before == nullptr) return {};
  if (!out.T_cam_imu && before->T_cam_imu) out.T_cam_imu = **step * *before->T_cam_imu;
  if (before->T_cam_cam0) out.T_cam_cam0 = **step * *before->T_cam_cam0;
  return {};
}

Expected<Eigen::Matrix3d> read_matrix(const YamlDocument& document, const YamlNode& node, const char* key) {
  const auto values = required_numbers(document, node, key, 9);
  if (!values) return values.error();
  return Eigen::Matrix3d(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(values->data()));
}

/// Scale and misalignment of one sensor, near to none.
Status read_axes_matrix(const YamlDocument& document, const YamlNode& sensor, Eigen::Matrix3d* M,
                        Eigen::Matrix3d* sigma) {
  const auto read = read_matrix(document, sensor, "M");
  if (!read) return read.error();
  if (!((*read - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < kLargestFault))
    return document.error(*sensor.find("M"), "M: is no matrix near the identity",
                          "give the one that Kalibr found");
  *M = *read;
  const auto stated = read_sigmas(document, sensor, "M_sigma", {9});
  if (!stated) return stated.error();
  if (!stated->empty()) *sigma = *read_matrix(document, sensor, "M_sigma");
  return {};
}

/// Of Kalibr's models calibrated (ideal axes) and scale-misalignment.
Expected<ImuAxes> kalibr_axes(const YamlDocument& document, const YamlNode& imu) {
  ImuAxes axes;
  const YamlNode* model = imu.find("model");
  if (model == nullptr || !model->scalar.starts_with("scale-misalignment")) return axes;
  if (model->scalar != "scale-misalignment")
    return document.error(*model, "model '" + model->scalar + "' is not supported",
                          "calibrate with model calibrated or scale-misalignment");
  const auto accel = required(document, imu, "accelerometers"), gyro = required(document, imu, "gyroscopes");
  if (!accel) return accel.error();
  if (!gyro) return gyro.error();
  if (auto ok = read_axes_matrix(document, **accel, &axes.accel, &axes.accel_sigma); !ok) return ok.error();
  if (auto ok = read_axes_matrix(document, **gyro, &axes.gyro, &axes.gyro_sigma); !ok) return ok.error();
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  if (const YamlNode* at = (*gyro)->find("C_gyro_i")) {
    const auto read = read_matrix(document, **gyro, "C_gyro_i");
    if (!read) return read.error();
    constexpr double kRounding = 1e-3;
    if (!((*read * read->transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < kRounding) ||
        read->determinant() < 0)
      return document.error(*at, "C_gyro_i: is no rotation", "give the one that Kalibr found");
    turn = *read;
  }
  axes.gyro = axes.gyro * turn;
  if ((*gyro)->find("A") == nullptr) return axes;
  const auto by_force = read_matrix(document, **gyro, "A");
  if (!by_force) return by_force.error();
  axes.gyro_by_force = *by_force * turn;
  return axes;
}

}  // namespace

Expected<ImuNoise> kalibr_noise(const YamlDocument& document, const YamlNode& imu) {
  ImuNoise noise;
  const std::pair<const char*, double*> values[] = {{"accelerometer_noise_density", &noise.accel_density},
                                                    {"accelerometer_random_walk", &noise.accel_walk},
                                                    {"gyroscope_noise_density", &noise.gyro_density},
                                                    {"gyroscope_random_walk", &noise.gyro_walk},
                                                    {"update_rate", &noise.rate_hz}};
  for (const auto& [key, target] : values) {
    const auto value = required_number(document, imu, key);
    if (!value) return value.error();
    if (*value <= 0)
      return document.error(*imu.find(key), text(key, ": ", *value, " is not positive"),
                            "give Kalibr's value");
    *target = *value;
  }
  const auto axes = kalibr_axes(document, imu);
  if (!axes) return axes.error();
  noise.axes = *axes;
  return noise;
}

Expected<CalibrationFile> read_kalibr_imu_file(const YamlDocument& document) {
  const YamlNode* nested = document.root.find("imu0");
  const auto noise = kalibr_noise(document, nested != nullptr ? *nested : document.root);
  if (!noise) return noise.error();
  CalibrationFile out;
  out.kind = "Kalibr IMU";
  out.imu_noise = *noise;
  return out;
}

Expected<CalibrationFile> read_kalibr_chain(const YamlDocument& document) {
  CalibrationFile out;
  for (int i = 0;; ++i) {
    const std::string name = text("cam", i);
    const YamlNode* node = document.root.find(name);
    if (node == nullptr) break;
    CalibratedCamera camera;
    camera.name = name;
    if (auto status = read_model(document, *node, camera); !status) return status.error();
    if (auto status = read_shift(document, *node, camera); !status) return status.error();
    if (auto status = read_stated_sigma(document, *node, camera); !status) return status.error();
    if (auto status = read_trail_filter(document, *node, camera); !status) return status.error();
    if (i == 0) camera.T_cam_cam0 = Pose{};
    const CalibratedCamera* before = i == 0 ? nullptr : &out.cameras.back();
    if (auto status = read_placement(document, *node, before, camera); !status) return status.error();
    out.cameras.push_back(std::move(camera));
  }
  if (out.cameras.empty())
    return Error{document.path, "no entry 'cam0'", "give Kalibr's camchain, numbered from cam0"};
  const bool with_imu = out.cameras.front().T_cam_imu.has_value();
  out.kind = with_imu ? "Kalibr camera chain with IMU" : "Kalibr camera chain";
  if (const YamlNode* imu = document.root.find("imu0")) {
    const auto noise = kalibr_noise(document, *imu);
    if (!noise) return noise.error();
    out.imu_noise = *noise;
  }
  return out;
}

Expected<CalibrationFile> read_dsec(const YamlDocument& document) {
  const YamlNode& intrinsics = *document.root.find("intrinsics");
  const YamlNode& extrinsics = *document.root.find("extrinsics");
  CalibrationFile out;
  out.kind = "DSEC cameras";
  for (int i = 0;; ++i) {
    const YamlNode* node = intrinsics.find(text("cam", i));
    if (node == nullptr) break;
    CalibratedCamera camera;
    camera.name = text("cam", i);
    if (auto status = read_model(document, *node, camera); !status) return status.error();
    if (const YamlNode* type = node->find("camera_type")) camera.sees = type->scalar;
    if (i == 0) {
      camera.T_cam_cam0 = Pose{};
    } else {
      const std::string key = text("T_", i, i - 1);  // cam(i - 1) to cam i
      const auto step = required(document, extrinsics, key);
      if (!step) return step.error();
      const auto T = document.transform(**step, key);
      if (!T) return T.error();
      camera.T_cam_cam0 = *T * *out.cameras.back().T_cam_cam0;
    }
    out.cameras.push_back(std::move(camera));
  }
  if (out.cameras.empty())
    return document.error(intrinsics, "no entry 'cam0'", "give DSEC's cam_to_cam.yaml");
  return out;
}

}  // namespace evpose
