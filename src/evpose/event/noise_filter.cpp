// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/event/noise_filter.h"

#include <algorithm>

#include "evpose/core/config.h"
#include "evpose/event/time_surface.h"

namespace evpose {
namespace {

constexpr double kHotFactor = 20;          // times the median of active pixels: a pixel that fires by itself
constexpr double kHotLeastPerSecond = 20;  // unsupported events of a hot pixel: below it does no harm

}  // namespace

void describe(ConfigTable& table, NoiseFilterConfig& c) {
  table.add("on", c.on, "drop events without a recent event among their 8 neighbours (EV-Pose 4.1)");
  table.add("support_px", c.support_px, "px", "a neighbour's event supports for this much predicted motion",
            {0.01, 100});
  table.add("support_min_s", c.support_min_s, "s", "shortest support window", {1e-5, 10});
  table.add("support_max_s", c.support_max_s, "s", "longest support window", {1e-5, 10});
}

NoiseFilter::NoiseFilter(int width, int height, const NoiseFilterConfig& config)
    : config_(config), width_(width), height_(height), stride_(static_cast<std::size_t>(width + 2)) {
  cells_.resize(stride_ * static_cast<std::size_t>(height + 2));
  set_motion(0);
}

void NoiseFilter::set_motion(double flow_px_per_s) {
  const double longest = std::max(config_.support_min_s, config_.support_max_s);
  const double s = flow_px_per_s > 0 ? config_.support_px / flow_px_per_s : longest;
  support_us_ = static_cast<std::uint32_t>(std::clamp(s, config_.support_min_s, longest) * 1e6);
}

void NoiseFilter::end_second(std::uint32_t stamp_us) {
  if (second_end_us_ != 0) {
    std::vector<std::uint16_t> active;
    for (const Cell& c : cells_)
      if (c.seen > 0 && c.unsupported != kMasked) active.push_back(c.seen);
    if (!active.empty()) {
      const auto middle = active.begin() + static_cast<std::ptrdiff_t>(active.size() / 2);
      std::nth_element(active.begin(), middle, active.end());
      const double limit = std::max(kHotLeastPerSecond, kHotFactor * *middle);
      for (int y = 0; y < height_; ++y)
        for (int x = 0; x < width_; ++x) {
          Cell& c = cells_[index(x, y)];
          if (c.unsupported == kMasked || c.unsupported < limit) continue;
          c = {0, 0, kMasked};  // its past events support nobody
          hot_.push_back({x, y});
        }
    }
  }
  for (Cell& c : cells_) {
    c.seen = 0;
    if (c.unsupported != kMasked) c.unsupported = 0;
  }
  second_end_us_ = stamp_us + 1'000'000;
}

void NoiseFilter::rebase(std::uint32_t shift_us) {
  for (Cell& c : cells_) c.last = c.last > shift_us ? c.last - shift_us : 0;
  second_end_us_ = second_end_us_ > shift_us ? second_end_us_ - shift_us : 1;
}

}  // namespace evpose
