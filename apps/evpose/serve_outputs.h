// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "evpose/io/maps/map_h5.h"
#include "evpose/mavlink/link.h"
#include "evpose/view/viewer.h"
#include "serve_live.h"

namespace evpose {

/// How long after its instant each pose was on the socket, to a hundredth of a millisecond.
class Delays {
 public:
  void add(TimeNs delay);
  std::uint64_t count() const { return count_; }
  double quantile_ms(double share) const;

 private:
  static constexpr TimeNs kBin = 10 * kNsPerUs;
  std::vector<std::uint64_t> bins_ = std::vector<std::uint64_t>(100'000);
  std::uint64_t count_ = 0;
};

/// Everything that hears of the poses: MAVLink, the viewer, the run folder.
class Outputs {
 public:
  Outputs(const ServeConfig& config, const TrackJob& job, const MapPlacement& placement);

  Status open(const ServeRequest& request, const ServeConfig& config, const TrackJob& job);
  void add(const Update& u, TimeNs data_to_monotonic, const Tracker& tracker);
  void restarted(const std::string& why);
  void notice(const std::string& words);
  void stalled(const std::string& what);
  /// Reads from the link and sends what is due.
  void service(TimeNs now_ns);

  Health health() const { return health_; }
  /// How the updates were judged: "tracking 98.5 %, initialising 1.5 %"; empty without updates.
  std::string healths() const;
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
  std::array<std::uint64_t, 5> updates_{};  ///< by health
  Delays delays_;
};

}  // namespace evpose
