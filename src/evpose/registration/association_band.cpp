// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/association_band.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "evpose/core/float_lanes.h"

namespace evpose {
namespace {

constexpr float kSameDirectionCos = 0.98F;
constexpr float kSameLine_px = 0.75F;
constexpr float kFarther = 1e6F;

bool same_line(const AssociationBand& a, const AssociationBand& b) {
  return std::abs(a.nx * b.nx + a.ny * b.ny) > kSameDirectionCos &&
         std::abs(a.nx * (b.x - a.x) + a.ny * (b.y - a.y)) < kSameLine_px;
}

using lanes::Floats;
using lanes::Ints;
using lanes::kSide;
constexpr Floats kRamp{0, 1, 2, 3, 4, 5, 6, 7};

float inverse(float v) { return std::abs(v) > 1 / kFarther ? 1 / v : kFarther; }

/// Half so wide along its normal and half so high across it.
struct Rectangle {
  float x, y, nx, ny, wide, high;
};

/// What the band touches during the span, and a little more.
Rectangle swept(const AssociationBand& s, float half_length, float span_us) {
  const float half_us = 0.5F * span_us, middle = -(s.speed - s.curvature * half_us) * half_us;
  const float sway = std::abs(s.speed) * half_us + 3 * std::abs(s.curvature) * half_us * half_us;
  return {s.x + middle * s.nx, s.y + middle * s.ny, s.nx, s.ny, s.reach + sway, half_length};
}

/// Calls take(row, first column, last column) for the cells of `cell_px` that meet the rectangle.
template <class Take>
void for_each_row(const Rectangle& s, int cell_px, int columns, int rows, const Take& take) {
  // In units of cells, whose centres are at whole numbers; a cell is met when its centre is within the
  // rectangle grown by the cell's own extent.
  const float per_cell = 1.0F / static_cast<float>(cell_px);
  const float x0 = s.x * per_cell - 0.5F, y0 = s.y * per_cell - 0.5F;
  const float own = 0.5F * (std::abs(s.nx) + std::abs(s.ny));
  const float wide = s.wide * per_cell + own, high = s.high * per_cell + own;
  const float height = std::abs(s.ny) * wide + std::abs(s.nx) * high;
  const float top = std::max(0.0F, std::ceil(y0 - height)),
              bottom = std::min(static_cast<float>(rows - 1), std::floor(y0 + height));
  const auto last_column = static_cast<float>(columns - 1);
  const float by_nx = inverse(s.nx), by_ny = inverse(s.ny);
  const float across = wide * std::abs(by_nx), along = high * std::abs(by_ny);
  const auto beyond = static_cast<float>(columns);
  for (float y = top; y <= bottom; y += kSide) {
    // |n.r| <= wide and |t.r| <= high, solved for x; eight rows side by side.
    const Floats ry = kRamp + y - y0, middle_n = -s.ny * ry * by_nx, middle_t = s.nx * ry * by_ny;
    const Floats from_n = middle_n - across, from_t = middle_t - along, to_n = middle_n + across,
                 to_t = middle_t + along;
    const Floats from = x0 + (from_n > from_t ? from_n : from_t), to = x0 + (to_n < to_t ? to_n : to_t);
    const Floats low = from < 0 ? Floats{} : from > beyond ? Floats{} + beyond : from;
    const Floats high_end = to < -1 ? Floats{} - 1 : to > last_column ? Floats{} + last_column : to;
    Ints first = __builtin_convertvector(low, Ints), last = __builtin_convertvector(high_end, Ints);
    first -= __builtin_convertvector(first, Floats) < low;     // up to the next whole number
    last += __builtin_convertvector(last, Floats) > high_end;  // and down
    const int count = std::min(static_cast<int>(kSide), static_cast<int>(bottom - y) + 1);
    for (int l = 0; l < count; ++l)
      if (first[l] <= last[l]) take(static_cast<int>(y) + l, first[l], last[l]);
  }
}

}  // namespace

AssociationIndex::AssociationIndex(ImageSize size, double half_length_px, double ambiguity_px)
    : columns_((size.width + kCell_px - 1) / kCell_px),
      rows_((size.height + kCell_px - 1) / kCell_px),
      half_length_(static_cast<float>(half_length_px)),
      ambiguity_(static_cast<float>(ambiguity_px)),
      heads_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_)) {}

void AssociationIndex::build(std::span<const AssociationBand> bands, float span_us) {
  bands_.assign(bands.begin(), bands.end());
  bands_.push_back({0, 0, 0, 0, 0, 0, -1});
  entries_.assign(1, {static_cast<std::int32_t>(bands.size()), 0});
  std::fill(heads_.begin(), heads_.end(), 0);
  span_us_ = span_us;
  for (std::size_t i = 0; i < bands.size(); ++i) enter(static_cast<std::int32_t>(i));
}

/// Into every cell that the band touches during the span.
void AssociationIndex::enter(std::int32_t number) {
  const AssociationBand& band = bands_[static_cast<std::size_t>(number)];
  for_each_row(swept(band, half_length_, span_us_), kCell_px, columns_, rows_,
               [&](int row, int first, int last) {
                 for (int column = first; column <= last; ++column) {
                   std::int32_t& head = heads_[static_cast<std::size_t>(row * columns_ + column)];
                   entries_.push_back({number, head});
                   head = static_cast<std::int32_t>(entries_.size() - 1);
                 }
               });
}

void AssociationIndex::mark(std::span<const std::uint8_t> asked, float margin_px, float aside_px,
                            InterestMap* interest) const {
  for (std::size_t i = 0; i + 1 < bands_.size(); ++i) {
    if (asked[i] == 0) continue;
    Rectangle area = swept(bands_[i], half_length_, span_us_);
    area.wide += margin_px + aside_px;
    area.high += margin_px;
    for_each_row(area, InterestMap::kCell_px, interest->columns(), interest->rows(),
                 [&](int row, int first, int last) { interest->mark(row, first, last); });
  }
}

AssociationIndex::Owner AssociationIndex::find(float x, float y, float age_us) const {
  Owner nearest;
  Hit hits[kMostHits];
  int n = 0;
  for (std::int32_t k = heads_[cell_of(x, y)]; k > 0; k = entries_[static_cast<std::size_t>(k)].next) {
    const std::int32_t number = entries_[static_cast<std::size_t>(k)].band;
    const AssociationBand& s = bands_[static_cast<std::size_t>(number)];
    const float dx = x - s.x, dy = y - s.y, along = std::abs(s.nx * dy - s.ny * dx);
    const float d = s.nx * dx + s.ny * dy + (s.speed - s.curvature * age_us) * age_us;
    if (along > half_length_ || std::abs(d) > s.reach) continue;
    if (n == kMostHits) return {};
    if (n == 0 || std::abs(d) < std::abs(nearest.distance)) nearest = {number, d};
    hits[n++] = {number, d, along};
  }
  return n < 2 ? nearest : resolve(nearest, {hits, static_cast<std::size_t>(n)});
}

void AssociationIndex::find_all(std::span<const FilteredEvent> events, std::size_t first,
                                std::uint32_t now_us, std::vector<Found>* found) {
  // Most events are far from any contour: written in any case and kept by counting, as a branch would be
  // guessed wrong.
  close_.resize(events.size() - first);
  std::size_t count = 0;
  for (std::size_t k = first; k < events.size(); ++k) {
    close_[count] = static_cast<std::uint32_t>(k);
    count += heads_[cell_of(events[k].x, events[k].y)] > 0;
  }
  for (std::size_t begin = 0; begin < count; begin += kSide)
    find_eight(events, {&close_[begin], std::min(kSide, count - begin)}, now_us, found);
}

void AssociationIndex::find_eight(std::span<const FilteredEvent> events, std::span<const std::uint32_t> which,
                                  std::uint32_t now_us, std::vector<Found>* found) const {
  std::array<std::size_t, kSide> entry{};
  Floats x{}, y{}, age{};
  for (std::size_t l = 0; l < which.size(); ++l) {
    const FilteredEvent& e = events[which[l]];
    x[l] = e.x, y[l] = e.y, age[l] = static_cast<float>(now_us - e.stamp_us);
    entry[l] = static_cast<std::size_t>(heads_[cell_of(e.x, e.y)]);
  }
  Floats least = Floats{} + kFarther, distance{};
  Ints owner = Ints{} - 1, hits{};
  for (std::size_t going = 1; going > 0;) {
    std::array<const AssociationBand*, kSide> band;
    Ints number;
    going = 0;
    for (std::size_t l = 0; l < kSide; ++l) {
      const Entry& e = entries_[entry[l]];
      number[l] = e.band;
      band[l] = &bands_[static_cast<std::size_t>(e.band)];
      going |= entry[l] = static_cast<std::size_t>(e.next);
    }
    const auto all = [&](float AssociationBand::*m) {
      return Floats{band[0]->*m, band[1]->*m, band[2]->*m, band[3]->*m,
                    band[4]->*m, band[5]->*m, band[6]->*m, band[7]->*m};
    };
    const Floats dx = x - all(&AssociationBand::x), dy = y - all(&AssociationBand::y),
                 nx = all(&AssociationBand::nx), ny = all(&AssociationBand::ny);
    const Floats t = nx * dy - ny * dx, along = t < 0 ? -t : t;
    const Floats d =
        nx * dx + ny * dy + (all(&AssociationBand::speed) - all(&AssociationBand::curvature) * age) * age;
    const Floats across = d < 0 ? -d : d;
    const Ints hit = (along <= half_length_) & (across <= all(&AssociationBand::reach));
    const Ints nearer = hit & (across < least);
    least = nearer ? across : least;
    distance = nearer ? d : distance;
    owner = nearer ? number : owner;
    hits -= hit;
  }
  for (std::size_t l = 0; l < which.size(); ++l) {
    if (hits[l] == 0) continue;
    const Owner one = hits[l] == 1 ? Owner{owner[l], distance[l]} : find(x[l], y[l], age[l]);
    if (one.band >= 0) found->push_back({which[l], one});
  }
}

AssociationIndex::Owner AssociationIndex::resolve(const Owner& nearest, std::span<const Hit> hits) const {
  const AssociationBand& line = bands_[static_cast<std::size_t>(nearest.band)];
  Owner owner = nearest;
  float least = kFarther;
  for (const Hit& h : hits) {
    if (h.band == nearest.band || same_line(line, bands_[static_cast<std::size_t>(h.band)])) {
      if (h.along < least) least = h.along, owner = {h.band, h.distance};
    } else if (std::abs(h.distance) - std::abs(nearest.distance) < ambiguity_) {
      return {};
    }
  }
  return owner;
}

}  // namespace evpose
