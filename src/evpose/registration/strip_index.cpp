// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/strip_index.h"

#include <algorithm>

namespace evpose {
namespace {

constexpr float kSameDirectionCos = 0.98F;
constexpr float kSameLine_px = 0.75F;
constexpr float kFarther = 1e6F;

bool same_line(const Strip& a, const Strip& b) {
  return std::abs(a.nx * b.nx + a.ny * b.ny) > kSameDirectionCos &&
         std::abs(a.nx * (b.x - a.x) + a.ny * (b.y - a.y)) < kSameLine_px;
}

float inverse(float v) { return std::abs(v) > 1 / kFarther ? 1 / v : kFarther; }

}  // namespace

StripIndex::StripIndex(ImageSize size, double half_length_px, double ambiguity_px)
    : columns_((size.width + kCell_px - 1) / kCell_px),
      rows_((size.height + kCell_px - 1) / kCell_px),
      half_length_(static_cast<float>(half_length_px)),
      ambiguity_(static_cast<float>(ambiguity_px)),
      heads_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), -1) {}

void StripIndex::build(std::span<const Strip> strips, float span_us) {
  strips_.assign(strips.begin(), strips.end());
  entries_.clear();
  std::fill(heads_.begin(), heads_.end(), -1);
  for (std::size_t i = 0; i < strips.size(); ++i) enter(static_cast<std::int32_t>(i), span_us);
}

/// Into every cell that the strip touches during the span.
void StripIndex::enter(std::int32_t number, float span_us) {
  const Strip& s = strips_[static_cast<std::size_t>(number)];
  const float half_us = 0.5F * span_us, middle = -(s.speed - s.curvature * half_us) * half_us;
  // In units of cells, whose centres are at whole numbers; a cell is met when its centre is within the
  // rectangle grown by the cell's own extent.
  constexpr float kPerCell = 1.0F / kCell_px;
  const float x0 = (s.x + middle * s.nx) * kPerCell - 0.5F, y0 = (s.y + middle * s.ny) * kPerCell - 0.5F;
  const float own = 0.5F * (std::abs(s.nx) + std::abs(s.ny));
  const float sway = std::abs(s.speed) * half_us + 3 * std::abs(s.curvature) * half_us * half_us;
  const float wide = (s.reach + sway) * kPerCell + own, high = half_length_ * kPerCell + own;
  const float height = std::abs(s.ny) * wide + std::abs(s.nx) * high;
  const float top = std::max(0.0F, std::ceil(y0 - height)),
              bottom = std::min(static_cast<float>(rows_ - 1), std::floor(y0 + height));
  const auto last_column = static_cast<float>(columns_ - 1);
  const float by_nx = inverse(s.nx), by_ny = inverse(s.ny);
  const float across = wide * std::abs(by_nx), along = high * std::abs(by_ny);
  for (float y = top; y <= bottom; ++y) {
    // |n.r| <= wide and |t.r| <= high, solved for x.
    const float ry = y - y0, middle_n = -s.ny * ry * by_nx, middle_t = s.nx * ry * by_ny;
    const float first = std::max(0.0F, std::ceil(x0 + std::max(middle_n - across, middle_t - along)));
    const float last = std::min(last_column, std::floor(x0 + std::min(middle_n + across, middle_t + along)));
    for (float x = first; x <= last; ++x) {
      std::int32_t& head =
          heads_[static_cast<std::size_t>(static_cast<int>(y) * columns_ + static_cast<int>(x))];
      entries_.push_back({number, head});
      head = static_cast<std::int32_t>(entries_.size() - 1);
    }
  }
}

StripIndex::Owner StripIndex::settle(const Owner& nearest, std::span<const Hit> hits) const {
  const Strip& line = strips_[static_cast<std::size_t>(nearest.strip)];
  Owner owner = nearest;
  float least = kFarther;
  for (const Hit& h : hits) {
    if (h.strip == nearest.strip || same_line(line, strips_[static_cast<std::size_t>(h.strip)])) {
      if (h.along < least) least = h.along, owner = {h.strip, h.distance};
    } else if (std::abs(h.distance) - std::abs(nearest.distance) < ambiguity_) {
      return {};
    }
  }
  return owner;
}

}  // namespace evpose
