// SPDX-License-Identifier: BSD-3-Clause
// The Python module: the same Tracker, events and IMU as numpy arrays in, poses out.
#include <pybind11/eigen.h>
#include <pybind11/functional.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <deque>
#include <map>

#include "evpose/core/version.h"
#include "evpose/io/calibration/calibration.h"
#include "evpose/io/calibration/kalibr.h"
#include "evpose/io/files/config_yaml.h"
#include "evpose/io/maps/contour_files.h"
#include "evpose/io/maps/ply.h"
#include "evpose/tracker/tracker.h"
#include "evpose_files.h"

namespace py = pybind11;
namespace fs = std::filesystem;

namespace evpose {
namespace {

template <class T>
using Column = py::array_t<T, py::array::c_style | py::array::forcecast>;

Pose pose_of(const Eigen::Matrix4d& T) {
  const Eigen::Matrix3d R = T.topLeftCorner<3, 3>();
  if (!T.allFinite() || !(R.transpose() * R).isApprox(Eigen::Matrix3d::Identity(), 1e-3) ||
      R.determinant() < 0)
    throw py::value_error("T_map_body: no rigid transform; give a 4x4 matrix with a rotation");
  return Pose::from_matrix(T);
}

class PyTracker {
 public:
  PyTracker(const fs::path& map_path, const fs::path& calibration_path, const Eigen::Matrix4d& T_map_body,
            TimeNs t_ns, const Eigen::Vector3d& velocity, const fs::path& imu_model,
            const fs::path& occluders, const std::map<std::string, py::object>& settings) {
    const CalibrationFile file = value_of(read_calibration(calibration_path.string()));
    const CalibratedCamera chosen = value_of(choose_camera(file));
    size_ = chosen.intrinsics->size;
    TrackerSetup setup;
    setup.camera = value_of(make_camera(*chosen.intrinsics));
    setup.intrinsics = chosen.intrinsics;
    setup.calibration_sigma = chosen.sigma;
    setup.trail_filter = chosen.trail_filter;
    setup.T_body_cam = chosen.T_cam_imu.value_or(Pose{}).inverse();
    has_imu_ = chosen.T_cam_imu.has_value();
    setup.motion = has_imu_ ? MotionModel::imu : MotionModel::constant_velocity;
    if (file.imu_noise) setup.imu_noise = *file.imu_noise;
    if (!imu_model.empty()) setup.imu_noise = value_of(read_imu_noise(imu_model.string()));
    ContourMap map = value_of(read_contour_map(map_path.string()));
    if (!occluders.empty()) map.occluders = value_of(read_ply_mesh(occluders.string(), map.anchor));
    setup.map = std::make_shared<const ContourMap>(std::move(map));
    TrackerConfig config;
    ConfigTable table;
    describe(table, config);
    for (const auto& [key, setting] : settings)
      if (const auto ok = table.set(key, setting_text(setting), "settings"); !ok)
        throw py::value_error(ok.error().line());
    tracker_ = value_of(Tracker::create(setup, config, {t_ns, pose_of(T_map_body), velocity, {0, 0, 0}}));
    tracker_->on_update([this](const Update& u) { made_.push_back(u); });
  }

  void on_update(std::function<void(const Update&)> callback) { callback_ = std::move(callback); }

  std::vector<Update> add_events(const Column<std::int64_t>& t_us, const Column<std::uint16_t>& x,
                                 const Column<std::uint16_t>& y, const Column<std::uint8_t>& on) {
    const py::ssize_t n = t_us.size();
    if (t_us.ndim() != 1 || x.size() != n || y.size() != n || on.size() != n)
      throw py::value_error("events: t, x, y and p must be 1-D and equally long");
    EventPacket packet;
    const auto* t = t_us.data();
    for (py::ssize_t i = 0; i < n; ++i) {
      if (t[i] < last_us_) throw py::value_error(text("events: t[", i, "] goes back in time; sort them"));
      if (x.data()[i] >= size_.width || y.data()[i] >= size_.height)
        throw py::value_error(text("events: pixel ", i, " lies outside of the image"));
      if (packet.empty() || t[i] - packet.base / kNsPerUs > kLongestPacket_us) {
        take(packet);
        packet.base = t[i] * kNsPerUs;
      }
      packet.events.push_back(make_event(static_cast<std::uint32_t>(t[i] - packet.base / kNsPerUs),
                                         x.data()[i], y.data()[i], on.data()[i] != 0));
      last_us_ = t[i];
    }
    take(packet);
    return give();
  }

  /// Rows of gyro x, y, z and accel x, y, z.
  std::vector<Update> add_imu(const Column<std::int64_t>& t_ns, const Column<double>& rows) {
    const py::ssize_t n = t_ns.size();
    if (t_ns.ndim() != 1 || rows.ndim() != 2 || rows.shape(0) != n || rows.shape(1) != 6)
      throw py::value_error("imu: give t of shape (n,) and samples of shape (n, 6): gyro rad/s, accel m/s^2");
    for (py::ssize_t i = 0; i < n; ++i) {
      const double* row = rows.data(i, 0);
      const ImuSample sample{t_ns.data()[i], {row[0], row[1], row[2]}, {row[3], row[4], row[5]}};
      if (sample.t <= last_imu_)
        throw py::value_error(text("imu: t[", i, "] does not go on; sort the samples"));
      if (!sample.gyro.allFinite() || !sample.accel.allFinite())
        throw py::value_error(text("imu: sample ", i, " is not finite"));
      last_imu_ = sample.t;
      tracker_->add_imu(sample);
    }
    return give();
  }

  /// Rows from the top.
  std::vector<Update> add_frame(TimeNs t_ns, const Column<std::uint8_t>& grey, TimeNs exposure_ns) {
    if (grey.ndim() != 2 || grey.shape(0) != size_.height || grey.shape(1) != size_.width)
      throw py::value_error(text("frame: give grey levels of shape (", size_.height, ", ", size_.width, ")"));
    if (t_ns <= last_frame_) throw py::value_error("frame: t does not go on; sort the frames");
    if (exposure_ns < 0 || exposure_ns > kLongestExposure)
      throw py::value_error("frame: the exposure is out of range; give nanoseconds, at most ten seconds");
    last_frame_ = t_ns;
    tracker_->add_frame({t_ns, exposure_ns, size_, {grey.data(), grey.data() + grey.size()}});
    return give();
  }

  std::vector<Update> events_complete_until(TimeNs t_ns) {
    tracker_->events_complete_until(t_ns);
    return give();
  }

  bool has_imu() const { return has_imu_; }

 private:
  static constexpr TimeNs kLongestExposure = 10 * kNsPerS;
  static constexpr std::int64_t kLongestPacket_us = 1'000'000;

  void take(EventPacket& packet) {
    if (!packet.empty()) tracker_->add_events(packet);
    packet.events.clear();
  }
  std::vector<Update> give() {
    std::vector<Update> out(std::make_move_iterator(made_.begin()), std::make_move_iterator(made_.end()));
    made_.clear();
    if (callback_)
      for (const Update& u : out) callback_(u);
    return out;
  }

  ImageSize size_;
  bool has_imu_ = false;
  std::int64_t last_us_ = INT64_MIN;
  TimeNs last_imu_ = INT64_MIN, last_frame_ = INT64_MIN;
  std::unique_ptr<Tracker> tracker_;
  std::deque<Update> made_;
  std::function<void(const Update&)> callback_;
};

}  // namespace
}  // namespace evpose

PYBIND11_MODULE(evpose, m) {
  using namespace evpose;
  using namespace py::literals;
  m.doc() = "6-DoF pose from an event camera and an IMU against a prior 3D map of contours";
  m.attr("__version__") = version();
  py::class_<Update>(m, "Update", "What the tracker says about one instant; arrays are copies")
      .def_readonly("t_ns", &Update::t, "data time, ns")
      .def_property_readonly(
          "T_map_body", [](const Update& u) { return u.T_map_body.matrix(); }, "4x4")
      .def_property_readonly(
          "position", [](const Update& u) { return u.T_map_body.p; }, "of the body in the map, m")
      .def_property_readonly(
          "quaternion", [](const Update& u) { return Eigen::Vector4d(u.T_map_body.q.coeffs()); },
          "x y z w, map from body")
      .def_property_readonly(
          "velocity", [](const Update& u) { return u.velocity; }, "map frame, m/s")
      .def_property_readonly(
          "angular_rate", [](const Update& u) { return u.angular_rate; }, "body frame, rad/s")
      .def_property_readonly(
          "gyro_bias", [](const Update& u) { return u.gyro_bias; }, "rad/s")
      .def_property_readonly(
          "accel_bias", [](const Update& u) { return u.accel_bias; }, "m/s^2")
      .def_property_readonly(
          "covariance", [](const Update& u) { return u.covariance; },
          "6x6 of (translation in the map, rotation in the body), m^2, rad^2")
      .def_property_readonly(
          "health", [](const Update& u) { return std::string(to_string(u.health)); },
          "waiting, initialising, tracking, degraded, ambiguous or lost")
      .def_readonly("reason", &Update::reason, "of the health, where it changed")
      .def_property_readonly(
          "candidates",
          [](const Update& u) {
            std::vector<Eigen::Matrix4d> out;
            for (const Pose& T : u.candidates) out.push_back(T.matrix());
            return out;
          },
          "while ambiguous: 4x4 values that T_map_body may have, likeliest first")
      .def_readonly("probability", &Update::probability,
                    "that the pose is the right one, not one that happens to agree with events")
      .def_readonly("points", &Update::points, "chosen map points")
      .def_readonly("points_matched", &Update::points_matched, "of these, with events near by");
  py::class_<PyTracker>(
      m, "Tracker",
      "Events, IMU samples and frames in order of time in, poses out; ValueError says what is wrong")
      .def(py::init<const fs::path&, const fs::path&, const Eigen::Matrix4d&, TimeNs, const Eigen::Vector3d&,
                    const fs::path&, const fs::path&, const std::map<std::string, py::object>&>(),
           "map"_a, "calibration"_a, "T_map_body"_a, "t_ns"_a, "velocity"_a = Eigen::Vector3d(0, 0, 0),
           "imu_model"_a = "", "occluders"_a = "", "settings"_a = std::map<std::string, py::object>{},
           "Starts at a pose. settings: keys of evpose track --dump-config, those of a poor start among them "
           "(fusion.start_position_sigma_m)")
      .def("on_update", &PyTracker::on_update, "callback"_a, "called with each Update, in order of time")
      .def("add_events", &PyTracker::add_events, "t_us"_a, "x"_a, "y"_a, "p"_a,
           "int64 microseconds, uint16, uint16, 0 or 1; gives the updates that were made")
      .def("add_imu", &PyTracker::add_imu, "t_ns"_a, "samples"_a,
           "int64 ns of shape (n,); (n, 6): gyro rad/s, accel m/s^2; gives the updates that were made")
      .def("add_frame", &PyTracker::add_frame, "t_ns"_a, "grey"_a, "exposure_ns"_a = 0,
           "int64 ns, middle of the exposure; uint8 of shape (height, width) through the event camera's "
           "pixels, before "
           "the events after it; gives the updates that were made")
      .def("events_complete_until", &PyTracker::events_complete_until, "t_ns"_a,
           "int64 ns: no event before it will come, so that updates up to it, by frames alone, need not wait "
           "for one; "
           "gives the updates that were made")
      .def_property_readonly("has_imu", &PyTracker::has_imu, "the calibration knows where the IMU sits");
  bind_recordings(m);
  bind_maps(m);
  bind_runs(m);
}
