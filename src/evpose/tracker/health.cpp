// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/health.h"

#include <utility>

#include "evpose/core/config.h"

namespace evpose {
namespace {

constexpr double kInitialise_s =
    0.05;  // accepted registrations for so long make "tracking" of "initialising"

}  // namespace

void describe(ConfigTable& table, HealthConfig& c) {
  table.add("degraded_after_s", c.degraded_after_s, "s", "without an accepted registration: degraded",
            {0, 100});
  table.add("degraded_sigma_px", c.degraded_sigma_px, "px",
            "pose uncertainty as image motion: degraded above", {0, 1e4});
  table.add("lost_sigma_px", c.lost_sigma_px, "px", "pose uncertainty as image motion: lost above", {0, 1e4});
  table.add("innovation_gate", c.innovation_gate, "",
            "largest normalised innovation squared / 6 of a registration that is used", {0.1, 1e9});
}

void HealthMonitor::start(TimeNs t) {
  state_ = Health::initialising;
  started_ = last_accepted_ = t;
  any_accepted_ = contradicted_ = hopeless_ = false;
}

Health HealthMonitor::judge(const Evidence& e, std::string* reason) {
  if (e.accepted) last_accepted_ = e.t, any_accepted_ = true;
  const double silent_s = to_seconds(e.t - last_accepted_);
  Health next = Health::tracking;
  std::string why;
  if (e.hopeless) {
    next = Health::lost;
    why = e.contradicted;
  } else if (!e.ambiguous.empty()) {
    next = Health::ambiguous;
    why = e.ambiguous;
  } else if (e.searching) {
    next = any_accepted_ ? Health::lost : Health::initialising;
    why = e.contradicted.empty() ? e.refused : e.refused + ": " + e.contradicted;
  } else if (!(e.sigma_px <= config_.lost_sigma_px)) {
    next = Health::lost;
    why = text("pose uncertain by ", e.sigma_px, " px, beyond the limit of ", config_.lost_sigma_px, " px");
    if (!e.refused.empty()) why += ": " + e.refused;
  } else if (!any_accepted_ || !e.verified || to_seconds(e.t - started_) < kInitialise_s) {
    next = Health::initialising;
    why = e.contradicted.empty() ? "collecting events" : e.contradicted;
  } else if (silent_s > config_.degraded_after_s) {
    next = Health::degraded;
    why = text("no registration for ", config_.degraded_after_s, " s: ", e.refused);
  } else if (!e.contradicted.empty()) {
    next = Health::degraded;
    why = e.contradicted;
  } else if (!e.fault.empty()) {
    next = Health::degraded;
    why = e.fault;
  } else if (e.sigma_px > config_.degraded_sigma_px) {
    next = Health::degraded;
    why = text("pose uncertain by ", e.sigma_px, " px: ", e.weakest);
  }
  const bool contradicted = !e.contradicted.empty();
  bool news = contradicted != std::exchange(contradicted_, contradicted);
  news |= e.hopeless != std::exchange(hopeless_, e.hopeless);
  if (next == Health::tracking)
    why = next == state_ ? "" : "contours and events agree";
  else if (next == state_ && !news)
    why.clear();
  *reason = std::move(why);
  return state_ = next;
}

}  // namespace evpose
