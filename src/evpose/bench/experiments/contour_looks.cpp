// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/contour_looks.h"

#include <cmath>

namespace evpose::experiments {
namespace {

constexpr double kHalfLength_px = 4, kAmbiguity_px = 1;  // as the registration has them
constexpr double kLeastSpeed_px_s = 8;                   // below, the sensor's noise triggers, not the edge
constexpr double kLeastEvents = 12, kLeastShare = 0.3;   // of a contour in a look, and of all events there

/// Of a density that is linear over the reach, per event in the rim: events inside, and their sum by the
/// rim's sum.
constexpr double kCubes = OffsetSum::kInside_px * OffsetSum::kInside_px * OffsetSum::kInside_px;
constexpr double kReachCubes = OffsetSum::kReach_px * OffsetSum::kReach_px * OffsetSum::kReach_px;
constexpr double kInsideByRim = OffsetSum::kInside_px / (OffsetSum::kReach_px - OffsetSum::kInside_px);
constexpr double kSumByRim = kCubes / (kReachCubes - kCubes);

}  // namespace

void OffsetSum::add(double d) {
  if (std::abs(d) > kReach_px) return;
  if (std::abs(d) <= kInside_px)
    inside_ += 1, sum_ += d, square_ += d * d;
  else
    rim_ += 1, rim_sum_ += d, rim_square_ += d * d;
}

OffsetSum& OffsetSum::operator+=(const OffsetSum& o) {
  inside_ += o.inside_, sum_ += o.sum_, square_ += o.square_;
  rim_ += o.rim_, rim_sum_ += o.rim_sum_, rim_square_ += o.rim_square_;
  return *this;
}

double OffsetSum::events() const { return inside_ - kInsideByRim * rim_; }
double OffsetSum::share() const { return inside_ > 0 ? events() / inside_ : 0; }
double OffsetSum::sum_px() const { return sum_ - kSumByRim * rim_sum_; }
double OffsetSum::variance_px2() const { return square_ + kSumByRim * kSumByRim * rim_square_; }

double ContourLook::left_px() const {
  return measured_px() + (on.events() * delay_on_px + off.events() * delay_off_px) / events();
}

LookCounter::LookCounter(ImageSize size, const ContourMap& map)
    : size_(size), map_(map), index_(size, kHalfLength_px, kAmbiguity_px) {}

void LookCounter::build_bands(const RegistrationProblem& p) {
  bands_.clear();
  for (const ContourSample& s : p.samples) {
    const Eigen::Vector2f pixel = s.pixel.cast<float>(), normal = s.normal_px.cast<float>();
    bands_.push_back({pixel.x(), pixel.y(), normal.x(), normal.y(), static_cast<float>(1e-6 * s.speed_px_s),
                      static_cast<float>(1e-12 * s.curvature_px_s2),
                      static_cast<float>(OffsetSum::kReach_px)});
  }
  index_.build(bands_, static_cast<float>(1e6 * p.span_s));
}

/// No other contour claims events within the reach to either side.
bool LookCounter::stands_alone(std::size_t k, const RegistrationProblem& p) const {
  const AssociationBand& band = bands_[k];
  const auto age_us = static_cast<float>(0.5e6 * p.span_s);
  const float moved = (band.speed - band.curvature * age_us) * age_us;
  for (const float side : {-0.97F, -0.5F, 0.0F, 0.5F, 0.97F}) {
    const float across = side * band.reach - moved;
    const float x = band.x + across * band.nx, y = band.y + across * band.ny;
    if (!(x >= 0 && y >= 0 && x <= static_cast<float>(size_.width - 1) &&
          y <= static_cast<float>(size_.height - 1)))
      return false;
    const std::int32_t owner = index_.find(x, y, age_us).band;
    if (owner < 0 || p.samples[static_cast<std::size_t>(owner)].segment != p.samples[k].segment) return false;
  }
  return true;
}

LookCounter::Gathered& LookCounter::add_sample(const ContourSample& s, std::int64_t block,
                                               const EventRegistration& registration) {
  const int forward = s.speed_px_s > 0 ? 1 : -1, motion_side = forward * s.normal_side;
  Gathered& g = gathered_[{s.segment, block, motion_side}];
  ContourLook& look = g.look;
  const EdgeDelay delay = registration.edge_delay(s).delay;
  look.segment = s.segment;
  look.block = block;
  look.motion_side = motion_side;
  look.delay_on_px += delay.on_px;
  look.delay_off_px += delay.off_px;
  look.steps += motion_side * registration.contrast()->steps(s.segment);
  look.speed_px_s += std::abs(s.speed_px_s);
  look.depth_m += s.depth_m;
  look.pixel += s.pixel;
  look.motion += forward * s.normal_px;
  look.place_map += map_.position(s.point);
  ++g.samples;
  return g;
}

void LookCounter::add(const RegistrationProblem& p, double t_s, const EventRegistration& registration) {
  build_bands(p);
  const auto block = static_cast<std::int64_t>(std::floor(t_s / kBlock_s));
  of_sample_.assign(p.samples.size(), nullptr);
  for (std::size_t k = 0; k < p.samples.size(); ++k)
    if (std::abs(p.samples[k].speed_px_s) >= kLeastSpeed_px_s && stands_alone(k, p))
      of_sample_[k] = &add_sample(p.samples[k], block, registration);
  found_.clear();
  index_.find_all(p.events, 0, p.now_us, &found_);
  for (const auto& [event, owner] : found_) {
    const auto sample = static_cast<std::size_t>(owner.band);
    if (of_sample_[sample] == nullptr) continue;
    ContourLook& look = of_sample_[sample]->look;
    const double along = p.samples[sample].speed_px_s > 0 ? owner.distance : -owner.distance;
    (p.events[event].on ? look.on : look.off).add(along);
  }
}

std::vector<ContourLook> LookCounter::looks() const {
  std::vector<ContourLook> out;
  for (const auto& [key, g] : gathered_) {
    ContourLook look = g.look;
    OffsetSum all = look.on;
    all += look.off;
    if (all.events() < kLeastEvents || all.share() < kLeastShare) continue;
    for (double* mean : {&look.delay_on_px, &look.delay_off_px, &look.steps, &look.speed_px_s, &look.depth_m})
      *mean /= g.samples;
    look.pixel /= g.samples;
    look.motion.normalize();
    look.place_map /= g.samples;
    out.push_back(look);
  }
  return out;
}

}  // namespace evpose::experiments
