// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/strip_map.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/error.h"

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

StripMap::StripMap(ImageSize size, double half_length_px, double ambiguity_px)
    : size_(size),
      half_length_(static_cast<float>(half_length_px)),
      ambiguity_(static_cast<float>(ambiguity_px)),
      cells_(static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height)) {}

void StripMap::claim(std::span<const Strip> strips) {
  EVPOSE_CHECK(strips.size() <= kMostStrips);
  call_ += kCallStep;
  if (call_ == 0) {
    std::fill(cells_.begin(), cells_.end(), 0u);
    call_ = kCallStep;
  }
  claimed_.assign(strips.size(), 0);
  for (std::uint32_t i = 0; i < strips.size(); ++i) claim(i, strips);
}

void StripMap::claim(std::uint32_t number, std::span<const Strip> strips) {
  const Strip& s = strips[number];
  neighbour_ = number;
  const float height = std::abs(s.ny) * s.reach + std::abs(s.nx) * half_length_;
  const float top = std::max(0.0F, std::ceil(s.y - height)),
              bottom = std::min(static_cast<float>(size_.height - 1), std::floor(s.y + height));
  const auto last_column = static_cast<float>(size_.width - 1);
  const float by_nx = inverse(s.nx), by_ny = inverse(s.ny);
  const float across = s.reach * std::abs(by_nx), along = half_length_ * std::abs(by_ny);
  for (float y = top; y <= bottom; ++y) {
    // |n.r| <= reach and |t.r| <= half length, solved for x.
    const float ry = y - s.y, middle_n = -s.ny * ry * by_nx, middle_t = s.nx * ry * by_ny;
    const float left = std::max(middle_n - across, middle_t - along),
                right = std::min(middle_n + across, middle_t + along);
    const float first = std::max(0.0F, std::ceil(s.x + left)),
                last = std::min(last_column, std::floor(s.x + right));
    if (!(first <= last)) continue;
    std::uint32_t* cell = cells_.data() +
                          static_cast<std::size_t>(y) * static_cast<std::size_t>(size_.width) +
                          static_cast<std::size_t>(first);
    for (float x = first; x <= last; ++x, ++cell) {
      if (*cell >= call_) {
        contest(*cell, number, x, y, strips);
      } else {
        *cell = call_ | number;
        ++claimed_[number];
      }
    }
  }
}

void StripMap::contest(std::uint32_t& cell, std::uint32_t number, float x, float y,
                       std::span<const Strip> strips) {
  const std::uint32_t other = cell & kStrip;
  const Strip &mine = strips[number], &theirs = strips[other];
  if (neighbour_ != other) {
    neighbour_ = other;
    same_line_ = same_line(theirs, mine);
  }
  const auto move = [&](std::uint32_t to) {
    if (!(cell & kAmbiguous)) --claimed_[other];
    if (!(to & kAmbiguous)) ++claimed_[to & kStrip];
    cell = to;
  };
  const auto distance = [x, y](const Strip& s) { return std::abs(s.nx * (x - s.x) + s.ny * (y - s.y)); };
  if (same_line_) {
    const auto along = [x, y](const Strip& s) { return std::abs(s.nx * (y - s.y) - s.ny * (x - s.x)); };
    if (along(mine) < along(theirs)) move(call_ | (cell & kAmbiguous) | number);
    return;
  }
  const float nearer_by = distance(theirs) - distance(mine);
  if (nearer_by > 0)
    move(call_ | (nearer_by < ambiguity_ ? kAmbiguous : 0u) | number);
  else if (-nearer_by < ambiguity_)
    move(cell | kAmbiguous);
}

}  // namespace evpose
