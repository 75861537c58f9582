// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>

#include "evpose/map_build/map_builder.h"

namespace evpose::map_build {

/// The map as EV-Pose's section on its construction makes it, without what build_map() adds: normals and
/// curvatures by principal components of a fixed number of neighbours; regions grown from the flattest points
/// on, over neighbours whose normals agree; a plane through each region; boundary tracking around it to
/// closed contours. Contours are the traced lines themselves: nothing is fitted to the edges, creases appear
/// as the outlines of both faces, no line is told from a shadow's, and signs of contrast are not known. The
/// whole cloud at once; the same for any number of threads. `progress` and errors as of build_map().
Expected<BuiltMap> build_paper_map(PointCloud cloud, ThreadPool& pool,
                                   const std::function<bool(double)>& progress);

}  // namespace evpose::map_build
