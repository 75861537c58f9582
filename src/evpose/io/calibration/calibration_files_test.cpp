// SPDX-License-Identifier: BSD-3-Clause
// Calibrations that others published, against every number in them as another program read it.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "evpose/io/calibration/calibration.h"
#include "evpose/io/files/test_files.h"
#include "evpose/io/files/yaml_document.h"

namespace evpose {
namespace {

using Numbers = std::vector<double>;

std::string calibrations() { return shared_folder() + "/data/real/formats/calibrations/"; }

/// The known values of one file.
class Known {
 public:
  explicit Known(const std::string& file)
      : values_(nlohmann::json::parse(content_of(calibrations() + "known_values.json")).at(file)) {}

  const nlohmann::json& all() const { return values_; }
  double number(const std::string& path) const { return values_.at(path).get<double>(); }
  Numbers numbers(const std::string& path) const { return values_.at(path).get<Numbers>(); }
  Pose pose(const std::string& path) const {
    Numbers v = numbers(path);
    if (v.size() == 12) v.insert(v.end(), {0, 0, 0, 1});
    return Pose::from_matrix(Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(v.data()));
  }
  /// Basalt's {px ... qw}.
  Pose named_pose(const std::string& path) const {
    const auto v = [&](const char* key) { return number(path + "/" + key); };
    return {Eigen::Quaterniond(v("qw"), v("qx"), v("qy"), v("qz")), {v("px"), v("py"), v("pz")}};
  }

 private:
  nlohmann::json values_;
};

void expect_pose(const std::optional<Pose>& pose, const Pose& expected, double rotation = 2e-6) {
  ASSERT_TRUE(pose.has_value());
  EXPECT_LT((pose->p - expected.p).norm(), 1e-9 + rotation * expected.p.norm());
  EXPECT_LT((pose->rotation() - expected.rotation()).cwiseAbs().maxCoeff(), rotation);
}

/// Every file is read by the name of a test of its own.
class CalibrationFiles : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override { EVPOSE_NEEDS_SHARED(calibrations()); }
};

/// The node at "/cam0/T_cam_imu" or "/value0/intrinsics/0/camera_type".
const YamlNode* at_path(const YamlNode& root, const std::string& path) {
  const YamlNode* node = &root;
  for (std::size_t at = 1; node != nullptr && at <= path.size();) {
    const std::size_t end = std::min(path.find('/', at), path.size());
    const std::string key = path.substr(at, end - at);
    node = node->kind == YamlNode::Kind::list ? &node->items.at(std::stoul(key)) : node->find(key);
    at = end + 1;
  }
  return node;
}

TEST_P(CalibrationFiles, EveryValueIsReadExactly) {
  const auto document = YamlDocument::read(calibrations() + GetParam());
  ASSERT_TRUE(document.ok()) << error_line(document);
  const Known known(GetParam());
  for (const auto& [path, value] : known.all().items()) {
    const YamlNode* node = at_path(document->root, path);
    ASSERT_NE(node, nullptr) << path;
    if (value.is_array() && !value.empty() && value.front().is_number()) {
      const auto read = document->numbers(*node, path);
      ASSERT_TRUE(read.ok()) << error_line(read);
      EXPECT_EQ(*read, value.get<Numbers>()) << path;
    } else if (value.is_number()) {
      const auto read = document->number(*node, path);
      ASSERT_TRUE(read.ok()) << error_line(read);
      EXPECT_EQ(*read, value.get<double>()) << path;
    } else if (value.is_string()) {
      EXPECT_EQ(node->scalar, value.get<std::string>()) << path;
    }
  }
}

TEST_P(CalibrationFiles, IsACalibrationOfAKnownKind) {
  const auto file = read_calibration(calibrations() + GetParam());
  ASSERT_TRUE(file.ok()) << error_line(file);
  EXPECT_FALSE(file->kind.empty());
  EXPECT_TRUE(!file->cameras.empty() || file->imu_noise || !file->transforms.empty());
}

std::string test_name(const ::testing::TestParamInfo<const char*>& info) {
  std::string name = info.param;
  for (char& c : name)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  return name;
}

INSTANTIATE_TEST_SUITE_P(
    Published, CalibrationFiles,
    ::testing::Values("basalt_euroc_ds_calib.json", "basalt_t265_kb4_calib.json",
                      "dsec_cam_to_cam_siyuanwu99.yaml", "dsec_zurich_city_04_a_cam_to_cam.yaml",
                      "dsec_zurich_city_04_a_cam_to_lidar.yaml", "esvio_vector_event0_opencv.yaml",
                      "esvio_vector_opencv.yaml", "esvo2_vector_left.yaml", "esvo2_vector_right.yaml",
                      "kalibr_kartikmohta_camchain-imucam.yaml",
                      "kalibr_mvsec_camchain-imucam-indoor_flying.yaml", "kalibr_padrl_camchain-imucam.yaml",
                      "openvins_tum_vi_kalibr_imucam_chain.yaml",
                      "openvins_uzhfpv_indoor_kalibr_imu_chain.yaml",
                      "openvins_uzhfpv_indoor_kalibr_imucam_chain.yaml",
                      "ros_camera_info_DAVIS-00000254.yaml", "ros_camera_info_DAVIS-evo.yaml",
                      "ros_camera_info_mvsec_left.yaml", "ros_camera_info_tumvie_calibA.yaml",
                      "ultimate_slam_DAVIS-IJRR17.yaml", "vector_left_event_camera_intrinsic_results.yaml",
                      "vector_left_regular_camera_intrinsic_results.yaml",
                      "vector_right_event_camera_intrinsic_results.yaml"),
    test_name);

// What each kind of file means, from the same known values.

/// One file, read, with its known values.
struct Pair {
  explicit Pair(const std::string& name) : known(name) {
    auto read = read_calibration(calibrations() + name);
    EXPECT_TRUE(read.ok()) << error_line(read);
    if (read.ok()) file = *std::move(read);
  }
  const CameraIntrinsics& intrinsics(std::size_t i) const { return file.cameras.at(i).intrinsics.value(); }

  Known known;
  CalibrationFile file;
};

void expect_intrinsics(const CameraIntrinsics& c, const Numbers& f, const Numbers& distortion,
                       const Numbers& size, const std::string& model) {
  EXPECT_EQ((Numbers{c.fx, c.fy, c.cx, c.cy}), f);
  EXPECT_EQ(c.distortion, distortion);
  EXPECT_EQ((Numbers{double(c.size.width), double(c.size.height)}), size);
  EXPECT_EQ(c.distortion_model, model);
}

class CalibrationMeaning : public ::testing::Test {
 protected:
  void SetUp() override { EVPOSE_NEEDS_SHARED(calibrations()); }
};

TEST_F(CalibrationMeaning, Kalibr) {
  const std::pair<const char*, std::size_t> files[] = {
      {"kalibr_kartikmohta_camchain-imucam.yaml", 0},
      {"kalibr_kartikmohta_camchain-imucam.yaml", 1},
      {"kalibr_mvsec_camchain-imucam-indoor_flying.yaml", 0},
      {"kalibr_mvsec_camchain-imucam-indoor_flying.yaml", 1},
      {"kalibr_padrl_camchain-imucam.yaml", 0},
      {"kalibr_padrl_camchain-imucam.yaml", 1},
      {"openvins_tum_vi_kalibr_imucam_chain.yaml", 0},
      {"openvins_tum_vi_kalibr_imucam_chain.yaml", 1},
      {"openvins_uzhfpv_indoor_kalibr_imucam_chain.yaml", 1}};
  for (const auto& [name, i] : files) {
    SCOPED_TRACE(name);
    const Pair pair(name);
    const std::string cam = text("/cam", i);
    expect_intrinsics(pair.intrinsics(i), pair.known.numbers(cam + "/intrinsics"),
                      pair.known.numbers(cam + "/distortion_coeffs"), pair.known.numbers(cam + "/resolution"),
                      "equidistant");
    const CalibratedCamera& camera = pair.file.cameras[i];
    expect_pose(camera.T_cam_imu, pair.known.pose(cam + "/T_cam_imu"));
    if (pair.known.all().contains(cam + "/timeshift_cam_imu")) {
      EXPECT_EQ(camera.timeshift_cam_imu_s, pair.known.number(cam + "/timeshift_cam_imu"));
    } else {
      EXPECT_FALSE(camera.has_timeshift);
    }
    // The two ways to the second camera agree, as their authors wrote both.
    if (i == 1 && pair.known.all().contains("/cam1/T_cn_cnm1"))
      expect_pose(camera.T_cam_cam0, pair.known.pose("/cam1/T_cn_cnm1"));
  }
}

TEST_F(CalibrationMeaning, KalibrChainGivesTheSecondCameraWithoutItsOwnTransform) {
  const Pair pair("openvins_uzhfpv_indoor_kalibr_imucam_chain.yaml");
  // T_cam1_imu = T_cam1_cam0 T_cam0_imu; the file holds all three, calibrated together.
  const Pose chained = pair.known.pose("/cam1/T_cn_cnm1") * pair.known.pose("/cam0/T_cam_imu");
  expect_pose(pair.file.cameras[1].T_cam_imu, chained, 1e-5);
}

TEST_F(CalibrationMeaning, KalibrImu) {
  const Pair pair("openvins_uzhfpv_indoor_kalibr_imu_chain.yaml");
  ASSERT_TRUE(pair.file.imu_noise.has_value());
  EXPECT_EQ(pair.file.imu_noise->accel_density, pair.known.number("/imu0/accelerometer_noise_density"));
  EXPECT_EQ(pair.file.imu_noise->accel_walk, pair.known.number("/imu0/accelerometer_random_walk"));
  EXPECT_EQ(pair.file.imu_noise->gyro_density, pair.known.number("/imu0/gyroscope_noise_density"));
  EXPECT_EQ(pair.file.imu_noise->gyro_walk, pair.known.number("/imu0/gyroscope_random_walk"));
  EXPECT_EQ(pair.file.imu_noise->rate_hz, 200);
}

TEST_F(CalibrationMeaning, ResolutionInTheWrongOrderIsNamed) {
  const Pair pair("kalibr_padrl_camchain-imucam.yaml");
  EXPECT_EQ(pair.intrinsics(0).size, (ImageSize{480, 640}));  // as it stands there
  ASSERT_FALSE(pair.file.notes.empty());
  EXPECT_TRUE(
      says(pair.file.notes.front().line(), {"imucam.yaml:10", "cam0", "640 x 480", "[width, height]"}));
}

TEST_F(CalibrationMeaning, Basalt) {
  for (const auto& [name, model, extra] :
       {std::tuple("basalt_euroc_ds_calib.json", "ds", std::vector<const char*>{"xi", "alpha"}),
        std::tuple("basalt_t265_kb4_calib.json", "equidistant",
                   std::vector<const char*>{"k1", "k2", "k3", "k4"})}) {
    SCOPED_TRACE(name);
    const Pair pair(name);
    ASSERT_EQ(pair.file.cameras.size(), 2u);
    const Numbers sizes = pair.known.numbers("/value0/resolution");
    for (std::size_t i = 0; i < 2; ++i) {
      const std::string at = text("/value0/intrinsics/", i, "/intrinsics/");
      Numbers f, distortion;
      for (const char* key : {"fx", "fy", "cx", "cy"}) f.push_back(pair.known.number(at + key));
      for (const char* key : extra) distortion.push_back(pair.known.number(at + key));
      expect_intrinsics(pair.intrinsics(i), f, distortion, {sizes[2 * i], sizes[2 * i + 1]}, model);
      const CalibratedCamera& camera = pair.file.cameras[i];
      expect_pose(camera.T_cam_imu->inverse(), pair.known.named_pose(text("/value0/T_imu_cam/", i)), 1e-9);
      EXPECT_EQ(camera.timeshift_cam_imu_s, 1e-9 * pair.known.number("/value0/cam_time_offset_ns"));
      EXPECT_TRUE(make_camera(pair.intrinsics(i)).ok());
    }
    EXPECT_EQ(pair.file.imu_noise->rate_hz, pair.known.number("/value0/imu_update_rate"));
    EXPECT_EQ(pair.file.imu_noise->gyro_density, pair.known.numbers("/value0/gyro_noise_std")[0]);
    EXPECT_EQ(pair.file.imu_noise->gyro_walk, pair.known.numbers("/value0/gyro_bias_std")[0]);
    EXPECT_EQ(pair.file.imu_noise->accel_density, pair.known.numbers("/value0/accel_noise_std")[0]);
    EXPECT_EQ(pair.file.imu_noise->accel_walk, pair.known.numbers("/value0/accel_bias_std")[0]);
  }
}

TEST_F(CalibrationMeaning, Dsec) {
  for (const char* name : {"dsec_cam_to_cam_siyuanwu99.yaml", "dsec_zurich_city_04_a_cam_to_cam.yaml"}) {
    SCOPED_TRACE(name);
    const Pair pair(name);
    ASSERT_EQ(pair.file.cameras.size(), 4u);
    Pose T_cam_cam0;
    for (std::size_t i = 0; i < 4; ++i) {
      const std::string cam = text("/intrinsics/cam", i);
      expect_intrinsics(pair.intrinsics(i), pair.known.numbers(cam + "/camera_matrix"),
                        pair.known.numbers(cam + "/distortion_coeffs"),
                        pair.known.numbers(cam + "/resolution"), "radtan");
      EXPECT_EQ(pair.file.cameras[i].sees, i == 0 || i == 3 ? "event" : "frame");
      EXPECT_FALSE(pair.file.cameras[i].T_cam_imu.has_value());
      if (i > 0) T_cam_cam0 = pair.known.pose(text("/extrinsics/T_", i, i - 1)) * T_cam_cam0;
      expect_pose(pair.file.cameras[i].T_cam_cam0, T_cam_cam0);
    }
    // The right event camera sees the left one about 0.6 m to its left: the baseline of the car's rig.
    EXPECT_NEAR(pair.file.cameras[3].T_cam_cam0->p.x(), -0.6, 0.02);
  }
  const Pair lidar("dsec_zurich_city_04_a_cam_to_lidar.yaml");
  ASSERT_EQ(lidar.file.transforms.size(), 1u);
  EXPECT_EQ(lidar.file.transforms[0].name, "T_lidar_camRect1");
  expect_pose(lidar.file.transforms[0].pose, lidar.known.pose("/T_lidar_camRect1"));
}

TEST_F(CalibrationMeaning, CameraInfo) {
  for (const auto& [name, model] :
       {std::pair("ros_camera_info_DAVIS-00000254.yaml", "radtan"),
        std::pair("ros_camera_info_DAVIS-evo.yaml", "radtan"),
        std::pair("ros_camera_info_mvsec_left.yaml", "equidistant"),
        std::pair("ros_camera_info_tumvie_calibA.yaml", "equidistant"),
        std::pair("vector_left_event_camera_intrinsic_results.yaml", "radtan"),
        std::pair("vector_right_event_camera_intrinsic_results.yaml", "radtan"),
        std::pair("vector_left_regular_camera_intrinsic_results.yaml", "radtan"),
        std::pair("esvo2_vector_left.yaml", "radtan"), std::pair("esvo2_vector_right.yaml", "radtan")}) {
    SCOPED_TRACE(name);
    const Pair pair(name);
    const Numbers K = pair.known.numbers("/camera_matrix/data");
    Numbers D = pair.known.numbers("/distortion_coefficients/data");
    D.resize(4);  // the fifth is zero in all of them
    expect_intrinsics(pair.intrinsics(0), {K[0], K[4], K[2], K[5]}, D,
                      {pair.known.number("/image_width"), pair.known.number("/image_height")}, model);
    if (pair.known.all().contains("/T_b_c/data")) {
      expect_pose(pair.file.cameras[0].T_cam_imu->inverse(), pair.known.pose("/T_b_c/data"), 1e-12);
      // cols says 4, five numbers follow.
      ASSERT_FALSE(pair.file.notes.empty());
      EXPECT_TRUE(says(pair.file.notes.front().line(), {"yaml:11", "1 x 4", "5 numbers"}));
    } else {
      EXPECT_FALSE(pair.file.cameras[0].T_cam_imu.has_value());
    }
  }
}

TEST_F(CalibrationMeaning, Ncamera) {
  const Pair pair("ultimate_slam_DAVIS-IJRR17.yaml");
  ASSERT_EQ(pair.file.cameras.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    const std::string at = text("/cameras/", i, "/");
    expect_intrinsics(pair.intrinsics(i), pair.known.numbers(at + "camera/intrinsics/data"),
                      pair.known.numbers(at + "camera/distortion/parameters/data"), {240, 180}, "radtan");
    expect_pose(pair.file.cameras[i].T_cam_imu->inverse(), pair.known.pose(at + "T_B_C/data"));
  }
  EXPECT_EQ(pair.file.cameras[0].name, "dvs");
  EXPECT_EQ(pair.file.cameras[0].sees, "event");
}

TEST_F(CalibrationMeaning, OpencvPinhole) {
  const Pair pair("esvio_vector_event0_opencv.yaml");
  Numbers f, d;
  for (const char* key : {"fx", "fy", "cx", "cy"})
    f.push_back(pair.known.number(text("/projection_parameters/", key)));
  for (const char* key : {"k1", "k2", "p1", "p2"})
    d.push_back(pair.known.number(text("/distortion_parameters/", key)));
  expect_intrinsics(pair.intrinsics(0), f, d, {640, 480}, "radtan");
}

TEST_F(CalibrationMeaning, VinsFileThatSaysImuToCameraIsTakenAtItsWord) {
  const Pair pair("esvio_vector_opencv.yaml");
  ASSERT_EQ(pair.file.cameras.size(), 4u);
  const CalibratedCamera &event = pair.file.cameras[0], &event_right = pair.file.cameras[1];
  const CalibratedCamera &frame = pair.file.cameras[2], &frame_right = pair.file.cameras[3];
  const Numbers p = pair.known.numbers("/extrinsicTranslation_event/data");
  EXPECT_EQ(event.T_cam_imu->p, Eigen::Vector3d(p[0], p[1], p[2]));
  expect_pose(event_right.T_cam_imu->inverse(), pair.known.pose("/body_T_event1/data"));
  // The file also holds left to right: only one choice of directions closes the triangle.
  const auto left_to_right = [&](const std::string& R, const std::string& t) {
    const Numbers r = pair.known.numbers(R), v = pair.known.numbers(t);
    Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
    T.topLeftCorner<3, 3>() = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(r.data());
    T.topRightCorner<3, 1>() = Eigen::Vector3d(v[0], v[1], v[2]);
    return Pose::from_matrix(T);
  };
  expect_pose(*event_right.T_cam_imu * event.T_cam_imu->inverse(),
              left_to_right("/Rrl_event/data", "/Trl_event/data"), 3e-4);
  expect_pose(*frame_right.T_cam_imu * frame.T_cam_imu->inverse(), left_to_right("/Rrl/data", "/Trl/data"),
              3e-4);
}

}  // namespace
}  // namespace evpose
