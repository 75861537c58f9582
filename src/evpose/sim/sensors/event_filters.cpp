// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/event_filters.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/error.h"
#include "evpose/sim/world/random.h"

namespace evpose::sim {
namespace {

constexpr std::uint64_t kStream = 1ULL << 42;

}  // namespace

TrailFilter::TrailFilter(ImageSize size, TrailFilterKind kind, TimeNs longest_gap)
    : width_(static_cast<std::size_t>(size.width)),
      kind_(kind),
      longest_gap_(longest_gap),
      pixels_(width_ * static_cast<std::size_t>(size.height)) {}

bool TrailFilter::keeps(const SimEvent& event) {
  Pixel& p = pixels_[event.y * width_ + event.x];
  const bool follows = p.place > 0 && p.on == event.on && event.t - p.last < longest_gap_;
  p.place = follows ? static_cast<std::uint8_t>(std::min(p.place + 1, 3)) : std::uint8_t{1};
  p.on = event.on;
  p.last = event.t;
  switch (kind_) {
    case TrailFilterKind::first:
      return p.place == 1;
    case TrailFilterKind::second:
      return p.place == 2;
    case TrailFilterKind::all_but_first:
      return p.place >= 2;
    case TrailFilterKind::none:
      break;
  }
  return true;
}

RateController::RateController(double target_mev_s, std::uint64_t seed)
    : most_(static_cast<std::size_t>(std::llround(target_mev_s * 1e-3 * static_cast<double>(kPeriod)))),
      seed_(seed) {
  EVPOSE_CHECK(target_mev_s > 0);
}

void RateController::add(const SimEvent& event, std::vector<SimEvent>& kept) {
  flush(event.t, kept);
  held_.push_back(event);
}

void RateController::flush(TimeNs until, std::vector<SimEvent>& kept) {
  const std::int64_t period = until / kPeriod;
  if (period <= period_) return;
  release(kept);
  period_ = period;
}

void RateController::release(std::vector<SimEvent>& kept) {
  // Each subset of the wanted size is as likely as any other.
  std::size_t wanted = std::min(most_, held_.size()), left = held_.size();
  shed_ += static_cast<std::int64_t>(left - wanted);
  Random random(seed_, kStream + static_cast<std::uint64_t>(period_));
  for (const SimEvent& event : held_) {
    if (wanted == left || random.uniform() * static_cast<double>(left) < static_cast<double>(wanted)) {
      kept.push_back(event);
      --wanted;
    }
    --left;
  }
  held_.clear();
}

}  // namespace evpose::sim
