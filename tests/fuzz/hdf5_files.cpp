// SPDX-License-Identifier: BSD-3-Clause
// Whole files of HDF5, by way of the HDF5 library, which opens them by itself and is not built with
// sanitizers.
#include <hdf5.h>

#include <cmath>

#include "evpose/core/error.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/io/maps/map_pages.h"
#include "fuzz.h"

namespace {

/// The library asks for half a megabyte at each opening, and four fifths of the time would go into fresh
/// pages of it: it may keep what it frees.
const herr_t kept = H5set_free_list_limits(64 << 20, 8 << 20, 64 << 20, 8 << 20, 64 << 20, 8 << 20);

}  // namespace

/// Columns, DSEC, Metavision, MVSEC.
EVPOSE_FUZZ_TARGET(hdf5_events) {
  const std::string path = evpose::fuzz::as_real_file(bytes);
  evpose::fuzz::read_all_events(path, "h5");
  evpose::fuzz::read_all_sensors(path, "h5");
}

EVPOSE_FUZZ_TARGET(hdf5_map) {
  const std::string path = evpose::fuzz::as_real_file(bytes);
  if (const auto placed = evpose::read_map_placement(path); placed && placed->origin_llh)
    EVPOSE_CHECK(placed->origin_llh->allFinite());
  const auto map = evpose::read_map_h5(path);
  if (!map) return;
  for (const auto& point : map->points) {
    EVPOSE_CHECK(point.position.allFinite() && point.sigma >= 0 && std::isfinite(point.length));
    EVPOSE_CHECK(point.plane_a >= -1 && point.plane_b >= -1);
  }
  for (const auto& triangle : map->occluders.triangles)
    for (const auto vertex : triangle)
      EVPOSE_CHECK(static_cast<std::size_t>(vertex) < map->occluders.vertices.size());
  const auto pages = evpose::MapPages::open(path);
  if (!pages) return;
  const auto part = pages->around(Eigen::Vector3d::Zero(), 1e6);
  EVPOSE_CHECK(!part || (*part)->points.size() == (*part)->numbers.size());
}
