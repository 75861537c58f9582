// SPDX-License-Identifier: BSD-3-Clause
// Runs as numpy arrays, and making them.
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <cmath>
#include <map>
#include <optional>

#include "evpose/batch/smooth_recording.h"
#include "evpose/calibrate/calibrate_recordings.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/report/csv_table.h"
#include "evpose/report/run_files.h"
#include "evpose/run/track_recording.h"
#include "evpose_files.h"

namespace py = pybind11;
namespace fs = std::filesystem;

namespace evpose {
namespace {

/// (n, size, size) of a matrix for each row.
py::array_t<double> matrices_of(const RunFiles& run, int size, auto&& matrix) {
  py::array_t<double> out({static_cast<py::ssize_t>(run.rows.size()), py::ssize_t{size}, py::ssize_t{size}});
  double* to = out.mutable_data();
  for (const RunRow& row : run.rows) {
    const auto value = matrix(row);
    for (int r = 0; r < size; ++r)
      for (int c = 0; c < size; ++c) *to++ = value(r, c);
  }
  return out;
}

template <class T>
py::array_t<T> column_of(const RunFiles& run, auto&& value) {
  py::array_t<T> out(static_cast<py::ssize_t>(run.rows.size()));
  for (std::size_t i = 0; i < run.rows.size(); ++i) out.mutable_data()[i] = value(run.rows[i]);
  return out;
}

/// The columns of numbers of a file of the run, by name.
std::map<std::string, py::array_t<double>> table_of(const RunFiles& run, const std::string& file) {
  const auto content = read_text_file(run.folder + "/" + file);
  if (!content) throw py::value_error(content.error().line());
  const CsvTable table(*content);
  std::map<std::string, py::array_t<double>> out;
  for (const auto& [name, number] : table.columns) {
    if (name == "health" || name == "reason") continue;
    py::array_t<double> column(static_cast<py::ssize_t>(table.rows.size()));
    for (std::size_t i = 0; i < table.rows.size(); ++i) {
      CsvRow row(table, table.rows[i]);
      const double value = row.number(name);
      column.mutable_data()[i] = row.sound() ? value : NAN;
    }
    out.emplace(std::string(name), column);
  }
  return out;
}

py::object summary_of(const RunFiles& run) {
  const auto content = read_text_file(run.folder + "/summary.json");
  if (!content) throw py::value_error(content.error().line());
  return py::module_::import("json").attr("loads")(*content);
}

using Settings = std::map<std::string, py::object>;

TrackRequest request_of(const fs::path& recording, const fs::path& map, const fs::path& calibration,
                        const fs::path& occluders, const std::string& init,
                        const std::pair<double, double>& init_sigma, const Settings& settings) {
  TrackRequest request;
  request.recording = recording.string();
  request.map = map.string();
  request.calibration = calibration.string();
  request.occluders = occluders.string();
  request.init = init;
  request.init_sigma = {init_sigma.first, init_sigma.second};
  for (const auto& [key, setting] : settings)
    request.assignments.push_back(key + "=" + setting_text(setting));
  return request;
}

/// What `work` makes of the request; other threads of Python run meanwhile, and Ctrl-C ends it.
auto worked(TrackRequest request, auto&& work) {
  request.interrupted = [] {
    const py::gil_scoped_acquire acquire;
    return PyErr_CheckSignals() != 0;
  };
  auto outcome = [&] {
    const py::gil_scoped_release release;
    return work(request);
  }();
  if (PyErr_Occurred() != nullptr) throw py::error_already_set();
  return value_of(std::move(outcome));
}

RunFiles track(const fs::path& recording, const fs::path& output, const fs::path& map,
               const fs::path& calibration, const fs::path& occluders, const std::string& init,
               const std::pair<double, double>& init_sigma, const Settings& settings, bool replace,
               const fs::path& imu_model) {
  TrackRequest request = request_of(recording, map, calibration, occluders, init, init_sigma, settings);
  request.imu_model = imu_model.string();
  request.output = output.string();
  request.replace = replace;
  worked(request, track_recording);
  return value_of(read_run_files(output.string()));
}

RunFiles smooth(const fs::path& recording, const fs::path& output, const fs::path& map,
                const fs::path& calibration, const fs::path& occluders, const std::string& init,
                const std::pair<double, double>& init_sigma, const Settings& settings, bool replace,
                const fs::path& imu_model) {
  TrackRequest request = request_of(recording, map, calibration, occluders, init, init_sigma, settings);
  request.imu_model = imu_model.string();
  request.output = output.string();
  request.replace = replace;
  worked(request, smooth_recording);
  return value_of(read_run_files(output.string()));
}

/// The first update that is `tracking`, or the last one within the time.
Expected<Update> find_pose(const TrackRequest& request, double within_s) {
  const auto config = load_config(request);
  if (!config) return config.error();
  const auto job = prepare(request, *config);
  if (!job) return job.error();
  auto tracker = Tracker::create(job->setup, job->config.tracker, job->start);
  if (!tracker) return tracker.error();
  std::optional<Update> last;
  bool found = false;
  (*tracker)->on_update([&](const Update& u) {
    if (found) return;
    last = u;
    found = u.health == Health::tracking;
  });
  const TimeNs end = job->start.t + from_seconds(within_s);
  const auto go_on = [&](double) {
    return !found && (!last || last->t < end) && !(request.interrupted && request.interrupted());
  };
  if (const auto ok = feed_recording(job->recording, job->config, **tracker, go_on); !ok) return ok.error();
  if (!last)
    return Error{request.recording, "the streams end before the first update",
                 "check that events and IMU cover the start"};
  return *last;
}

Update relocalise(const fs::path& recording, const std::string& init,
                  const std::pair<double, double>& init_sigma, const fs::path& map,
                  const fs::path& calibration, const fs::path& occluders, double within_s,
                  const Settings& settings) {
  if (!(within_s > 0 && within_s < 1e6)) throw py::value_error("within_s: give seconds, more than 0");
  return worked(request_of(recording, map, calibration, occluders, init, init_sigma, settings),
                [&](const TrackRequest& request) { return find_pose(request, within_s); });
}

CalibrateOutcome calibrate(const std::vector<fs::path>& recordings, const fs::path& output,
                           const fs::path& map, const fs::path& calibration, const fs::path& occluders,
                           const std::string& init, const std::pair<double, double>& init_sigma,
                           const Settings& settings, bool replace, const fs::path& imu_model) {
  TrackRequest request = request_of({}, map, calibration, occluders, init, init_sigma, settings);
  request.imu_model = imu_model.string();
  request.output = output.string();
  request.replace = replace;
  const auto outcome = worked(request, [&](const TrackRequest& track) {
    CalibrateRequest asked{{}, track};
    for (const fs::path& recording : recordings) asked.recordings.push_back(recording.string());
    return calibrate_recordings(asked);
  });
  return outcome.value();  // it would be none after an interruption
}

}  // namespace

void bind_runs(py::module_& m) {
  using namespace py::literals;
  py::class_<RunFiles>(m, "Run", "A run folder of evpose track: a row for each update; arrays are copies")
      .def(py::init([](const fs::path& folder) { return value_of(read_run_files(folder.string())); }),
           "folder"_a, "ValueError says what is wrong")
      .def_readonly("folder", &RunFiles::folder, "where it stands")
      .def_property_readonly(
          "t_ns",
          [](const RunFiles& r) {
            return column_of<std::int64_t>(r, [](const RunRow& row) { return row.t; });
          },
          "(n,), data time")
      .def_property_readonly(
          "T_map_body",
          [](const RunFiles& r) {
            return matrices_of(r, 4, [](const RunRow& row) { return row.T_map_body.matrix(); });
          },
          "(n, 4, 4)")
      .def_property_readonly(
          "covariance",
          [](const RunFiles& r) {
            return matrices_of(r, 6, [](const RunRow& row) { return row.covariance; });
          },
          "(n, 6, 6) of (translation in the map, rotation in the body), m^2, rad^2")
      .def_property_readonly(
          "valid",
          [](const RunFiles& r) { return column_of<bool>(r, [](const RunRow& row) { return row.valid(); }); },
          "(n,): the tracker stands by the pose")
      .def_property_readonly(
          "health",
          [](const RunFiles& r) {
            std::vector<std::string> out;
            for (const RunRow& row : r.rows) out.emplace_back(to_string(row.health));
            return out;
          },
          "waiting, initialising, tracking, degraded, ambiguous or lost")
      .def_property_readonly("summary", &summary_of, "what summary.json says")
      .def("table", &table_of, "file"_a = "states.csv",
           "Columns of numbers of states.csv, states_imu.csv, calibration.csv or latency.csv, by name");
  const auto known = std::pair<double, double>(0, 0);
  m.def("track", &track, "recording"_a, "output"_a, "map"_a = "", "calibration"_a = "", "occluders"_a = "",
        "init"_a = "auto", "init_sigma"_a = known, "settings"_a = Settings{}, "replace"_a = false,
        "imu_model"_a = "",
        "What evpose track does, with its options' meaning; a poor start (init_sigma: m, deg) is searched "
        "first");
  m.def("smooth", &smooth, "recording"_a, "output"_a, "map"_a = "", "calibration"_a = "", "occluders"_a = "",
        "init"_a = "auto", "init_sigma"_a = known, "settings"_a = Settings{}, "replace"_a = false,
        "imu_model"_a = "", "What evpose smooth does: the trajectory from all data, past and future");
  py::class_<CalibrationNumber>(m, "CalibrationNumber",
                                "One number of a calibration, with 1-sigma uncertainties")
      .def_readonly("name", &CalibrationNumber::name, "fx, cy, k1, turn x, place z, time, ...")
      .def_readonly("unit", &CalibrationNumber::unit, "px, deg, mm, ms, or empty")
      .def_readonly("given", &CalibrationNumber::given, "where it began")
      .def_readonly("given_sigma", &CalibrationNumber::given_sigma, "how far that was believed")
      .def_readonly("found", &CalibrationNumber::found, "what was found")
      .def_readonly("sigma", &CalibrationNumber::sigma, "and how well it is known");
  py::class_<CalibrateOutcome>(m, "Calibration", "What calibrate() has found")
      .def_property_readonly(
          "numbers", [](const CalibrateOutcome& o) { return o.page.numbers; },
          "those of the file, in the file's order")
      .def_property_readonly(
          "imu_axes", [](const CalibrateOutcome& o) { return o.page.imu_axes; },
          "scale and misalignment of gyroscope and accelerometer, %; empty without an IMU")
      .def_property_readonly(
          "correlation", [](const CalibrateOutcome& o) { return o.page.correlation; },
          "(n, n), of the numbers")
      .def_property_readonly(
          "notes", [](const CalibrateOutcome& o) { return o.page.words; },
          "what the motion told and what it did not")
      .def_readonly("converged", &CalibrateOutcome::converged, "the passes have come to rest")
      .def_readonly("imu_model", &CalibrateOutcome::imu_model, "file of the IMU; empty without one")
      .def_readonly("report", &CalibrateOutcome::report, "its file");
  m.def("calibrate", &calibrate, "recordings"_a, "output"_a, "map"_a = "", "calibration"_a = "",
        "occluders"_a = "", "init"_a = "auto", "init_sigma"_a = known, "settings"_a = Settings{},
        "replace"_a = false, "imu_model"_a = "",
        "What evpose calibrate does: camera, its pose in the body, its clock and the IMU's axes from "
        "recordings before a known map, written as Kalibr's files");
  m.def("relocalise", &relocalise, "recording"_a, "init"_a, "init_sigma"_a, "map"_a = "",
        "calibration"_a = "", "occluders"_a = "", "within_s"_a = 1.0, "settings"_a = Settings{},
        "The pose near a rough one (x,y,z,qx,qy,qz,qw[@t_s]; init_sigma: m and deg per axis) that the events "
        "confirm: "
        "the first update whose health is tracking; without one, the last after within_s seconds of data");
}

}  // namespace evpose
