// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/recording/event_survey.h"

#include <algorithm>

namespace evpose {
namespace {

constexpr TimeNs kShortestGap = 20 * kNsPerMs;
constexpr double kGapInMeanDistances = 100;
constexpr std::size_t kMostSilences = 1000;
constexpr TimeNs kHundredth = EventSummary::kHundredth;
constexpr std::size_t kMostHundredths = 1u << 24;  // two days
constexpr std::size_t kBins = 60;
constexpr std::int64_t kHotLeast = 50, kHotTimesMedian = 30, kHotTimesNeighbour = 10;
constexpr std::size_t kHotListed = 100;
constexpr double kBurstTimesUsual = 10;

bool longer(const EventGap& a, const EventGap& b) { return a.end - a.begin > b.end - b.begin; }

template <class T>
T median(std::vector<T> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

void EventSurvey::count_pixel(int x, int y) {
  if (x >= width_ || y >= height_) {
    const int width = std::max(width_, (x / 64 + 1) * 64), height = std::max(height_, (y / 64 + 1) * 64);
    std::vector<std::uint32_t> grown(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    for (int row = 0; row < height_; ++row)
      std::copy_n(pixels_.begin() + static_cast<std::ptrdiff_t>(row) * width_, width_,
                  grown.begin() + static_cast<std::ptrdiff_t>(row) * width);
    pixels_ = std::move(grown);
    width_ = width, height_ = height;
  }
  ++pixels_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x)];
}

std::int64_t EventSurvey::pixel(int x, int y) const {
  if (x < 0 || y < 0 || x >= width_ || y >= height_) return 0;
  return pixels_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
                 static_cast<std::size_t>(x)];
}

void EventSurvey::add(const EventPacket& packet) {
  for (const Event& e : packet.events) {
    const TimeNs t = packet.time(e);
    if (sums_.count == 0) sums_.first = sums_.last = t;
    if (t - sums_.last > kShortestGap) {
      silences_.push_back({sums_.last, t});
      if (silences_.size() >= 2 * kMostSilences) {
        std::nth_element(silences_.begin(), silences_.begin() + kMostSilences, silences_.end(), longer);
        silences_.resize(kMostSilences);
      }
    }
    at_once_ = t == sums_.last ? at_once_ + 1 : 1;
    sums_.most_at_once = std::max(sums_.most_at_once, at_once_);
    sums_.last = t;
    ++sums_.count;
    sums_.on += e.on;
    sums_.widest_x = std::max(sums_.widest_x, static_cast<int>(e.x));
    sums_.highest_y = std::max(sums_.highest_y, static_cast<int>(e.y));
    count_pixel(e.x, e.y);
    const auto part = static_cast<std::size_t>((t - sums_.first) / kHundredth);
    if (part >= kMostHundredths) continue;
    if (part >= hundredths_.size()) hundredths_.resize(part + 1);
    ++hundredths_[part];
  }
}

void EventSurvey::find_hot(EventSummary& out) const {
  std::vector<std::uint32_t> active;
  for (const std::uint32_t n : pixels_)
    if (n > 0) active.push_back(n);
  out.active_pixels = static_cast<std::int64_t>(active.size());
  const std::int64_t least = std::max(kHotLeast, kHotTimesMedian * median(std::move(active)));
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      const std::int64_t n = pixel(x, y);
      if (n <= least) continue;
      std::int64_t loudest = 0;
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx)
          if (dx != 0 || dy != 0) loudest = std::max(loudest, pixel(x + dx, y + dy));
      if (n <= kHotTimesNeighbour * loudest) continue;
      out.hot.push_back({x, y, n});
      out.hot_events += n;
    }
  }
  out.hot_count = static_cast<std::int64_t>(out.hot.size());
  std::stable_sort(out.hot.begin(), out.hot.end(),
                   [](const PixelCount& a, const PixelCount& b) { return a.count > b.count; });
  out.hot.resize(std::min(out.hot.size(), kHotListed));
}

void EventSurvey::find_bursts(EventSummary& out) const {
  std::vector<std::uint32_t> busy;
  for (const std::uint32_t n : hundredths_)
    if (n > 0) busy.push_back(n);
  const double usual = static_cast<double>(median(std::move(busy)));
  std::size_t loudest = 0;
  for (std::size_t i = 0; i < hundredths_.size(); ++i) {
    if (hundredths_[i] > hundredths_[loudest]) loudest = i;
    if (static_cast<double>(hundredths_[i]) > kBurstTimesUsual * usual) ++out.bursts;
  }
  const double per_s = 1 / to_seconds(kHundredth);
  out.usual_rate = per_s * usual;
  out.loudest_at = out.first + static_cast<TimeNs>(loudest) * kHundredth;
  if (!hundredths_.empty()) out.loudest_rate = per_s * static_cast<double>(hundredths_[loudest]);
}

EventSummary EventSurvey::finish() const {
  EventSummary out = sums_;
  if (out.count == 0) return out;
  out.hundredths = hundredths_;
  find_hot(out);
  find_bursts(out);
  const double mean_distance = static_cast<double>(out.last - out.first) / static_cast<double>(out.count);
  for (const EventGap& gap : silences_)
    if (static_cast<double>(gap.end - gap.begin) > kGapInMeanDistances * mean_distance)
      out.gaps.push_back(gap);
  out.gap_count = static_cast<std::int64_t>(out.gaps.size());
  std::stable_sort(out.gaps.begin(), out.gaps.end(), longer);
  out.gaps.resize(std::min<std::size_t>(out.gaps.size(), 10));
  const std::size_t parts = hundredths_.size(), each = (parts + kBins - 1) / kBins;
  out.bins.resize((parts + each - 1) / each);
  for (std::size_t i = 0; i < parts; ++i) out.bins[i / each] += hundredths_[i];
  out.bin_ns = kHundredth * static_cast<TimeNs>(each);
  return out;
}

}  // namespace evpose
