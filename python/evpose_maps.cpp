// SPDX-License-Identifier: BSD-3-Clause
// Maps as numpy arrays, and building them.
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <map>

#include "evpose/core/parallel.h"
#include "evpose/io/files/config_yaml.h"
#include "evpose/io/maps/cloud_files.h"
#include "evpose/io/maps/contour_files.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/io/maps/ply.h"
#include "evpose/map_build/map_builder.h"
#include "evpose_files.h"

namespace py = pybind11;
namespace fs = std::filesystem;

namespace evpose {
namespace {

using Rows = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// A row for each point.
Rows rows_of(const ContourMap& map, auto&& vector) {
  Rows out(static_cast<Eigen::Index>(map.points.size()), 3);
  for (std::size_t i = 0; i < map.points.size(); ++i) out.row(static_cast<Eigen::Index>(i)) = vector(i);
  return out;
}

/// A number for each point.
template <class T>
py::array_t<T> column_of(const ContourMap& map, auto&& number) {
  py::array_t<T> out(static_cast<py::ssize_t>(map.points.size()));
  for (std::size_t i = 0; i < map.points.size(); ++i) out.mutable_data()[i] = number(map.points[i]);
  return out;
}

py::array_t<double> occluders_of(const ContourMap& map) {
  const auto& mesh = map.occluders;
  py::array_t<double> out({static_cast<py::ssize_t>(mesh.triangles.size()), py::ssize_t{3}, py::ssize_t{3}});
  double* to = out.mutable_data();
  for (const auto& triangle : mesh.triangles)
    for (const std::uint32_t corner : triangle) {
      const Eigen::Vector3d p = map.anchor + mesh.vertices[corner].cast<double>();
      to = std::copy(p.data(), p.data() + 3, to);
    }
  return out;
}

ContourMap read_map(const fs::path& path, const fs::path& occluders) {
  ContourMap map = value_of(read_contour_map(path.string()));
  if (!occluders.empty()) map.occluders = value_of(read_ply_mesh(occluders.string(), map.anchor));
  return map;
}

ContourMap build_map(const fs::path& cloud_path, const fs::path& output,
                     const std::map<std::string, py::object>& settings, int threads) {
  map_build::BuildConfig config;
  ConfigTable table;
  describe(table, config);
  for (const auto& [key, setting] : settings)
    if (const auto ok = table.set(key, setting_text(setting), "settings"); !ok)
      throw py::value_error(ok.error().line());
  if (threads < 1) throw py::value_error("threads: give 1 or more");
  PointCloud cloud = value_of(read_cloud(cloud_path.string()));
  ThreadPool pool(threads);
  auto built = [&] {
    const py::gil_scoped_release release;
    return map_build::build_map(std::move(cloud), config, pool, [](double) {
      const py::gil_scoped_acquire acquire;
      return PyErr_CheckSignals() == 0;
    });
  }();
  if (PyErr_Occurred() != nullptr) throw py::error_already_set();
  ContourMap map = value_of(std::move(built)).map;
  if (const auto ok = write_map_h5(output.string(), map); !ok) throw py::value_error(ok.error().line());
  map.source = output.string();
  return map;
}

}  // namespace

void bind_maps(py::module_& m) {
  using namespace py::literals;
  py::class_<ContourMap>(m, "Map",
                         "The prior map: points along contours, in the map's frame; arrays are copies")
      .def(py::init(&read_map), "path"_a, "occluders"_a = "",
           "map.h5, contours as PLY or PCD; a PLY mesh that hides")
      .def_property_readonly(
          "points",
          [](const ContourMap& c) { return rows_of(c, [&](std::size_t i) { return c.position(i); }); },
          "(n, 3), m")
      .def_property_readonly(
          "tangents",
          [](const ContourMap& c) {
            return rows_of(c, [&](std::size_t i) { return c.points[i].tangent.cast<double>(); });
          },
          "(n, 3), unit, along the contour")
      .def_property_readonly(
          "sigma",
          [](const ContourMap& c) {
            return column_of<double>(c, [](const ContourPoint& p) { return static_cast<double>(p.sigma); });
          },
          "of each point across its contour, m")
      .def_property_readonly(
          "length",
          [](const ContourMap& c) {
            return column_of<double>(c, [](const ContourPoint& p) { return static_cast<double>(p.length); });
          },
          "of contour that each point stands for, m")
      .def_property_readonly(
          "contour",
          [](const ContourMap& c) {
            return column_of<std::int32_t>(c, [](const ContourPoint& p) { return p.contour; });
          },
          "number of each point's contour; -1: none")
      .def_property_readonly(
          "kind",
          [](const ContourMap& c) {
            std::vector<std::string> out;
            for (const ContourPoint& p : c.points)
              out.emplace_back(kContourKindNames[static_cast<std::size_t>(p.kind)]);
            return out;
          },
          "of each point: unknown, crease, boundary, marking, cylinder_axis or shadow")
      .def_property_readonly("occluders", &occluders_of, "(n, 3, 3): corners of triangles, m")
      .def_readonly("frame", &ContourMap::frame, "name of the map's frame")
      .def_readonly("source", &ContourMap::source, "file");
  m.def("build_map", &build_map, "cloud"_a, "output"_a, "settings"_a = std::map<std::string, py::object>{},
        "threads"_a = 1,
        "Contours from a point cloud (PLY, PCD, LAS), written as map.h5. settings: keys of evpose map build "
        "--set");
}

}  // namespace evpose
