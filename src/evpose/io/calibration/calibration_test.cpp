// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/calibration/calibration.h"

#include <gtest/gtest.h>

#include "evpose/io/calibration/kalibr.h"
#include "evpose/io/files/test_files.h"

namespace evpose {
namespace {

// One rig, told in the words of each tool: the camera looks along the IMU's x axis, 0.1 m ahead of the IMU
// and 0.02 m above it (z up). p_cam = R p_imu + t with R's rows the camera's right, down and forward.
const char* const kT_cam_imu = "[0,-1,0,0, 0,0,-1,0.02, 1,0,0,-0.1, 0,0,0,1]";
const char* const kT_imu_cam = "[0,0,1,0.1, -1,0,0,0, 0,-1,0,0.02, 0,0,0,1]";
const char* const kR_imu_cam = "[0,0,1, -1,0,0, 0,-1,0]";
const char* const kR_cam_imu = "[0,-1,0, 0,0,-1, 1,0,0]";
const std::string kKalibr =
    "cam0:\n  camera_model: pinhole\n  distortion_model: radtan\n  distortion_coeffs: [0.1, 0.02, 0, 0]\n"
    "  intrinsics: [100, 101, 50, 40]\n  resolution: [102, 82]\n";

/// What every way of telling the rig must come to.
void expect_rig(const Expected<CalibrationFile>& file, std::size_t index = 0) {
  ASSERT_TRUE(file.ok()) << error_line(file);
  ASSERT_GT(file->cameras.size(), index);
  ASSERT_TRUE(file->cameras[index].T_cam_imu.has_value());
  const Pose T_imu_cam = file->cameras[index].T_cam_imu->inverse();
  EXPECT_LT((T_imu_cam.p - Eigen::Vector3d(0.1, 0, 0.02)).norm(), 1e-12) << file->kind;
  EXPECT_LT((T_imu_cam.q * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitX()).norm(), 1e-12) << file->kind;
}

std::string opencv(const std::string& name, int rows, int cols, const std::string& data) {
  return text(name, ": !!opencv-matrix\n   rows: ", rows, "\n   cols: ", cols, "\n   dt: d\n   data: ", data,
              "\n");
}

class Rig : public ::testing::Test {
 protected:
  Expected<CalibrationFile> read(const std::string& content, const std::string& name = "c.yaml") const {
    return read_calibration(folder.file(name, content));
  }
  TemporaryFolder folder;
};

TEST_F(Rig, KalibrStoresImuToCamera) {
  expect_rig(read(kKalibr + "  T_cam_imu: " + kT_cam_imu + "\n"));
  expect_rig(read("%YAML:1.0\n---\n" + kKalibr + "  T_cam_imu: " + kT_cam_imu + "\n"));
}

TEST_F(Rig, OpenvinsNamesTheDirection) { expect_rig(read(kKalibr + "  T_imu_cam: " + kT_imu_cam + "\n")); }

TEST_F(Rig, KalibrChainsFromThePreviousCamera) {
  // The first camera sits 0.05 m to the left of ours: in ours, at x = -0.05.
  std::string second = kKalibr;
  second.replace(0, 4, "cam1");
  expect_rig(read(kKalibr + "  T_cam_imu: [0,-1,0,0.05, 0,0,-1,0.02, 1,0,0,-0.1, 0,0,0,1]\n" + second +
                  "  T_cn_cnm1: [1,0,0,-0.05, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n"),
             1);
}

TEST_F(Rig, BasaltStoresCameraToImu) {
  // The rotation of kR_imu_cam as a quaternion.
  const std::string basalt = R"({"value0": {"T_imu_cam": [{"px": 0.1, "py": 0, "pz": 0.02,
    "qx": -0.5, "qy": 0.5, "qz": -0.5, "qw": 0.5}], "intrinsics": [{"camera_type": "pinhole",
    "intrinsics": {"fx": 100, "fy": 101, "cx": 50, "cy": 40}}], "resolution": [[102, 82]],
    "cam_time_offset_ns": 3000000}})";
  const auto file = read(basalt, "c.json");
  expect_rig(file);
  EXPECT_NEAR(file->cameras[0].timeshift_cam_imu_s, 0.003, 1e-15);
}

TEST_F(Rig, EurocStoresSensorToBody) {
  expect_rig(read(text("sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: ", kT_imu_cam,
                       "\nresolution: [102, 82]\nintrinsics: [100, 101, 50, 40]\n"
                       "distortion_model: radial-tangential\ndistortion_coefficients: [0.1, 0.02, 0, 0]\n")));
}

TEST_F(Rig, VinsStoresCameraToImuUnlessItsFlagSaysOtherwise) {
  const std::string head = "%YAML:1.0\n";
  expect_rig(read(head + opencv("extrinsicRotation", 3, 3, kR_imu_cam) +
                  opencv("extrinsicTranslation", 3, 1, "[0.1, 0, 0.02]") + "td: 0.004\n"));
  EXPECT_EQ(
      read(head + opencv("body_T_cam0", 4, 4, kT_imu_cam) + "td: 0.004\n")->cameras[0].timeshift_cam_imu_s,
      0.004);
  expect_rig(read(head + opencv("body_T_cam0", 4, 4, kT_imu_cam)));
  expect_rig(read(head + opencv("extrinsicRotation", 3, 3, kR_cam_imu) +
                  opencv("extrinsicTranslation", 3, 1, "[0, 0.02, -0.1]") + "T_camera_imu: 1\n"));
}

TEST_F(Rig, CannyEvtStoresCameraToBody) {
  const auto file =
      read("%YAML:1.0\n---\nmodel: plumb_bob\n" + opencv("K", 3, 3, "[100, 0, 50, 0, 101, 40, 0, 0, 1]") +
           opencv("distortion", 5, 1, "[0.1, 0.02, 0, 0, 0]") + opencv("Rbc", 3, 3, kR_imu_cam) +
           opencv("tbc", 3, 1, "[0.1, 0, 0.02]") + "height: 82\nwidth: 102\n");
  expect_rig(file);
  EXPECT_EQ(file->cameras[0].intrinsics->distortion, (std::vector<double>{0.1, 0.02, 0, 0}));
}

TEST_F(Rig, Esvo2StoresCameraToBody) {
  expect_rig(
      read(text("image_width: 102\nimage_height: 82\ncamera_name: left\n"
                "camera_matrix: {rows: 3, cols: 3, data: [100, 0, 50, 0, 101, 40, 0, 0, 1]}\n"
                "distortion_model: plumb_bob\n"
                "distortion_coefficients: {rows: 1, cols: 4, data: [0.1, 0.02, 0, 0]}\n"
                "T_b_c: {rows: 3, cols: 4, data: [0,0,1,0.1, -1,0,0,0, 0,-1,0,0.02]}\n")));
  const auto short_of = read(
      "image_width: 102\nimage_height: 82\n"
      "camera_matrix: {rows: 3, cols: 3, data: [100, 0, 50, 0, 101, 40, 0, 0, 1]}\n"
      "distortion_model: plumb_bob\ndistortion_coefficients: {rows: 1, cols: 4, data: [0.1, 0.02, 0, 0]}\n"
      "T_b_c: {rows: 3, cols: 4, data: [0,0,1, -1,0,0, 0,-1,0]}\n");
  EXPECT_TRUE(says(error_line(short_of), {"c.yaml:6", "T_b_c", "9 numbers"}));
}

TEST_F(Rig, OrbSlamStoresCameraToBody) {
  for (const char* key : {"IMU.T_b_c1", "Tbc"})
    expect_rig(
        read("%YAML:1.0\nCamera.type: \"PinHole\"\nCamera.fx: 100\nCamera.fy: 101\nCamera.cx: 50\n"
             "Camera.cy: 40\nCamera.k1: 0.1\nCamera.k2: 0.02\nCamera.width: 102\nCamera.height: 82\n" +
             opencv(key, 4, 4, kT_imu_cam)));
}

TEST_F(Rig, NcameraStoresCameraToBody) {
  expect_rig(
      read(text("cameras:\n- camera:\n    label: dvs\n    image_height: 82\n    image_width: 102\n"
                "    type: pinhole\n    intrinsics: {cols: 1, rows: 4, data: [100, 101, 50, 40]}\n"
                "    distortion: {type: radial-tangential, parameters: {cols: 1, rows: 4, data: "
                "[0.1, 0.02, 0, 0]}}\n  T_B_C: {cols: 4, rows: 4, data: ",
                kT_imu_cam, "}\n")));
}

TEST_F(Rig, VectorStoresCamerasInTheFirstCamera) {
  // Camera 2 sits 0.17 m to the right of camera 0: the file has its place in camera 0.
  const auto file = read(
      "cam2:\n  T_cam0_cam2: [1,0,0,0.17, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n"
      "cam0:\n  T_cam_body: [1,0,0,0.3, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n");
  ASSERT_TRUE(file.ok()) << error_line(file);
  EXPECT_EQ(file->cameras[0].name, "cam2");
  EXPECT_EQ(file->cameras[0].T_cam_cam0->p.x(), -0.17);
  EXPECT_EQ(file->transforms[0].name, "cam0.T_cam_body");
  EXPECT_TRUE(says(error_line(choose_camera(*file)), {"cam2", "no intrinsics"}));
}

TEST_F(Rig, TimeShiftIsAddedToTheCamerasStamps) {
  EXPECT_EQ(read(kKalibr + "  timeshift_cam_imu: -0.002\n")->cameras[0].timeshift_cam_imu_s, -0.002);
}

TEST_F(Rig, IntrinsicsFromTheFileThatVinsNames) {
  (void)folder.file("event0.yaml",
                    "%YAML:1.0\n---\nmodel_type: PINHOLE\nimage_width: 102\nimage_height: 82\n"
                    "distortion_parameters: {k1: 0.1, k2: 0.02, p1: 0, p2: 0}\n"
                    "projection_parameters: {fx: 100, fy: 101, cx: 50, cy: 40}\n");
  const std::string place =
      opencv("body_T_event0", 4, 4, kT_imu_cam) + opencv("body_T_cam0", 4, 4, kT_imu_cam);
  const auto file = read("%YAML:1.0\nevent_left_calib: \"event0.yaml\"\n" + place);
  expect_rig(file);
  ASSERT_TRUE(file->cameras[0].intrinsics.has_value());
  EXPECT_EQ(file->cameras[0].intrinsics->fy, 101);
  const auto chosen = choose_camera(*file);
  ASSERT_TRUE(chosen.ok()) << error_line(chosen);
  EXPECT_EQ(chosen->sees, "event");
  const auto absent = read("%YAML:1.0\nevent_left_calib: \"absent.yaml\"\n" + place);
  ASSERT_TRUE(absent.ok());
  EXPECT_TRUE(says(absent->notes.at(0).line(), {"c.yaml:2", "absent.yaml is not there"}));
}

TEST_F(Rig, ModelsThatAreNotImplementedAreReadAndRefusedByName) {
  const auto refused = [&](const std::string& model, const std::string& numbers,
                           const std::string& distortion) {
    const auto file = read("cam0:\n  camera_model: " + model + "\n  intrinsics: " + numbers +
                           "\n  distortion_model: " + distortion + "\n  resolution: [102, 82]\n");
    EXPECT_TRUE(file.ok()) << error_line(file);
    if (!file) return std::string();
    EXPECT_EQ(file->cameras[0].intrinsics->cy, 40);
    return error_line(choose_camera(*file));
  };
  EXPECT_TRUE(says(refused("omni", "[1.1, 100, 101, 50, 40]", "radtan\n  distortion_coeffs: [0.1, 0, 0, 0]"),
                   {"c.yaml:2", "'omni-radtan' is not implemented"}));
  EXPECT_TRUE(says(refused("eucm", "[0.5, 1, 100, 101, 50, 40]", "none"), {"c.yaml:2", "'eucm'"}));
  EXPECT_TRUE(says(refused("pinhole", "[100, 101, 50, 40]", "fov\n  distortion_coeffs: [0.9]"),
                   {"c.yaml:4", "'fov' is not implemented", "radtan"}));
  EXPECT_EQ(refused("ds", "[-0.2, 0.5, 100, 101, 50, 40]", "none"), "(no error)");
}

TEST_F(Rig, CalibTxt) {
  const auto file =
      read("199.09 198.82 132.19 110.71 -0.3684 0.1509 -0.0002961 -0.000759 0.0\n", "calib.txt");
  ASSERT_TRUE(file.ok()) << error_line(file);
  EXPECT_EQ(file->cameras[0].intrinsics->cx, 132.19);
  EXPECT_EQ(file->cameras[0].intrinsics->distortion.size(), 4u);
  EXPECT_TRUE(says(error_line(choose_camera(*file)), {"resolution"}));
}

TEST_F(Rig, WhatIsWrittenAsKalibrComesBack) {
  CalibratedCamera camera;
  camera.intrinsics = CameraIntrinsics{100, 101, 50, 40, "ds", {-0.2, 0.55}, {102, 82}};
  camera.T_cam_imu = Pose{so3::exp({0.3, -0.2, 0.9}), {0.1, 0.2, -0.05}};
  camera.timeshift_cam_imu_s = 1.0 / 3;
  ASSERT_TRUE(write_kalibr_camera(folder / "k.yaml", camera).ok());
  const auto file = read_calibration(folder / "k.yaml");
  ASSERT_TRUE(file.ok()) << error_line(file);
  EXPECT_EQ(file->cameras[0].intrinsics->distortion, camera.intrinsics->distortion);
  EXPECT_EQ(file->cameras[0].intrinsics->distortion_model, "ds");
  EXPECT_LT(file->cameras[0].T_cam_imu->minus(*camera.T_cam_imu).norm(), 1e-12);
  EXPECT_EQ(file->cameras[0].timeshift_cam_imu_s, camera.timeshift_cam_imu_s);
}

TEST_F(Rig, FaultsNameTheLine) {
  EXPECT_TRUE(says(error_line(read("a: 1\nb: 2\n")), {"c.yaml", "no calibration of a known kind"}));
  EXPECT_TRUE(says(error_line(read("just words\n")), {"c.yaml", "no calibration"}));
  EXPECT_TRUE(says(error_line(read("")), {"c.yaml", "no calibration"}));
  EXPECT_TRUE(says(error_line(read(R"({"value0": {"intrinsics": [], "T_imu_cam": [], "resolution": []}})")),
                   {"c.yaml:1", "cameras"}));
  EXPECT_TRUE(says(error_line(read("cameras: []\n")), {"c.yaml:1", "empty"}));
  EXPECT_TRUE(says(error_line(read("intrinsics: {}\nextrinsics: {}\n")), {"c.yaml:1", "cam0"}));
  EXPECT_TRUE(says(error_line(read("T_a_b: [1, 2, 3]\n")), {"c.yaml:1", "T_a_b", "3 numbers"}));
  EXPECT_TRUE(says(error_line(read("T_a_b: [2,0,0,0, 0,1,0,0, 0,0,1,0]\n")), {"c.yaml:1", "orthonormal"}));
}

TEST_F(Rig, DoubtsAreNotes) {
  const auto far =
      read(kKalibr + "  T_cam_imu: [1,0,0,3, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n  timeshift_cam_imu: 2\n");
  ASSERT_TRUE(far.ok()) << error_line(far);
  ASSERT_EQ(far->notes.size(), 2u);
  EXPECT_TRUE(says(far->notes[0].line(), {"3 m away"}));
  EXPECT_TRUE(says(far->notes[1].line(), {"2 s apart"}));
  std::string outside = kKalibr;
  outside.replace(outside.find("50, 40"), 6, "200, 40");
  EXPECT_TRUE(says(read(outside)->notes.at(0).line(), {"c.yaml:5", "outside of the image"}));
}

}  // namespace
}  // namespace evpose
