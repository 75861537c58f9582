// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/faults.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include "evpose/bench/experiments/fault_injection.h"
#include "evpose/core/parallel.h"

namespace evpose::experiments {
namespace {

constexpr double kStretch_s = 1.5;                      // of a replay, or what the recording has
constexpr double kAround_s = 0.07;                      // of the recording, left out at its ends
constexpr double kFaultFrom_s = 0.35;                   // after its start, at the earliest
constexpr double kAfterFault_s = 0.45;                  // of the replay, after its begin, at least
constexpr double kShortest_s = 0.03, kLongest_s = 0.2;  // of a fault
constexpr double kWrongSigma = 5;
constexpr double kFlagWithin_s = 0.05;
constexpr TimeNs kNamedWithin = 150 * kNsPerMs;     // after the fault
constexpr double kLost_m = 0.05, kLost_rad = 0.03;  // a pose so wrong is of no use
constexpr std::size_t kReasonLength = 48;           // of the reasons in the table

struct Replay {
  Fault fault;
  std::size_t recording;
  unsigned seed;
  int number;
};

/// What became of a replay.
struct ReplayOutcome {
  bool nan = false;
  int updates = 0;
  int silent = 0;                             ///< updates with an error beyond 5 sigma while called tracking
  double silent_from_s = 0, silent_to_s = 0;  ///< first and last of these, since the fault's begin
  double worst = 0, worst_mm = 0;             ///< of these: error in sigma, and its length
  bool named = false;       ///< degraded or lost, with a reason, between fault and 0.15 s after it
  bool lost = false;        ///< the pose left what is of use
  double flag_delay_s = 0;  ///< from there to degraded or lost; < 0: never
  double end_error_mm = 0;
  std::string first_reason;

  bool flagged_in_time() const { return lost && flag_delay_s >= 0 && flag_delay_s <= kFlagWithin_s; }
};

/// Holds each update of a replay against the truth.
class Judge {
 public:
  Judge(const std::vector<TimedPose>& truth, const FaultWindow& window) : truth_(truth), window_(window) {}

  void add(const Update& u) {
    ++out_.updates;
    const Vector6d e = u.T_map_body.minus(start_at(truth_, u.t).T_map_body);
    if (!e.allFinite() || !u.covariance.allFinite()) {
      out_.nan = true;
      return;
    }
    if (u.health == Health::tracking) note_silence(u, e);
    const bool warned = u.health == Health::degraded || u.health == Health::lost;
    if (warned && u.t >= window_.from && u.t < window_.to + kNamedWithin) {
      if (!out_.named) out_.first_reason = u.reason;
      out_.named = true;
    }
    note_loss(u.t, e, warned);
    out_.end_error_mm = 1e3 * e.head<3>().norm();
  }
  const ReplayOutcome& outcome() const { return out_; }

 private:
  void note_silence(const Update& u, const Vector6d& e) {
    const double worst = e.cwiseAbs().cwiseQuotient(u.covariance.diagonal().cwiseSqrt()).maxCoeff();
    if (worst <= kWrongSigma) return;
    const double since_s = to_seconds(u.t - window_.from);
    if (out_.silent++ == 0) out_.silent_from_s = since_s;
    out_.silent_to_s = since_s;
    out_.worst = std::max(out_.worst, worst);
    out_.worst_mm = std::max(out_.worst_mm, 1e3 * e.head<3>().norm());
  }
  void note_loss(TimeNs t, const Vector6d& e, bool warned) {
    if (!out_.lost && (e.head<3>().norm() > kLost_m || e.tail<3>().norm() > kLost_rad)) {
      out_.lost = true;
      lost_at_ = t;
      out_.flag_delay_s = -1;
    }
    if (out_.lost && out_.flag_delay_s < 0 && warned) out_.flag_delay_s = to_seconds(t - lost_at_);
  }

  const std::vector<TimedPose>& truth_;
  FaultWindow window_;
  ReplayOutcome out_;
  TimeNs lost_at_ = 0;
};

ReplayOutcome run_replay(const Streams& streams, const Replay& what) {
  std::mt19937 random(what.seed);
  const std::vector<TimedPose>& truth = streams.job.truth;
  const double usable_s = to_seconds(truth.back().t - truth.front().t) - kAround_s,
               stretch_s = std::min(kStretch_s, usable_s);
  const TimeNs begin =
      truth.front().t + 10 * kNsPerMs + from_seconds(uniform_between(random, 0, usable_s - stretch_s));
  const TimeNs end = begin + from_seconds(stretch_s);
  FaultWindow window{what.fault, 0, 0};
  window.from = begin + from_seconds(uniform_between(random, kFaultFrom_s, stretch_s - kAfterFault_s));
  window.to = window.from + from_seconds(uniform_between(random, kShortest_s, kLongest_s));

  auto [packets, imu] = excerpt(streams, begin, end);
  if (what.fault >= Fault::events_drop_out)
    inject_event_fault(window, streams.job.setup.camera->size(), random, &packets);
  else if (what.fault != Fault::none)
    inject_imu_fault(window, random, &imu);

  auto tracker = Tracker::create(streams.job.setup, streams.job.config.tracker, start_at(truth, begin));
  if (!tracker) return {};
  Judge judge(truth, window);
  (*tracker)->on_update([&](const Update& u) { judge.add(u); });
  feed(packets, imu, **tracker);
  (*tracker)->events_complete_until(end);
  return judge.outcome();
}

/// The replays that are asked for; their faults and recordings take turns.
std::vector<Replay> plan(const FaultsRequest& request, std::size_t recordings) {
  const auto wanted = [&](int number, std::size_t fault) {
    const auto& numbers = request.numbers;
    return (request.fault.empty() || request.fault == kFaultNames[fault]) &&
           (numbers.empty() || std::find(numbers.begin(), numbers.end(), number) != numbers.end());
  };
  std::vector<Replay> out;
  for (int i = 0; i < request.replays; ++i) {
    const auto turn = static_cast<std::size_t>(i);
    const std::size_t fault = turn % kFaultNames.size();
    if (wanted(i, fault))
      out.push_back({static_cast<Fault>(fault), turn / kFaultNames.size() % recordings,
                     request.seed * 100'000 + static_cast<unsigned>(i), i});
  }
  return out;
}

void print_replay(const Replay& replay, const std::string& recording, const ReplayOutcome& o) {
  std::printf(
      "%d %s on %s: %d of %d silent, %.3f to %.3f s after the fault began, up to %.1f sigma, "
      "%.1f mm; named %d (%s); of no use %d, reported after %.3f s; %.1f mm at the end\n",
      replay.number, kFaultNames[static_cast<std::size_t>(replay.fault)], recording.c_str(), o.silent,
      o.updates, o.silent_from_s, o.silent_to_s, o.worst, o.worst_mm, o.named ? 1 : 0, o.first_reason.c_str(),
      o.lost ? 1 : 0, o.flag_delay_s, o.end_error_mm);
}

/// The replays with one fault, or with any.
struct FaultRow {
  int replays = 0, named = 0, updates = 0, silent = 0, silent_replays = 0, lost = 0, flagged = 0,
      not_finite = 0;
  std::map<std::string, int> reasons;
  std::vector<double> end_errors_mm;

  void add(const ReplayOutcome& o) {
    ++replays;
    named += o.named ? 1 : 0;
    if (o.named && !o.first_reason.empty()) ++reasons[o.first_reason.substr(0, kReasonLength)];
    updates += o.updates;
    silent += o.silent;
    silent_replays += o.silent > 0 ? 1 : 0;
    lost += o.lost ? 1 : 0;
    flagged += o.flagged_in_time() ? 1 : 0;
    not_finite += o.nan || o.updates == 0 ? 1 : 0;
    end_errors_mm.push_back(o.end_error_mm);
  }
  /// The one given most often.
  std::string reason() const {
    const auto fewer = [](const auto& a, const auto& b) { return a.second < b.second; };
    const auto most = std::max_element(reasons.begin(), reasons.end(), fewer);
    return most == reasons.end() ? "" : most->first;
  }
};

void print_row(const char* fault, FaultRow row) {
  std::sort(row.end_errors_mm.begin(), row.end_errors_mm.end());
  std::printf("| %s | %d | %d | %s | %d | %d | %d | %d | %d | %.1f / %.1f | %d |\n", fault, row.replays,
              row.named, row.reason().c_str(), row.updates, row.silent, row.silent_replays, row.lost,
              row.flagged, row.end_errors_mm[row.end_errors_mm.size() / 2], row.end_errors_mm.back(),
              row.not_finite);
}

/// Prints the table; the row of all replays together.
FaultRow print_table(const FaultsRequest& request, const std::vector<Replay>& replays,
                     const std::vector<ReplayOutcome>& outcomes) {
  std::printf("%d replays of %.1f s (room_720p is shorter), seed %u.\n\n", static_cast<int>(replays.size()),
              kStretch_s, request.seed);
  std::printf(
      "| fault | replays | named | first reason | updates | silent updates | in replays | pose of no use "
      "| of these reported within 50 ms | end error median / max mm | not finite |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|\n");
  FaultRow all;
  for (std::size_t f = 0; f < kFaultNames.size(); ++f) {
    FaultRow row;
    for (std::size_t i = 0; i < replays.size(); ++i) {
      if (static_cast<std::size_t>(replays[i].fault) != f) continue;
      row.add(outcomes[i]);
      all.add(outcomes[i]);
    }
    if (row.replays > 0) print_row(kFaultNames[f], row);
  }
  std::printf(
      "\n%d of %d updates are beyond %.0f sigma while called tracking, in %d replays; %d losses are reported "
      "late or never; %d replays without a finite pose.\n",
      all.silent, all.updates, kWrongSigma, all.silent_replays, all.lost - all.flagged, all.not_finite);
  return all;
}

}  // namespace

Expected<int> print_faults(const FaultsRequest& request) {
  const auto config = configure(request.selection.assignments);
  if (!config) return config.error();
  const auto recordings = select_recordings(request.selection);
  if (!recordings) return recordings.error();
  std::vector<Streams> streams;
  for (const BenchRecording& recording : *recordings) {
    auto loaded = load_streams(recording, *config);
    if (!loaded) return loaded.error();
    streams.push_back(std::move(*loaded));
  }
  const std::vector<Replay> replays = plan(request, streams.size());
  if (replays.empty())
    return Error{"faults", "no replay has this fault and number", "see the names in docs/results/faults.md"};
  std::vector<ReplayOutcome> outcomes(replays.size());
  ThreadPool pool(request.threads);
  pool.for_chunks(replays.size(), 1, [&](std::size_t, std::size_t i, std::size_t) {
    outcomes[i] = run_replay(streams[replays[i].recording], replays[i]);
  });
  if (request.each)
    for (std::size_t i = 0; i < replays.size(); ++i)
      print_replay(replays[i], (*recordings)[replays[i].recording].name, outcomes[i]);
  return print_table(request, replays, outcomes).not_finite;
}

}  // namespace evpose::experiments
