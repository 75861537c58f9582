// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/serve/recovery.h"
#include "evpose/serve/stream_queue.h"
#include "evpose/serve/tracker_start.h"

namespace evpose {

class ConfigTable;

struct SessionConfig {
  double stall_s = 0.3;        ///< of the wall clock without data: the stream is called stalled
  double largest_gap_s = 0.3;  ///< of data time without events or IMU: the tracker starts anew
  double imu_only_s = 2;       ///< the IMU alone bridges so much data time without events
  double wait_imu_s = 0.1;     ///< events further ahead of the IMU are shed

  // Not settings of its own.
  RelocalizationConfig search = {};  ///< of a lost pose
  bool waits = false;                ///< for searches, so that nothing depends on how long they take
};
void describe(ConfigTable& table, SessionConfig& config);

/// Runs trackers on a live stream: starts one, feeds it with what is sound, and starts another from the last
/// good pose when a clock jumps or a stream was away too long. A pose that is lost, or not known well enough
/// at the start, is searched beside (Recovery), ever more widely, and its tracker then takes over. Memory is
/// bounded whatever arrives. `now_ns` is the machine's monotone clock.
class Session {
 public:
  /// Called on threads of searches, too.
  using MakeTracker = std::function<Expected<std::unique_ptr<Tracker>>(const TrackerStart& start)>;
  struct Hooks {
    std::function<void(const Update&, TimeNs data_to_monotonic, Tracker&)> update;
    std::function<void(const std::string& why)> restarted;  ///< a new tracker stands somewhere else
    std::function<void(const std::string& what)> stalled;   ///< no pose until the next update
    std::function<void(const std::string& words)> notice;
    /// Where others have it, within some metres, and its heading if the sigma says so.
    std::function<std::optional<TrackerStart>()> whereabouts = {};
    /// A search beside has several poses that explain the events alike: which, in words.
    std::function<void(const std::string& poses)> ambiguous = [](const std::string&) {};
  };

  /// `start_at`: the data time of the start pose; unset: as soon as there are data.
  Session(const SessionConfig& config, bool has_imu, const TrackerStart& start,
          std::optional<TimeNs> start_at, MakeTracker make, Hooks hooks);

  void take(StreamItem& item, TimeNs now_ns);
  /// Call at least ten times a second.
  void tick(TimeNs now_ns);
  /// Back to the start pose.
  void reset(const std::string& why);

  /// A pose is being found beside.
  bool searching() const { return searching_; }
  const Tracker* tracker() const { return tracker_.get(); }
  struct Counts {
    std::uint64_t updates = 0, restarts = 0, stalls = 0, searches = 0, found = 0;
    std::uint64_t events = 0, events_shed = 0, events_late = 0, imu = 0, imu_late = 0;
    std::uint64_t events_kept = 0;     ///< by the noise filters of all earlier trackers
    std::uint64_t events_thinned = 0;  ///< beyond events.most_mev_s, by all earlier trackers
  };
  const Counts& counts() const { return counts_; }

 private:
  struct Stream {
    const char* name;
    TimeNs last = std::numeric_limits<TimeNs>::min();  ///< data time
    TimeNs arrived = 0;                                ///< monotone clock
    bool stalled = false;
    bool any() const { return last != std::numeric_limits<TimeNs>::min(); }
  };
  void take_events(EventPacket& packet, TimeNs now_ns);
  void take_imu(const std::vector<ImuSample>& samples, TimeNs now_ns);
  /// Whether data of time `t` follow; if the clock jumped, the tracker is given up first.
  bool follows(Stream& stream, TimeNs t);
  /// The IMU has gone on while no events came, and not for too long: no new start is needed.
  bool bridged_by_imu(const Stream& stream, TimeNs t) const;
  void arrived(Stream& stream, TimeNs now_ns) const;
  void check_stall(Stream& stream, TimeNs now_ns);
  void restart(const std::string& why, bool from_last);
  bool begin(TimeNs first_event);
  bool create(TrackerStart start);
  void use(std::unique_ptr<Tracker> tracker);
  void count_tracker();
  void add_sample(const ImuSample& sample);

  TrackerStart moved_on(TrackerStart start) const;
  TrackerStart where_to_search() const;
  void begin_beside(const TrackerStart& from);
  void give_up_search();
  void end_search();
  void mind_search();

  void learn_offset(const StreamItem& item, TimeNs newest);

  SessionConfig config_;
  bool has_imu_;
  TrackerStart start_, next_;  ///< next_: its time is when the data ended, after a gap
  bool again_ = false;
  std::optional<TimeNs> first_start_at_, start_at_;
  MakeTracker make_;
  Hooks hooks_;
  std::unique_ptr<Tracker> tracker_;
  bool tracks_ = false;                              ///< the tracker, at its last update
  bool searching_ = false;                           ///< a search goes on, or the next one is about to begin
  std::unique_ptr<Recovery> recovery_;               ///< the search, if one goes on
  std::vector<std::unique_ptr<Recovery>> given_up_;  ///< until their threads have ended
  bool by_search_ = false;                           ///< it searches, and does not just align the first view
  static constexpr TimeNs kNever = std::numeric_limits<TimeNs>::min() / 2;
  TimeNs search_began_ = kNever;  ///< data time
  int width_ = 0;                 ///< of the search
  Stream events_{"events"}, imu_{"IMU"};
  std::deque<ImuSample> before_;  ///< IMU samples that came before there was a tracker
  std::optional<Update> last_valid_;
  bool shedding_ = false, refused_ = false;
  TimeNs offset_ = 0, window_min_ = 0, window_end_ = std::numeric_limits<TimeNs>::min();
  bool has_offset_ = false;
  Counts counts_;
};

}  // namespace evpose
