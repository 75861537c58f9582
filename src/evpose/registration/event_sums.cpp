// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/event_sums.h"

#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

constexpr float kGateRim = 0.8F;  // events beyond this share of the gate tell the density at it

}  // namespace

void EventSums::begin(std::size_t samples) {
  for (const std::uint32_t sample : ruled_) rules_[sample] = {}, sums_[sample] = {};
  rules_.resize(samples), sums_.resize(samples);
  ruled_.clear(), waiting_.clear();
  wrong_polarity_ = 0;
}

void EventSums::set_rule(std::size_t sample, const EventRule& rule) {
  rules_[sample] = rule;
  ruled_.push_back(static_cast<std::uint32_t>(sample));
}

void EventSums::forget_events() {
  for (const std::uint32_t sample : ruled_) {
    const SampleShift shift = sums_[sample].shift;
    sums_[sample] = {};
    sums_[sample].shift = shift;
  }
  waiting_.clear();
  wrong_polarity_ = 0;
}

void EventSums::add(const AssociationIndex::Owner& owner, float age_us, bool on) {
  const auto sample = static_cast<std::size_t>(owner.band);
  const EventRule& rule = rules_[sample];
  const float d = owner.distance + rule.delay(on);
  if (std::abs(std::abs(d) - rule.gate) < kFollow_px)
    waiting_.push_back({static_cast<std::uint32_t>(sample), d, age_us, on});
  else
    judge(sample, d, age_us, on);
}

void EventSums::judge(std::size_t sample, float d, float age_us, bool on) {
  const EventRule& rule = rules_[sample];
  Sum& sum = sums_[sample];
  const int along = on ? rule.forward : -rule.forward;
  if (std::abs(d) <= near_px_) sum.now.net += along;
  if (std::abs(d) > rule.gate) return;
  sum.now.gate_net += along;
  ++sum.now.gate_all;
  if (polarity_ && rule.excludes(on)) {
    ++wrong_polarity_;
    return;
  }
  const float odds = rule.odds * std::exp(rule.exponent * d * d), w = odds / (1 + odds);
  const float by = 2 * rule.exponent * d * w * (1 - w), inside = w + d * by, square_by = d * (w + inside);
  ++sum.now.events;
  sum.now.weight += w, sum.now.offset += w * d, sum.now.square += w * d * d;
  sum.now.inside += inside;
  if (std::abs(d) > kGateRim * rule.gate) sum.now.at_gate += w * std::abs(d) / ((1 - kGateRim) * rule.gate);
  sum.weight_by += by, sum.weight_by_age += by * age_us;
  sum.square_by += square_by, sum.square_by_age += square_by * age_us;
  sum.offset_by_age += inside * age_us;
}

bool EventSums::follow(float span_us) {
  for (const std::uint32_t sample : ruled_) {
    const SampleShift& s = sums_[sample].shift;
    if (std::abs(s.shift_px) + std::abs(s.drift_px_us) * span_us > kFollow_px) return false;
  }
  for (const std::uint32_t sample : ruled_) {
    Sum& sum = sums_[sample];
    const SampleShift& s = sum.shift;
    sum.now.weight += s.shift_px * sum.weight_by + s.drift_px_us * sum.weight_by_age;
    sum.now.offset += s.shift_px * sum.now.inside + s.drift_px_us * sum.offset_by_age;
    sum.now.square += s.shift_px * sum.square_by + s.drift_px_us * sum.square_by_age;
  }
  for (const Waiting& e : waiting_) judge(e.sample, e.distance + sums_[e.sample].shift.at(e.age_us), 0, e.on);
  return true;
}

}  // namespace evpose
