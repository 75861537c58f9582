// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/event/time_surface.h"

#include "evpose/core/error.h"

namespace evpose {

void rebase_stamps(std::vector<std::uint32_t>& stamps, std::uint32_t shift) {
  for (auto& s : stamps) s = s > shift ? s - shift : 0;
}

TimeSurface::TimeSurface(int width, int height)
    : width_(width), height_(height), stride_(static_cast<std::size_t>(width + 2 * kBorder)) {
  EVPOSE_CHECK(width > 0 && height > 0);
  for (auto& plane : last_) plane.resize(stride_ * static_cast<std::size_t>(height + 2 * kBorder));
}

void TimeSurface::rebase(std::uint32_t shift_us) {
  for (auto& plane : last_)
    for (std::uint32_t& stamp : plane) stamp = stamp > shift_us ? stamp - shift_us : 0;
}

}  // namespace evpose
