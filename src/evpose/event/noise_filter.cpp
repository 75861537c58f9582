// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/event/noise_filter.h"

#include <algorithm>
#include <utility>

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

void NoiseFilter::judge_bands(std::uint32_t stamp_us) {
  constexpr std::uint32_t kTurn_us = 1'000'000 / kBands;
  if (next_band_us_ == 0) next_band_us_ = stamp_us + kTurn_us;
  for (int turns = 0; stamp_us >= next_band_us_; ++turns) {
    if (turns == kBands) {  // no events for longer than a second
      next_band_us_ = stamp_us + kTurn_us;
      return;
    }
    end_second_of(next_band_);
    next_band_us_ += kTurn_us;
    if (++next_band_ < kBands) continue;
    next_band_ = 0;
    judging_ = true;
    last_ = std::exchange(now_, {});
  }
}

double NoiseFilter::median_of_active() const {
  std::uint32_t all = 0, below = 0;
  for (std::size_t seen = 1; seen < now_.size(); ++seen) all += last_[seen] + now_[seen];
  for (std::size_t seen = 1; seen < now_.size(); ++seen)
    if ((below += last_[seen] + now_[seen]) > all / 2) return static_cast<double>(seen);
  return 0;
}

/// Masks its hot pixels and counts anew.
void NoiseFilter::end_second_of(int band) {
  const int first = height_ * band / kBands, end = height_ * (band + 1) / kBands;
  const auto for_each_cell = [&](const auto& take) {
    for (int y = first; y < end; ++y)
      for (int x = 0; x < width_; ++x) take(cells_[index(x, y)], x, y);
  };
  if (judging_) {
    for_each_cell([this](const Cell& c, int, int) {
      if (c.unsupported != kMasked) ++now_[std::min<std::size_t>(c.seen, now_.size() - 1)];
    });
    const double limit = std::max(kHotLeastPerSecond, kHotFactor * median_of_active());
    for_each_cell([&](Cell& c, int x, int y) {
      if (c.unsupported == kMasked || c.unsupported < limit) return;
      c = {0, 0, kMasked};  // its past events support nobody
      hot_.push_back({x, y});
    });
  }
  for_each_cell([](Cell& c, int, int) {
    c.seen = 0;
    if (c.unsupported != kMasked) c.unsupported = 0;
  });
}

void NoiseFilter::rebase(std::uint32_t shift_us) {
  for (Cell& c : cells_) c.last = c.last > shift_us ? c.last - shift_us : 0;
  next_band_us_ = next_band_us_ > shift_us ? next_band_us_ - shift_us : 1;
}

}  // namespace evpose
