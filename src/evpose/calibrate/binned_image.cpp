// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/binned_image.h"

namespace evpose {

CameraIntrinsics binned(CameraIntrinsics camera, int binning) {
  for (double* f : {&camera.fx, &camera.fy}) *f /= binning;
  for (double* c : {&camera.cx, &camera.cy}) *c = (*c + 0.5) / binning - 0.5;
  for (int* n : {&camera.size.width, &camera.size.height}) *n = (*n + binning - 1) / binning;
  return camera;
}

std::vector<FilteredEvent> binned(std::span<const FilteredEvent> events, int binning) {
  constexpr unsigned kRowBits = 0x7FFF;
  std::vector<FilteredEvent> out(events.begin(), events.end());
  for (FilteredEvent& e : out) {
    e.x = static_cast<std::uint16_t>(e.x / binning);
    e.y = static_cast<std::uint16_t>(e.y / binning) & kRowBits;
  }
  return out;
}

}  // namespace evpose
