// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "evpose/event/event_preprocessor.h"
#include "evpose/registration/association_band.h"
#include "evpose/registration/contour_trust.h"

namespace evpose {

/// How a contour sample judges the events that its band owns.
struct EventRule {
  float delay_on = 0, delay_off = 0;        ///< px, along the normal
  float gate = 0;                           ///< half its width, px; 0: the rule is not made yet
  float exponent = 0, odds = 0;             ///< exp(exponent d^2) * odds: of the contour against clutter
  std::int8_t wrong_on = 0, wrong_off = 0;  ///< polarity excluded
  std::int8_t forward = 1;                  ///< +1 if the contour moves along its normal, else -1

  float delay(bool on) const { return on ? delay_on : delay_off; }
  bool excludes(bool on) const { return (on ? wrong_on : wrong_off) != 0; }
};

/// A rule's sample stands elsewhere than it was expected to: distances grow by so much.
struct SampleShift {
  float shift_px = 0, drift_px_us = 0;  ///< drift: for each us of an event's age

  float at(float age_us) const { return shift_px + drift_px_us * age_us; }
};

/// What the events of one sample say.
struct EventSum {
  double weight = 0, offset = 0, square = 0;  ///< of the events in the gate: sums of w, w d, w d^2
  double inside = 0, at_gate = 0;             ///< as GateSums has them
  int events = 0, net = 0;         ///< events: used; net: events near by, on less off along the motion
  int gate_net = 0, gate_all = 0;  ///< likewise in the gate, of both polarities; all

  GateSums gate() const { return {weight, inside, at_gate}; }
};

/// Sums over events, sample by sample, made as the events come. When it turns out that the samples stand a
/// little elsewhere than was expected, the sums follow to first order; events so near to a gate's border that
/// this decides on them wait until then. With distances d' = d + s + r a, a the age, and weights w' = w(d'):
///   sum w' d' = sum w d + s sum (w + d dw/dd) + r sum (w + d dw/dd) a + ..., likewise of w' and w' d'^2.
class EventSums {
 public:
  /// Events within `near_px` count as near by, also outside of the gate. `polarity`: excluded ones are left
  /// out.
  EventSums(double near_px, bool polarity) : near_px_(static_cast<float>(near_px)), polarity_(polarity) {}

  static constexpr float kFollow_px = 0.05F;  ///< the most that sums follow

  /// Forgets everything; there are so many samples.
  void begin(std::size_t samples);
  bool has_rule(std::size_t sample) const { return rules_[sample].gate > 0; }
  void set_rule(std::size_t sample, const EventRule& rule);
  const EventRule& rule(std::size_t sample) const { return rules_[sample]; }
  /// Samples that have rules, in the order in which they got them.
  std::span<const std::uint32_t> ruled() const { return ruled_; }

  /// An event of this age at the samples' time, at the distance from the band of a sample that has a rule.
  void add(const AssociationIndex::Owner& owner, float age_us, bool on);

  /// Of a sample that has a rule.
  void set_shift(std::size_t sample, const SampleShift& shift) { sums_[sample].shift = shift; }
  /// By what set_shift() has told. False: too much, and nothing has changed. `span_us`: age of the oldest
  /// event.
  bool follow(float span_us);
  /// Forgets the events; then all are to be added anew, at their distances from the shifted bands.
  void forget_events();
  void add_shifted(const AssociationIndex::Owner& owner, float age_us, bool on) {
    judge(static_cast<std::size_t>(owner.band), distance(owner, age_us, on), 0, on);
  }
  /// From the shifted contour, delay taken off.
  float distance(const AssociationIndex::Owner& owner, float age_us, bool on) const {
    const auto sample = static_cast<std::size_t>(owner.band);
    return owner.distance + rules_[sample].delay(on) + sums_[sample].shift.at(age_us);
  }

  /// After follow(), or when all were added anew.
  const EventSum& sum(std::size_t sample) const { return sums_[sample].now; }
  int wrong_polarity() const { return wrong_polarity_; }

 private:
  /// And how it changes by the distance, and by the distance times the age. That of `offset` by the distance
  /// is `inside`.
  struct Sum {
    EventSum now;
    double weight_by = 0, square_by = 0;
    double weight_by_age = 0, offset_by_age = 0, square_by_age = 0;
    SampleShift shift;
  };
  struct Waiting {
    std::uint32_t sample;
    float distance, age_us;
    bool on;
  };
  void judge(std::size_t sample, float distance, float age_us, bool on);

  float near_px_;
  bool polarity_;
  std::vector<EventRule> rules_;
  std::vector<Sum> sums_;
  std::vector<std::uint32_t> ruled_;
  std::vector<Waiting> waiting_;
  int wrong_polarity_ = 0;
};

}  // namespace evpose
