// SPDX-License-Identifier: BSD-3-Clause
// Clouds of surfaces and of contour points. Map files are left out: what the HDF5 library does with a damaged
// file is not ours.
#include <cmath>

#include "evpose/core/error.h"
#include "evpose/io/maps/cloud_files.h"
#include "evpose/io/maps/contour_files.h"
#include "fuzz.h"

EVPOSE_FUZZ_TARGET(clouds) {
  if (!bytes.empty() && bytes[0] == 0x89) return;
  const std::string path = evpose::fuzz::as_file(bytes);
  if (const auto cloud = evpose::read_cloud(path)) {
    EVPOSE_CHECK(!cloud->points.empty() && cloud->anchor.allFinite());
    EVPOSE_CHECK(cloud->brightness.empty() || cloud->brightness.size() == cloud->points.size());
    for (const auto& point : cloud->points) EVPOSE_CHECK(point.allFinite());
  }
  const auto map = evpose::read_contour_map(path);
  if (!map) return;
  EVPOSE_CHECK(!map->points.empty());
  for (const auto& point : map->points) {
    EVPOSE_CHECK(point.position.allFinite() && std::abs(point.tangent.norm() - 1) < 1e-3);
    const float across = point.normal.norm();
    EVPOSE_CHECK(across == 0 ||
                 (std::abs(across - 1) < 1e-3 && std::abs(point.normal.dot(point.tangent)) < 1e-2));
    EVPOSE_CHECK(point.length >= 0 && point.sigma >= 0);
  }
}
