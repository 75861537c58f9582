// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "evpose/core/pose.h"
#include "evpose/core/time.h"
#include "evpose/tracker/update.h"

namespace evpose {

class ConfigTable;

inline constexpr int kLeastInliers =
    12;  ///< contour samples with events; fewer do not hold a pose of six degrees

struct HealthConfig {
  double degraded_after_s = 0.1;   ///< without an accepted registration
  double degraded_sigma_px = 2.0;  ///< pose uncertainty, as motion of the image
  double lost_sigma_px = 8.0;      ///< beyond what the registration can correct
  double innovation_gate = 25;  ///< largest normalised innovation squared / 6 of a registration that is used
};
void describe(ConfigTable& table, HealthConfig& config);

/// What one update has to say for itself.
struct Evidence {
  TimeNs t = 0;
  bool accepted = false;
  std::string refused;            ///< why not accepted
  bool searching = false;         ///< the pose is searched: it is not known
  double sigma_px = 0;            ///< pose uncertainty as motion of the image, 1 sigma
  std::string weakest;            ///< that direction in words
  std::string fault;              ///< what is wrong with the data, if anything
  bool verified = true;           ///< the events have confirmed the pose since it was given or found
  std::string contradicted = {};  ///< what speaks against the pose, if the events do
  bool hopeless = false;          ///< for so long that no pose near by can be the true one
  std::string ambiguous = {};     ///< the poses that explain the events alike, if there are several
};

/// The state machine of design.md 5.9: waiting, initialising, tracking, degraded,
/// ambiguous, lost; each with a reason.
class HealthMonitor {
 public:
  explicit HealthMonitor(const HealthConfig& config) : config_(config) {}

  void start(TimeNs t);
  /// The new state; `reason` is set when it changed, else cleared.
  Health judge(const Evidence& evidence, std::string* reason);
  Health state() const { return state_; }

 private:
  HealthConfig config_;
  Health state_ = Health::waiting;
  TimeNs started_ = 0, last_accepted_ = 0;
  bool any_accepted_ = false, contradicted_ = false, hopeless_ = false;
};

}  // namespace evpose
