// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/space_sweep.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "evpose/map_learn/line_detector.h"

namespace evpose::map_learn {
namespace {

constexpr double kShortest_cells = 7, kLongest_cells = 40;
constexpr double kApart_cells = 3;
constexpr int kBeside_slices = 4;     // where an edge's rays have parted
constexpr double kPartedShare = 0.6;  // of the counts at the edge, that may be left there
constexpr double kLeastCount = 1.5;   // events a cell along an edge, after blurring

/// Counts along a line of the reference view, sample by sample, in all slices.
class Profile {
 public:
  Profile(int samples, int slices)
      : samples_(samples), slices_(slices), counts_(static_cast<std::size_t>(samples * slices)) {}

  float& at(int sample, int slice) { return counts_[static_cast<std::size_t>(sample * slices_ + slice)]; }
  /// Mean along the line whose ends lie in these slices; slices outside of the volume hold nothing.
  double mean(int slice_a, int slice_b) const {
    double sum = 0;
    for (int k = 0; k < samples_; ++k) {
      const int slice = static_cast<int>(std::lround(slice_a + (slice_b - slice_a) * (k + 0.5) / samples_));
      if (slice >= 0 && slice < slices_)
        sum += static_cast<double>(counts_[static_cast<std::size_t>(k * slices_ + slice)]);
    }
    return sum / samples_;
  }

  struct Peak {
    double slice_a, slice_b, sigma_slices;
  };
  /// Where the rays meet; none where the counts do not tell, or at the borders of the volume.
  std::optional<Peak> peak() const;

 private:
  int samples_, slices_;
  std::vector<float> counts_;
};

std::optional<Profile::Peak> Profile::peak() const {
  int best_a = 0, best_b = 0;
  double best = -1;
  for (int a = 0; a < slices_; ++a)
    for (int b = 0; b < slices_; ++b)
      if (const double m = mean(a, b); m > best) best = m, best_a = a, best_b = b;
  if (best < kLeastCount || std::min(best_a, best_b) < 1 || std::max(best_a, best_b) > slices_ - 2) return {};
  const auto moved = [&](int by) { return mean(best_a + by, best_b + by); };
  if (std::max(moved(-kBeside_slices), moved(kBeside_slices)) > kPartedShare * best) return {};
  // Of three slices, where a parabola through them is highest.
  const double before = moved(-1), after = moved(1), bend = before - 2 * best + after;
  const double shift = bend < 0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0;
  int width = 1;
  while (width < kBeside_slices && std::max(moved(-width), moved(width)) > 0.7 * best) ++width;
  return Peak{best_a + shift, best_b + shift, 0.12 * width};
}

}  // namespace

SpaceSweep::SpaceSweep(const View& view)
    : view_(view),
      width_(2 * static_cast<int>(std::ceil(view.tangents.x() * view.focal_cells)) + 1),
      height_(2 * static_cast<int>(std::ceil(view.tangents.y() * view.focal_cells)) + 1),
      inverse_farthest_(1 / view.farthest_m),
      inverse_step_((1 / view.nearest_m - 1 / view.farthest_m) / (view.slices - 1)),
      counts_(static_cast<std::size_t>(view.slices) * static_cast<std::size_t>(width_) *
              static_cast<std::size_t>(height_)) {}

void SpaceSweep::add(const Eigen::Vector3d& centre, const Eigen::Vector3d& ray) {
  // Where the ray passes depth z: centre + (z - centre.z) way, which over z is linear in 1 / z.
  const Eigen::Vector2d way = ray.head<2>() / ray.z();
  const Eigen::Vector2d start = centre.head<2>() - centre.z() * way;
  const Eigen::Vector2d half(0.5 * width_, 0.5 * height_);
  Eigen::Vector2d at = view_.focal_cells * (way + inverse_farthest_ * start) + half;
  const Eigen::Vector2d step = view_.focal_cells * inverse_step_ * start;
  for (int slice = 0; slice < view_.slices; ++slice, at += step) {
    if (at.x() < 0 || at.y() < 0) continue;
    const int x = static_cast<int>(at.x()), y = static_cast<int>(at.y());
    if (x < width_ && y < height_) cell(slice, x, y) += 1;
  }
}

/// By 1, 2, 1 along rows and columns.
void SpaceSweep::blur() {
  std::vector<float> row(static_cast<std::size_t>(std::max(width_, height_)));
  const auto pass = [&](float* first, std::ptrdiff_t step, int count) {
    for (int i = 0; i < count; ++i) row[static_cast<std::size_t>(i)] = first[i * step];
    for (int i = 1; i + 1 < count; ++i) {
      const float* r = &row[static_cast<std::size_t>(i)];
      first[i * step] = 0.25F * r[-1] + 0.5F * r[0] + 0.25F * r[1];
    }
  };
  for (int slice = 0; slice < view_.slices; ++slice) {
    for (int y = 0; y < height_; ++y) pass(&cell(slice, 0, y), 1, width_);
    for (int x = 0; x < width_; ++x) pass(&cell(slice, x, 0), width_, height_);
  }
}

std::vector<SweptLine> SpaceSweep::take_lines() {
  blur();
  CountImage densest{width_, height_, std::vector<float>(index(1, 0, 0), 0)};
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    float& most = densest.counts[i % densest.counts.size()];
    most = std::max(most, counts_[i]);
  }
  LineDetectorConfig config;
  config.blur_cells = 0.7;
  config.least_contrast = 0.25;
  config.least_length = kShortest_cells, config.most_length = kLongest_cells;
  std::vector<SweptLine> out;
  for (const RidgeLine& line : detect_lines(densest, config, kApart_cells)) {
    const int samples = static_cast<int>(std::ceil((line.b - line.a).norm()));
    Profile profile(samples, view_.slices);
    for (int k = 0; k < samples; ++k) {
      const Eigen::Vector2d p = line.a + (k + 0.5) / samples * (line.b - line.a);
      for (int slice = 0; slice < view_.slices; ++slice)
        profile.at(k, slice) =
            cell(slice, static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y())));
    }
    const auto peak = profile.peak();
    if (!peak) continue;
    const auto place = [&](const Eigen::Vector2d& p, double slice) -> Eigen::Vector3d {
      const double depth = 1 / (inverse_farthest_ + slice * inverse_step_);
      return depth * Eigen::Vector3d((p.x() - 0.5 * (width_ - 1)) / view_.focal_cells,
                                     (p.y() - 0.5 * (height_ - 1)) / view_.focal_cells, 1);
    };
    out.push_back({place(line.a, peak->slice_a), place(line.b, peak->slice_b),
                   peak->sigma_slices * inverse_step_, line.significance});
  }
  return out;
}

}  // namespace evpose::map_learn
