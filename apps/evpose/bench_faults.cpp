// SPDX-License-Identifier: BSD-3-Clause
// Replays of stretches of the shared recordings with a fault in one stream each, seeded: what does the
// tracker say, and is it ever wrong without saying so?
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <random>

#include "bench.h"
#include "bench_streams.h"
#include "commands.h"
#include "evpose/core/parallel.h"
#include "evpose/io/files/config_yaml.h"

namespace evpose {
namespace {

constexpr double kStretch_s = 1.5;      // of a replay, or what the recording has
constexpr double kAround_s = 0.07;      // of the recording, left out at its ends
constexpr double kFaultFrom_s = 0.35;   // after its start, at the earliest
constexpr double kAfterFault_s = 0.45;  // of the replay, after its begin, at least
constexpr double kWrongSigma = 5;
constexpr double kFlagWithin_s = 0.05;
constexpr double kLost_m = 0.05, kLost_rad = 0.03;  // a pose so wrong is of no use

enum class Fault {
  none,
  imu_gap,
  imu_saturated,
  imu_stuck,
  imu_jump_ahead,
  imu_jump_back,
  imu_not_a_number,
  imu_spike,
  events_drop_out,
  events_burst,
  events_packet_loss,
  events_stuck_rows
};
constexpr std::array<const char*, 12> kNames{"none",
                                             "IMU gap",
                                             "IMU saturated",
                                             "IMU axis stuck",
                                             "IMU clock jumps ahead",
                                             "IMU clock jumps back",
                                             "IMU not a number",
                                             "IMU spikes",
                                             "event drop-out",
                                             "event burst",
                                             "event packet loss",
                                             "event rows stuck"};

struct FaultsRequest {
  std::string folder = "../shared/data/peer";
  int replays = 200, threads = 2;
  unsigned seed = 1;
  std::string only;
  bool each = false;
  std::vector<int> numbers;
  std::vector<std::string> assignments;
};

struct Replay {
  Fault fault;
  std::size_t recording;
  unsigned seed;
  int number;
};

struct Outcome {
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
};

double uniform(std::mt19937& random, double low, double high) {
  return low + (high - low) * (static_cast<double>(random()) + 0.5) / 4294967296.0;
}

void spoil_imu(Fault fault, TimeNs from, TimeNs to, std::mt19937& random, std::vector<ImuSample>* imu) {
  const int axis = static_cast<int>(random() % 6);
  const auto value = [](ImuSample& s, int i) -> double& { return i < 3 ? s.gyro[i] : s.accel[i - 3]; };
  const TimeNs jump = from_seconds(uniform(random, 0.03, 0.2));
  double held = 0;
  bool holding = false;
  std::vector<ImuSample> out;
  for (ImuSample s : *imu) {
    const bool inside = s.t >= from && s.t < to;
    if (fault == Fault::imu_gap && inside) continue;
    if (fault == Fault::imu_saturated && inside)
      for (int i = 0; i < 6; ++i) {
        // A sensor of a range that this flight exceeds.
        const double range = i < 3 ? 0.05 : 4;
        double& v = value(s, i);
        if (std::abs(v) > range) v = std::copysign(i < 3 ? 34.9 : 156.9, v);
      }
    if (fault == Fault::imu_stuck && inside) {
      if (!holding) held = value(s, axis), holding = true;
      value(s, axis) = held;
    }
    if (fault == Fault::imu_not_a_number && inside) value(s, axis) = std::nan("");
    if (fault == Fault::imu_spike && inside && random() % 10 == 0)
      value(s, axis) += (axis < 3 ? 5 : 50) * (random() % 2 == 0 ? 1 : -1);
    if (fault == Fault::imu_jump_ahead && s.t >= from) s.t += jump;
    if (fault == Fault::imu_jump_back && s.t >= from) s.t -= jump;
    out.push_back(s);
  }
  *imu = std::move(out);
}

void spoil_events(Fault fault, TimeNs from, TimeNs to, ImageSize size, std::mt19937& random,
                  std::vector<EventPacket>* packets) {
  for (EventPacket& packet : *packets) {
    if (packet.empty() || packet.time(packet.events.front()) < from ||
        packet.time(packet.events.front()) >= to)
      continue;
    if (fault == Fault::events_drop_out) packet.events.clear();
    if (fault == Fault::events_packet_loss && random() % 10 < 7) packet.events.clear();
    if (packet.empty()) continue;
    std::vector<Event> extra;
    const auto any_time = [&] { return packet.events[random() % packet.events.size()].dt_us; };
    if (fault == Fault::events_burst)
      for (std::size_t i = 0; i < 5 * packet.events.size() + 5000; ++i)
        extra.push_back(make_event(any_time(), static_cast<int>(random() % static_cast<unsigned>(size.width)),
                                   static_cast<int>(random() % static_cast<unsigned>(size.height)),
                                   random() % 2 == 0));
    if (fault == Fault::events_stuck_rows)
      for (int row = size.height / 4; row < size.height; row += size.height / 4)
        for (int x = 0; x < size.width; ++x)
          extra.push_back(make_event(any_time(), x, row, random() % 2 == 0));
    packet.events.insert(packet.events.end(), extra.begin(), extra.end());
    std::stable_sort(packet.events.begin(), packet.events.end(),
                     [](const Event& a, const Event& b) { return a.dt_us < b.dt_us; });
  }
}

Outcome replay(const Streams& streams, const Replay& what) {
  std::mt19937 random(what.seed);
  const std::vector<TimedPose>& truth = streams.job.truth;
  const double usable_s = to_seconds(truth.back().t - truth.front().t) - kAround_s,
               stretch_s = std::min(kStretch_s, usable_s);
  const TimeNs begin =
      truth.front().t + 10 * kNsPerMs + from_seconds(uniform(random, 0, usable_s - stretch_s));
  const TimeNs end = begin + from_seconds(stretch_s);
  const TimeNs from = begin + from_seconds(uniform(random, kFaultFrom_s, stretch_s - kAfterFault_s));
  const TimeNs to = from + from_seconds(uniform(random, 0.03, 0.2));

  auto [packets, imu] = excerpt(streams, begin, end);
  if (what.fault >= Fault::events_drop_out)
    spoil_events(what.fault, from, to, streams.job.setup.camera->size(), random, &packets);
  else if (what.fault != Fault::none)
    spoil_imu(what.fault, from, to, random, &imu);

  Outcome out;
  auto tracker = Tracker::create(streams.job.setup, streams.job.config.tracker, start_at(truth, begin));
  if (!tracker) return out;
  TimeNs lost_at = 0;
  bool flagged = false;
  (*tracker)->on_update([&](const Update& u) {
    ++out.updates;
    const StartState true_state = start_at(truth, u.t);
    const Vector6d e = u.T_map_body.minus(true_state.T_map_body);
    if (!e.allFinite() || !u.covariance.allFinite()) {
      out.nan = true;
      return;
    }
    const double worst = e.cwiseAbs().cwiseQuotient(u.covariance.diagonal().cwiseSqrt()).maxCoeff();
    if (u.health == Health::tracking && worst > kWrongSigma) {
      const double since_s = to_seconds(u.t - from);
      if (out.silent++ == 0) out.silent_from_s = since_s;
      out.silent_to_s = since_s;
      out.worst = std::max(out.worst, worst);
      out.worst_mm = std::max(out.worst_mm, 1e3 * e.head<3>().norm());
    }
    const bool warned = u.health == Health::degraded || u.health == Health::lost;
    if (warned && u.t >= from && u.t < to + 150 * kNsPerMs) {
      if (!out.named) out.first_reason = u.reason;
      out.named = true;
    }
    flagged = warned;
    if (!out.lost && (e.head<3>().norm() > kLost_m || e.tail<3>().norm() > kLost_rad)) {
      out.lost = true;
      lost_at = u.t;
      out.flag_delay_s = -1;
    }
    if (out.lost && out.flag_delay_s < 0 && flagged) out.flag_delay_s = to_seconds(u.t - lost_at);
    out.end_error_mm = 1e3 * e.head<3>().norm();
  });
  feed(packets, imu, **tracker);
  (*tracker)->events_complete_until(end);
  return out;
}

int bench_faults(const FaultsRequest& request) {
  RunConfig config;
  ConfigTable table;
  describe(table, config);
  for (const auto& assignment : request.assignments)
    if (auto ok = apply_assignment(table, assignment); !ok) return bad_input(ok.error());
  std::vector<Streams> streams;
  std::vector<std::string> names;
  for (const PeerRecording& peer : peer_recordings(request.folder)) {
    TrackRequest track;
    track.recording = peer.folder;
    track.map = peer.map;
    track.occluders = peer.occluders;
    auto loaded = load_streams(track, config);
    if (!loaded) return bad_input(loaded.error());
    streams.push_back(std::move(*loaded));
    names.push_back(peer.name);
  }
  std::vector<Replay> replays;
  for (int i = 0; i < request.replays; ++i) {
    const auto fault = static_cast<std::size_t>(i) % kNames.size();
    if (!request.only.empty() && request.only != kNames[fault]) continue;
    if (!request.numbers.empty() &&
        std::find(request.numbers.begin(), request.numbers.end(), i) == request.numbers.end())
      continue;
    replays.push_back({static_cast<Fault>(fault),
                       static_cast<std::size_t>(i) / kNames.size() % streams.size(),
                       request.seed * 100'000 + static_cast<unsigned>(i), i});
  }
  std::vector<Outcome> outcomes(replays.size());
  ThreadPool pool(request.threads);
  pool.for_chunks(replays.size(), 1, [&](std::size_t, std::size_t i, std::size_t) {
    outcomes[i] = replay(streams[replays[i].recording], replays[i]);
  });

  if (request.each)
    for (std::size_t i = 0; i < replays.size(); ++i) {
      const Outcome& o = outcomes[i];
      std::printf(
          "%d %s on %s: %d of %d silent, %.3f to %.3f s after the fault began, up to %.1f sigma, "
          "%.1f mm; named %d (%s); of no use %d, told after %.3f s; %.1f mm at the end\n",
          replays[i].number, kNames[static_cast<std::size_t>(replays[i].fault)],
          names[replays[i].recording].c_str(), o.silent, o.updates, o.silent_from_s, o.silent_to_s, o.worst,
          o.worst_mm, o.named ? 1 : 0, o.first_reason.c_str(), o.lost ? 1 : 0, o.flag_delay_s,
          o.end_error_mm);
    }
  std::printf(
      "Made by `evpose bench faults`; do not edit.\n\n%d replays of %.1f s (room_720p is shorter), seed "
      "%u.\n\n",
      static_cast<int>(replays.size()), kStretch_s, request.seed);
  std::printf(
      "| fault | replays | named | first words | updates | silent updates | in replays | pose of no "
      "use | of these told within 50 ms | end error median / max mm | not finite "
      "|\n|---|---|---|---|---|---|---|---|---|---|---|\n");
  int silent = 0, silent_replays = 0, updates = 0, late = 0, not_finite = 0;
  for (std::size_t f = 0; f < kNames.size(); ++f) {
    int count = 0, named = 0, made = 0, quiet = 0, quiet_replays = 0, lost = 0, told = 0, nan = 0;
    std::map<std::string, int> words;
    std::vector<double> end_errors;
    for (std::size_t i = 0; i < replays.size(); ++i) {
      if (static_cast<std::size_t>(replays[i].fault) != f) continue;
      const Outcome& o = outcomes[i];
      ++count;
      named += o.named ? 1 : 0;
      if (o.named && !o.first_reason.empty()) ++words[o.first_reason.substr(0, 48)];
      quiet += o.silent;
      quiet_replays += o.silent > 0 ? 1 : 0;
      lost += o.lost ? 1 : 0;
      const bool in_time = o.lost && o.flag_delay_s >= 0 && o.flag_delay_s <= kFlagWithin_s;
      told += in_time ? 1 : 0;
      late += o.lost && !in_time ? 1 : 0;
      nan += o.nan || o.updates == 0 ? 1 : 0;
      made += o.updates;
      end_errors.push_back(o.end_error_mm);
    }
    if (count == 0) continue;
    std::sort(end_errors.begin(), end_errors.end());
    std::string most;
    for (const auto& [word, n] : words)
      if (most.empty() || n > words[most]) most = word;
    std::printf("| %s | %d | %d | %s | %d | %d | %d | %d | %d | %.1f / %.1f | %d |\n", kNames[f], count,
                named, most.c_str(), made, quiet, quiet_replays, lost, told,
                end_errors[end_errors.size() / 2], end_errors.back(), nan);
    updates += made;
    silent += quiet;
    silent_replays += quiet_replays;
    not_finite += nan;
  }
  std::printf(
      "\n%d of %d updates are beyond %.0f sigma while called tracking, in %d replays; %d losses are told "
      "late or never; "
      "%d replays without a finite pose.\n",
      silent, updates, kWrongSigma, silent_replays, late, not_finite);
  return not_finite > 0 ? 1 : 0;
}

}  // namespace

void add_bench_faults(CLI::App& bench, std::function<int()>& run) {
  auto* command = bench.add_subcommand("faults", "Replays with faults in the streams");
  auto request = std::make_shared<FaultsRequest>();
  command->add_option("folder", request->folder, "folder with the recordings and maps")
      ->capture_default_str();
  command->add_option("--replays", request->replays, "number of replays")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command->add_option("--threads", request->threads, "replays at a time")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  command->add_option("--seed", request->seed, "of all random numbers")->capture_default_str();
  command->add_option("--only", request->only, "only the replays with this fault");
  command->add_option("--number", request->numbers, "only the replays of these numbers")->delimiter(',');
  command->add_flag("--each", request->each, "a line for each replay");
  command->add_option("--set", request->assignments, "one setting, key=value")->allow_extra_args(false);
  command->callback([=, &run] { run = [=] { return bench_faults(*request); }; });
}

}  // namespace evpose
