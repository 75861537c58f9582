// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <deque>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "evpose/io/maps/map_h5.h"
#include "evpose/mavlink/link.h"
#include "evpose/report/run_verdict.h"
#include "evpose/serve/tracker_start.h"
#include "evpose/view/viewer.h"
#include "serve_live.h"

namespace evpose {

/// How long after its instant each pose was on the socket, to a hundredth of a millisecond.
class Delays {
 public:
  void add(TimeNs delay);
  std::uint64_t count() const { return count_; }
  /// To 0.01 ms up to a second; beyond, the largest.
  double quantile_ms(double share) const;
  double largest_ms() const { return 1e3 * to_seconds(largest_); }
  /// Of updates whose pose came later than kLate after its instant.
  double late_share() const {
    return static_cast<double>(late_) / static_cast<double>(std::max<std::uint64_t>(count_, 1));
  }
  static constexpr TimeNs kLate = 100 * kNsPerMs;  ///< an autopilot's filter no longer takes it

 private:
  static constexpr TimeNs kBin = 10 * kNsPerUs;
  std::vector<std::uint64_t> bins_ = std::vector<std::uint64_t>(100'000);
  std::uint64_t count_ = 0, late_ = 0;
  TimeNs largest_ = 0;
};

/// Everything that hears of the poses: MAVLink, the viewer, the run folder.
class Outputs {
 public:
  Outputs(const ServeConfig& config, const TrackJob& job, const MapPlacement& placement);

  Status open(const ServeRequest& request, const ServeConfig& config, const TrackJob& job);
  void add(const Update& u, TimeNs data_to_monotonic, Tracker& tracker);
  void restarted(const std::string& why);
  void notice(const std::string& words);
  void ambiguous(const std::string& poses);
  /// Where the autopilot's GPS and compass have the vehicle, if it said so just now.
  std::optional<TrackerStart> whereabouts() const;
  void stalled(const std::string& what);
  /// Reads from the link and sends what is due.
  void service(TimeNs now_ns);

  Health health() const { return health_; }
  /// Of the contours, whose events were looked at: "all", or "43.2 % on average, at least 5.0 %".
  std::string looked_at() const;
  /// How the updates were judged: "tracking 98.5 %, initialising 1.5 %"; empty without updates.
  std::string healths() const;
  /// How tracking went as a whole, from the last changes of health.
  RunVerdict verdict() const;
  const Delays& delays() const { return delays_; }
  const mavlink::Link* link() const { return link_.get(); }
  RunFolder* run() { return run_.get(); }

 private:
  VehicleFrames frames_;
  std::unique_ptr<mavlink::Link> link_;
  std::unique_ptr<mavlink::Reporter> reporter_;
  std::unique_ptr<RunFolder> run_;
  std::unique_ptr<Viewer> viewer_;
  TimeNs recorded_until_ = std::numeric_limits<TimeNs>::min();
  Health health_ = Health::waiting;
  std::array<std::uint64_t, kHealths.size()> updates_{};  ///< by health
  double least_share_ = 1, sum_of_shares_ = 0;
  std::deque<HealthChange> changes_;  ///< the last ones
  std::uint64_t judged_ = 0;          ///< updates that count in the share that was tracked
  TimeNs first_t_ = 0, last_t_ = 0;   ///< of updates
  Delays delays_;
};

}  // namespace evpose
