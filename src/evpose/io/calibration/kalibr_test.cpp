// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/calibration/kalibr.h"

#include <gtest/gtest.h>

#include "evpose/io/files/test_files.h"

namespace evpose {
namespace {

const std::string kCamera =
    "cam0:\n"
    "  camera_model: pinhole\n"
    "  distortion_coeffs: [-0.1, 0.02, 0.0005, -0.0003]\n"
    "  distortion_model: radtan\n"
    "  intrinsics: [381.0, 382.0, 322.4, 236.9]\n"
    "  resolution: [640, 480]\n"
    "  T_cam_imu:\n"
    "  - [0.0, -1.0, 0.0, 0.1]\n"
    "  - [0.0, 0.0, -1.0, 0.2]\n"
    "  - [1.0, 0.0, 0.0, 0.3]\n"
    "  - [0.0, 0.0, 0.0, 1.0]\n"
    "  timeshift_cam_imu: -0.002\n";

Expected<CalibratedCamera> read_camera(const std::string& path, int index = 0) {
  const auto file = read_calibration(path);
  if (!file) return file.error();
  return choose_camera(*file, index);
}

std::string replaced(std::string s, const std::string& from, const std::string& to) {
  const auto at = s.find(from);
  EVPOSE_CHECK(at != std::string::npos);
  return s.replace(at, from.size(), to);
}

TEST(Kalibr, CameraIsReadAsWritten) {
  const TemporaryFolder folder;
  const auto camera = read_camera(folder.file("c.yaml", kCamera));
  ASSERT_TRUE(camera.ok()) << error_line(camera);
  EXPECT_EQ(camera->intrinsics->fx, 381);
  EXPECT_EQ(camera->intrinsics->fy, 382);
  EXPECT_EQ(camera->intrinsics->cx, 322.4);
  EXPECT_EQ(camera->intrinsics->cy, 236.9);
  EXPECT_EQ(camera->intrinsics->size, (ImageSize{640, 480}));
  EXPECT_EQ(camera->intrinsics->distortion, (std::vector<double>{-0.1, 0.02, 0.0005, -0.0003}));
  EXPECT_TRUE(camera->T_cam_imu.has_value());
  EXPECT_EQ(camera->timeshift_cam_imu_s, -0.002);
  // A point one metre ahead of the body is one metre ahead of the camera.
  EXPECT_LT((*camera->T_cam_imu * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(0.1, 0.2, 1.3)).norm(), 1e-12);

  ASSERT_TRUE(write_kalibr_camera(folder / "d.yaml", *camera).ok());
  const auto again = read_camera(folder / "d.yaml");
  ASSERT_TRUE(again.ok()) << error_line(again);
  EXPECT_LT(again->T_cam_imu->minus(*camera->T_cam_imu).norm(), 1e-12);
  EXPECT_EQ(again->intrinsics->distortion, camera->intrinsics->distortion);
  EXPECT_EQ(again->timeshift_cam_imu_s, camera->timeshift_cam_imu_s);
}

TEST(Kalibr, WhatIsStatedOfTheErrorsIsReadAsWritten) {
  const TemporaryFolder folder;
  const auto plain = read_camera(folder.file("plain.yaml", kCamera));
  ASSERT_TRUE(plain.ok());
  EXPECT_FALSE(plain->sigma.intrinsics || plain->sigma.distortion || plain->sigma.rotation_rad ||
               plain->sigma.translation_m || plain->sigma.time_s);

  const auto one_each = read_camera(folder.file("one.yaml", kCamera + "  T_cam_imu_sigma: [0.18, 0.004]\n"));
  ASSERT_TRUE(one_each.ok()) << error_line(one_each);
  EXPECT_TRUE(one_each->sigma.rotation_rad->isApprox(Eigen::Vector3d::Constant(0.18 * M_PI / 180)));
  EXPECT_EQ(*one_each->sigma.translation_m, Eigen::Vector3d::Constant(0.004));
  EXPECT_FALSE(one_each->sigma.intrinsics || one_each->sigma.time_s) << "stated in part";

  CalibratedCamera camera = *plain;
  camera.sigma = {std::vector<double>{1, 2, 0.5, 0},
                  std::vector<double>{0.01, 0.02, 0, 1e-4},
                  Eigen::Vector3d(1e-3, 2e-3, 0),
                  Eigen::Vector3d(0, 0.002, 0.003),
                  5e-4,
                  {}};
  ASSERT_TRUE(write_kalibr_camera(folder / "all.yaml", camera).ok());
  const auto all = read_camera(folder / "all.yaml");
  ASSERT_TRUE(all.ok()) << error_line(all);
  EXPECT_EQ(*all->sigma.intrinsics, *camera.sigma.intrinsics);
  EXPECT_EQ(*all->sigma.distortion, *camera.sigma.distortion);
  EXPECT_TRUE(all->sigma.rotation_rad->isApprox(*camera.sigma.rotation_rad));
  EXPECT_EQ(*all->sigma.translation_m, *camera.sigma.translation_m);
  EXPECT_EQ(*all->sigma.time_s, 5e-4);
}

TEST(Kalibr, CorrelationsAreReadAsWritten) {
  const TemporaryFolder folder;
  auto camera = read_camera(folder.file("plain.yaml", kCamera));
  ASSERT_TRUE(camera.ok());
  for (const int n : {8, 15}) {  // the camera alone; with its pose and time
    Eigen::MatrixXd R = Eigen::MatrixXd::Identity(n, n);
    R(0, 1) = R(1, 0) = 0.1 + 1.0 / 3;
    R(2, n - 1) = R(n - 1, 2) = -0.7;
    camera->sigma.correlation = R;
    ASSERT_TRUE(write_kalibr_camera(folder / "all.yaml", *camera).ok());
    const auto again = read_camera(folder / "all.yaml");
    ASSERT_TRUE(again.ok()) << error_line(again);
    EXPECT_EQ(*again->sigma.correlation, R);
  }
  const auto line = [&](const std::string& value) {
    return error_line(
        read_camera(folder.file("c.yaml", kCamera + "  calibration_correlation: " + value + "\n")));
  };
  EXPECT_TRUE(says(line("[1, 2]"), {"c.yaml:13", "2 numbers instead of 64 or 225"}));
  std::string rows = "[";
  for (int i = 0; i < 64; ++i)
    rows += std::string(i == 0 ? "" : ", ") + (i == 1 ? "2" : i % 9 == 0 ? "1" : "0");
  EXPECT_TRUE(says(line(rows + "]"), {"c.yaml:13", "no correlation matrix"}));
}

TEST(Kalibr, SigmasThatAreNoneNameTheLine) {
  const TemporaryFolder folder;
  for (const char* line : {"intrinsics_sigma: [1, 1, 1]", "intrinsics_sigma: [1, 1, -1, 1]",
                           "distortion_sigma: [0.1]", "distortion_sigma: [0.1, .nan, 0.1, 0.1]",
                           "T_cam_imu_sigma: [0.1, 0.1, 0.1]", "timeshift_sigma: -0.001"}) {
    const auto camera = read_camera(folder.file("c.yaml", kCamera + "  " + line + "\n"));
    ASSERT_FALSE(camera.ok()) << line;
    EXPECT_NE(camera.error().line().find("c.yaml:13"), std::string::npos) << camera.error().line();
  }
}

TEST(Kalibr, TheSensorsTrailFilterIsReadAsWritten) {
  const TemporaryFolder folder;
  auto camera = read_camera(folder.file("plain.yaml", kCamera));
  ASSERT_TRUE(camera.ok());
  EXPECT_EQ(camera->trail_filter.kind, TrailFilterKind::none);
  for (const auto& [word, kind] : kTrailFilters) {
    EXPECT_EQ(trail_filter_word(kind), word);
    camera->trail_filter = {kind, 0.003};
    ASSERT_TRUE(write_kalibr_camera(folder / "all.yaml", *camera).ok());
    const auto again = read_camera(folder / "all.yaml");
    ASSERT_TRUE(again.ok()) << error_line(again);
    EXPECT_EQ(again->trail_filter.kind, kind);
    EXPECT_EQ(again->trail_filter.longest_gap_s,
              kind == TrailFilterKind::none ? TrailFilterSetting().longest_gap_s : 0.003);
  }
  const auto line = [&](const std::string& lines) {
    return error_line(read_camera(folder.file("c.yaml", kCamera + lines)));
  };
  EXPECT_TRUE(says(line("  trail_filter: last\n"), {"c.yaml:13", "'last' is not known", "all_but_first"}));
  EXPECT_TRUE(says(line("  trail_filter: first\n"), {"trail_filter_gap"}));
  EXPECT_TRUE(says(line("  trail_filter: first\n  trail_filter_gap: -1\n"), {"c.yaml:14", "-1 s"}));
}

TEST(Kalibr, ExtrinsicsRunAlongTheChain) {
  const TemporaryFolder folder;
  const std::string second =
      "cam1:\n  camera_model: pinhole\n  distortion_model: none\n  distortion_coeffs: []\n"
      "  intrinsics: [100, 100, 50, 50]\n  resolution: [100, 100]\n"
      "  T_cn_cnm1: [1, 0, 0, -0.5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n";
  const auto camera = read_camera(folder.file("c.yaml", kCamera + second), 1);
  ASSERT_TRUE(camera.ok()) << error_line(camera);
  EXPECT_TRUE(camera->T_cam_imu.has_value());
  EXPECT_LT((*camera->T_cam_imu * Eigen::Vector3d::Zero() - Eigen::Vector3d(-0.4, 0.2, 0.3)).norm(), 1e-12);
}

TEST(Kalibr, WithoutExtrinsicsItSaysSo) {
  const TemporaryFolder folder;
  const std::string alone = kCamera.substr(0, kCamera.find("  T_cam_imu"));
  const auto camera = read_camera(folder.file("c.yaml", alone));
  ASSERT_TRUE(camera.ok()) << error_line(camera);
  EXPECT_FALSE(camera->T_cam_imu.has_value());
}

TEST(Kalibr, ErrorsNameTheLine) {
  const TemporaryFolder folder;
  const auto line = [&](const std::string& from, const std::string& to) {
    return error_line(read_camera(folder.file("c.yaml", replaced(kCamera, from, to))));
  };
  EXPECT_TRUE(says(line("pinhole", "omni"), {"c.yaml:5", "intrinsics: 4 numbers instead of 5"}));
  EXPECT_TRUE(says(line("radtan", "fov"), {"c.yaml:4", "fov"}));
  EXPECT_TRUE(says(line(", -0.0003", ""), {"c.yaml:3", "3 numbers", "4"}));
  EXPECT_TRUE(says(line("381.0", "nan"), {"c.yaml:5", "intrinsics", "nan"}));
  EXPECT_TRUE(says(line("381.0", "-381.0"), {"c.yaml:5"}));
  EXPECT_TRUE(says(line("resolution: [640", "resolution: [640.5"), {"c.yaml:6", "640.5"}));
  EXPECT_TRUE(says(line("resolution: [", "resolution: [["), {"c.yaml:"}));
  EXPECT_TRUE(says(line("resolution", "resolutoin"), {"c.yaml:1", "'resolution' is missing"}));
  EXPECT_TRUE(says(line("[0.0, -1.0,", "[0.1, -1.0,"), {"c.yaml:7", "T_cam_imu", "orthonormal"}));
  EXPECT_TRUE(says(line("[0.0, -1.0, 0.0", "[0.0, 1.0, 0.0"), {"c.yaml:7", "mirrors"}));
  EXPECT_TRUE(says(line("0.0, 0.0, 0.0, 1.0", "0.0, 0.0, 0.5, 1.0"), {"c.yaml:7", "last row"}));
  EXPECT_TRUE(says(line("cam0", "cam1"), {"c.yaml", "cam0"}));
}

TEST(Kalibr, ImuModelInBothShapes) {
  const TemporaryFolder folder;
  const ImuNoise noise{1e-3, 2e-4, 3e-4, 4e-5, 500, {}};
  ASSERT_TRUE(write_kalibr_imu(folder / "imu.yaml", noise).ok());
  const std::string plain = content_of(folder / "imu.yaml");
  std::string nested = "imu0:\n";
  for (std::size_t at = 0; at < plain.size(); at = plain.find('\n', at) + 1)
    nested += "  " + plain.substr(at, plain.find('\n', at) + 1 - at);
  for (const std::string& content : {plain, nested, "%YAML:1.0 # OpenCV's heading\n" + nested}) {
    const auto again = read_imu_noise(folder.file("imu.yaml", content));
    ASSERT_TRUE(again.ok()) << error_line(again);
    EXPECT_EQ(again->accel_density, noise.accel_density);
    EXPECT_EQ(again->accel_walk, noise.accel_walk);
    EXPECT_EQ(again->gyro_density, noise.gyro_density);
    EXPECT_EQ(again->gyro_walk, noise.gyro_walk);
    EXPECT_EQ(again->rate_hz, noise.rate_hz);
  }
  const auto line = [&](const std::string& content) {
    return error_line(read_imu_noise(folder.file("i.yaml", content)));
  };
  EXPECT_TRUE(says(line(replaced(plain, "0.001", "0")), {"i.yaml:1", "not positive"}));
  EXPECT_TRUE(says(line(replaced(plain, "update_rate", "rate")), {"i.yaml:1", "update_rate"}));
  EXPECT_TRUE(says(line(plain + "model: scale-misalignment-size-effect\n"), {"i.yaml:6", "size-effect"}));
  EXPECT_TRUE(says(line(plain + "model: scale-misalignment\n"), {"accelerometers"}));
}

TEST(Kalibr, AxesOfAnImuAreReadAsTheyAreWritten) {
  const TemporaryFolder folder;
  ImuNoise noise;
  noise.axes.gyro << 1.01, 0.002, -0.003, 0.004, 0.99, 0.005, -0.006, 0.007, 1.02;
  noise.axes.accel << 0.98, 0, 0, 0.001, 1.03, 0, -0.002, 0.003, 1;
  noise.axes.gyro_by_force << 1e-4, 0, 2e-4, 0, -1e-4, 0, 0, 0, 3e-4;
  noise.axes.accel_sigma.setConstant(1e-3);
  ASSERT_TRUE(write_kalibr_imu(folder / "imu.yaml", noise).ok());
  const auto again = read_imu_noise(folder / "imu.yaml");
  ASSERT_TRUE(again.ok()) << error_line(again);
  EXPECT_EQ(again->axes.gyro, noise.axes.gyro);
  EXPECT_EQ(again->axes.accel, noise.axes.accel);
  EXPECT_EQ(again->axes.gyro_by_force, noise.axes.gyro_by_force);
  EXPECT_EQ(again->axes.accel_sigma, noise.axes.accel_sigma);
  EXPECT_LT(again->axes.gyro_sigma.maxCoeff(), 0);

  // As Kalibr splits them: M C_gyro_i, A C_gyro_i.
  const std::string written = content_of(folder / "imu.yaml");
  const std::string turned = written.substr(0, written.find("  C_gyro_i")) +
                             "  C_gyro_i:\n  - [0.8, 0.6, 0.0]\n  - [-0.6, 0.8, 0.0]\n  - [0.0, 0.0, 1.0]\n";
  const auto split = read_imu_noise(folder.file("turned.yaml", turned));
  ASSERT_TRUE(split.ok()) << error_line(split);
  Eigen::Matrix3d C;
  C << 0.8, 0.6, 0, -0.6, 0.8, 0, 0, 0, 1;
  EXPECT_LT((split->axes.gyro - noise.axes.gyro * C).norm(), 1e-15);
  EXPECT_LT((split->axes.gyro_by_force - noise.axes.gyro_by_force * C).norm(), 1e-15);

  const auto line = [&](const char* from, const char* to) {
    return error_line(read_imu_noise(folder.file("i.yaml", replaced(written, from, to))));
  };
  EXPECT_TRUE(says(line("[0.98,", "[-0.98,"), {"i.yaml:", "M: is no matrix near the identity"}));
  EXPECT_TRUE(says(line("[0.98, 0,", "[0.98,"), {"i.yaml:", "M: 8 numbers instead of 9"}));
  EXPECT_TRUE(says(line("[0.001, 0.001", "[0.001, -0.001"), {"i.yaml:", "no standard deviation"}));
  EXPECT_TRUE(says(line("C_gyro_i:\n  - [1", "C_gyro_i:\n  - [2"), {"i.yaml:", "is no rotation"}));
}

TEST(Kalibr, PublishedCalibrationsAreRead) {
  const std::string folder = shared_folder() + "/data/real/formats/calibrations/";
  EVPOSE_NEEDS_SHARED(folder);
  const auto mvsec = read_camera(folder + "kalibr_mvsec_camchain-imucam-indoor_flying.yaml");
  ASSERT_TRUE(mvsec.ok()) << error_line(mvsec);
  EXPECT_EQ(mvsec->intrinsics->fx, 226.38018519795807);
  EXPECT_EQ(mvsec->intrinsics->size, (ImageSize{346, 260}));
  const auto tum_vi = read_camera(folder + "openvins_tum_vi_kalibr_imucam_chain.yaml", 1);
  ASSERT_TRUE(tum_vi.ok()) << error_line(tum_vi);
  EXPECT_NEAR(tum_vi->T_cam_imu->p.x(), -0.053697434688869734, 1e-12);
  const auto flat = read_camera(folder + "kalibr_padrl_camchain-imucam.yaml");
  ASSERT_TRUE(flat.ok()) << error_line(flat);
  EXPECT_NEAR(flat->timeshift_cam_imu_s, 0.08140089931412792, 1e-15);
  const auto imu = read_imu_noise(folder + "openvins_uzhfpv_indoor_kalibr_imu_chain.yaml");
  EXPECT_TRUE(imu.ok()) << error_line(imu);
}

}  // namespace
}  // namespace evpose
