// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/io/calibration/calibration.h"
#include "evpose/io/files/yaml_document.h"

namespace evpose {

// One reader for each kind of file that read_calibration() tells apart by its keys; `path` and checks that
// all kinds share are added there.
Expected<CalibrationFile> read_kalibr_chain(const YamlDocument& document);
Expected<CalibrationFile> read_kalibr_imu_file(const YamlDocument& document);
Expected<CalibrationFile> read_basalt(const YamlDocument& document);
Expected<CalibrationFile> read_camera_info(const YamlDocument& document);
Expected<CalibrationFile> read_ncamera(const YamlDocument& document);
Expected<CalibrationFile> read_opencv_pinhole(const YamlDocument& document);  ///< model_type, ..._parameters
Expected<CalibrationFile> read_canny_evt(const YamlDocument& document);       ///< K, distortion, Rbc, tbc
Expected<CalibrationFile> read_vins(const YamlDocument& document);
Expected<CalibrationFile> read_orb_slam(const YamlDocument& document);
Expected<CalibrationFile> read_dsec(const YamlDocument& document);
Expected<CalibrationFile> read_vector_extrinsics(const YamlDocument& document);
Expected<CalibrationFile> read_euroc_sensor(const YamlDocument& document);
Expected<CalibrationFile> read_raw_camera(
    const YamlDocument& document);                                       ///< raw: {model, ...}, width, height
Expected<CalibrationFile> read_calib_txt(const YamlDocument& document);  ///< fx fy cx cy k1 k2 p1 p2 [k3]

// What they share.

Expected<const YamlNode*> required(const YamlDocument& document, const YamlNode& parent,
                                   const std::string& key);
Expected<double> required_number(const YamlDocument& document, const YamlNode& parent,
                                 const std::string& key);
/// `count` numbers of a key that must be there; any count if 0.
Expected<std::vector<double>> required_numbers(const YamlDocument& document, const YamlNode& parent,
                                               const std::string& key, std::size_t count = 0);
/// The transform of a key, or nothing if the key is absent.
Expected<std::optional<Pose>> optional_transform(const YamlDocument& document, const YamlNode& parent,
                                                 const std::string& key);
Expected<ImageSize> image_size(const YamlDocument& document, const YamlNode& node, double width,
                               double height);
/// From two members of `parent`, such as image_width and image_height.
Expected<ImageSize> image_size_of(const YamlDocument& document, const YamlNode& parent,
                                  const std::string& width, const std::string& height);
/// Models by the names that tools give them, in ours: plumb_bob is radtan, fisheye is equidistant.
std::string distortion_name(const std::string& theirs);
/// Numbers of a distortion, with zeros at the end that the model does not have left out; the right count for
/// a model that is ours.
Status set_distortion(const YamlDocument& document, const YamlNode& node, const std::string& model,
                      std::vector<double> numbers, CameraIntrinsics& out);
/// Kalibr's noise densities among the members of `imu`.
Expected<ImuNoise> kalibr_noise(const YamlDocument& document, const YamlNode& imu);

}  // namespace evpose
