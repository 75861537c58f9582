// SPDX-License-Identifier: BSD-3-Clause
// Recordings as numpy arrays.
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <limits>

#include "evpose/io/recording/recording.h"
#include "evpose_files.h"

namespace py = pybind11;
namespace fs = std::filesystem;

namespace evpose {
namespace {

template <class T>
using Array = py::array_t<T, py::array::c_style>;

template <class T>
Array<T> array_of(const std::vector<T>& values, std::vector<py::ssize_t> shape = {}) {
  if (shape.empty()) shape = {static_cast<py::ssize_t>(values.size())};
  Array<T> out(shape);
  std::copy(values.begin(), values.end(), out.mutable_data());
  return out;
}

using EventArrays =
    std::tuple<Array<std::int64_t>, Array<std::uint16_t>, Array<std::uint16_t>, Array<std::uint8_t>>;

EventArrays events_of(Recording recording, double start_s, double duration_s) {
  std::vector<std::int64_t> t;
  std::vector<std::uint16_t> x, y;
  std::vector<std::uint8_t> p;
  {
    const py::gil_scoped_release release;
    const TimeNs from = recording.first_ns + from_seconds(start_s);
    const TimeNs to = duration_s < to_seconds(recording.last_ns - from) ? from + from_seconds(duration_s)
                                                                        : std::numeric_limits<TimeNs>::max();
    auto reader = open_events(recording);
    EventPacket packet;
    Expected<bool> more = reader ? Expected<bool>(true) : Expected<bool>(reader.error());
    while (reader && (more = (*reader)->next(packet)) && *more && packet.base < to)
      for (const Event& e : packet.events) {
        const TimeNs at = packet.time(e);
        if (at < from || at >= to) continue;
        t.push_back(at / kNsPerUs), x.push_back(e.x), y.push_back(e.y), p.push_back(e.on);
      }
    if (!more) {
      const py::gil_scoped_acquire acquire;
      throw py::value_error(more.error().line());
    }
  }
  return {array_of(t), array_of(x), array_of(y), array_of(p)};
}

std::tuple<Array<std::int64_t>, Array<double>> imu_of(const Recording& recording) {
  if (!recording.has_imu) throw py::value_error(recording.folder + ": has no IMU");
  auto reader = value_of(open_imu(recording));
  std::vector<std::int64_t> t;
  std::vector<double> rows;
  ImuSample sample;
  while (value_of(reader.next(sample))) {
    t.push_back(sample.t);
    for (int k = 0; k < 3; ++k) rows.push_back(sample.gyro[k]);
    for (int k = 0; k < 3; ++k) rows.push_back(sample.accel[k]);
  }
  return {array_of(t), array_of(rows, {static_cast<py::ssize_t>(t.size()), 6})};
}

std::tuple<Array<std::int64_t>, Array<double>> truth_of(const Recording& recording) {
  const auto poses = value_of(read_groundtruth(recording));
  std::vector<std::int64_t> t;
  Array<double> T({static_cast<py::ssize_t>(poses.size()), py::ssize_t{4}, py::ssize_t{4}});
  auto out = T.mutable_unchecked<3>();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    t.push_back(poses[i].t);
    const Eigen::Matrix4d matrix = poses[i].pose.matrix();
    for (int r = 0; r < 4; ++r)
      for (int c = 0; c < 4; ++c) out(static_cast<py::ssize_t>(i), r, c) = matrix(r, c);
  }
  return {array_of(t), T};
}

}  // namespace

void bind_recordings(py::module_& m) {
  using namespace py::literals;
  py::class_<Recording>(
      m, "Recording",
      "A recording folder, a sequence as downloaded, or a file of events; all on the IMU's clock")
      .def(py::init([](const fs::path& path, const fs::path& calibration) {
             return value_of(open_recording(path.string(), calibration.string()));
           }),
           "path"_a, "calibration"_a = "", "Reads and checks the small files; ValueError says what is wrong")
      .def_readonly("name", &Recording::name, "as in recording.yaml, or of the folder")
      .def_readonly("folder", &Recording::folder, "or file")
      .def_readonly("has_imu", &Recording::has_imu, "there are IMU samples")
      .def_readonly("first_ns", &Recording::first_ns, "begin of what events and IMU have in common")
      .def_readonly("last_ns", &Recording::last_ns, "its end")
      .def_readonly("calibration", &Recording::calibration_path, "file; empty: none")
      .def_readonly("imu_model", &Recording::imu_model_path, "file; empty: none")
      .def_property_readonly(
          "width", [](const Recording& r) { return r.camera.size.width; }, "px")
      .def_property_readonly(
          "height", [](const Recording& r) { return r.camera.size.height; }, "px")
      .def_property_readonly(
          "T_cam_body", [](const Recording& r) { return r.T_cam_body.matrix(); }, "4x4")
      .def_property_readonly(
          "map", [](const Recording& r) { return r.map_path.empty() ? r.contours_path : r.map_path; },
          "file of its own; empty: none")
      .def("events", &events_of, "start_s"_a = 0.0, "duration_s"_a = std::numeric_limits<double>::infinity(),
           "Arrays t (us), x, y, p (0 or 1), of a part if asked; in the order that Tracker.add_events takes "
           "them")
      .def("imu", &imu_of,
           "Arrays t (ns) and (n, 6): gyro rad/s, accel m/s^2; in the order that Tracker.add_imu takes them")
      .def("groundtruth", &truth_of, "Arrays t (ns) and T_map_body (n, 4, 4)");
}

}  // namespace evpose
