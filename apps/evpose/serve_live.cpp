// SPDX-License-Identifier: BSD-3-Clause
#include "serve_live.h"

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <limits>
#include <memory>
#include <optional>
#include <thread>

#include "commands.h"
#include "evpose/core/log.h"
#include "evpose/io/calibration/calibration.h"
#include "evpose/io/calibration/kalibr.h"
#include "evpose/io/files/config_yaml.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/run/start.h"
#include "evpose/serve/metavision_source.h"
#include "evpose/serve/packet_source.h"
#include "evpose/serve/tracker_start.h"
#include "evpose/tracker/tracker_parts.h"
#include "interrupt.h"
#include "serve_outputs.h"

namespace evpose {
namespace {

constexpr TimeNs kIdle = 5 * kNsPerMs;  // the longest wait for data before the links are serviced
constexpr double kLateShare = 0.01;     // of the poses, from which on it is said

volatile std::sig_atomic_t g_reset = 0;
void ask_reset(int) { g_reset = 1; }

/// As prepare(), for a source that has no folder: calibration, map and start are all given.
Expected<TrackJob> prepare_source(const ServeRequest& request, const RunConfig& config) {
  const TrackRequest& track = request.track;
  if (track.calibration.empty())
    return Error{track.recording, "a source has no calibration of its own", "give one with --calibration"};
  const auto calibration = read_calibration(track.calibration);
  if (!calibration) return calibration.error();
  const auto chosen = choose_camera(*calibration);
  if (!chosen) return chosen.error();
  Recording recording;
  recording.folder = recording.name = track.recording;
  recording.camera = *chosen->intrinsics;
  recording.calibration_sigma = chosen->sigma;
  recording.trail_filter = chosen->trail_filter;
  recording.calibration_path = track.calibration;
  recording.has_imu = chosen->T_cam_imu.has_value() && (!is_metavision_address(track.recording) ||
                                                        metavision_address_has_imu(track.recording));
  recording.T_cam_body = chosen->T_cam_imu.value_or(Pose{});
  recording.last_ns = std::numeric_limits<TimeNs>::max();
  if (calibration->imu_noise) recording.imu_noise = *calibration->imu_noise;
  if (!track.imu_model.empty()) {
    const auto noise = read_imu_noise(track.imu_model);
    if (!noise) return noise.error();
    recording.imu_noise = *noise;
  }
  return make_job(track, config, recording, {});
}

/// The map's own origin, where the configuration names none.
void take_origin(const MapPlacement& placement, MavlinkConfig& c) {
  if (!placement.origin_llh || c.origin_latitude_deg != 0 || c.origin_longitude_deg != 0) return;
  c.origin_latitude_deg = placement.origin_llh->x();
  c.origin_longitude_deg = placement.origin_llh->y();
  if (c.origin_altitude_m == 0) c.origin_altitude_m = placement.origin_llh->z();
}

/// A thread that fills the queue, ended and joined whatever happens.
class SourceThread {
 public:
  SourceThread(Source& source, StreamQueue& queue)
      : queue_(queue), thread_([&source, &queue] { source.run(queue); }) {}
  ~SourceThread() {
    queue_.close();
    thread_.join();
  }
  SourceThread(const SourceThread&) = delete;
  SourceThread& operator=(const SourceThread&) = delete;

 private:
  StreamQueue& queue_;
  std::thread thread_;
};

bool is_live(const std::string& address) {
  return is_packet_address(address) || is_metavision_address(address);
}

Expected<std::unique_ptr<Source>> open_source(const std::string& address, const TrackJob& job,
                                              const ReplayConfig& replay) {
  if (is_metavision_address(address)) return open_metavision_source(address, job.recording.camera.size);
  if (is_packet_address(address)) return open_packet_source(address, job.recording.camera.size);
  return std::unique_ptr<Source>(std::make_unique<ReplaySource>(job.recording, replay));
}

/// Makes the trackers of a session. The first is made before the data come, since that takes a while.
class TrackerMaker {
 public:
  static Expected<TrackerMaker> create(const TrackJob& job) {
    TrackerMaker out(job);
    auto first = out.make(out.first_start());
    if (!first) return first.error();
    out.first_ = std::move(*first);
    if (!job.config.tracker.relocalization.on || !out.first_->needs_search()) return out;
    // What its search needs of the map is kept.
    TrackerStart searching = out.first_start();
    searching.searches = true;
    if (auto made = out.make(searching); !made) return made.error();
    return out;
  }

  TrackerStart first_start() const {
    const FusionConfig& fusion = job_->config.tracker.fusion;
    return {job_->start, fusion.start_position_sigma_m, fusion.start_rotation_sigma_rad};
  }
  /// Searching trackers may be made on other threads.
  Expected<std::unique_ptr<Tracker>> make(const TrackerStart& start) {
    if (!start.searches && first_ && start.state.t == job_->start.t) return std::move(first_);
    return make_tracker(job_->setup, job_->config.tracker, start, wall_s);
  }

 private:
  explicit TrackerMaker(const TrackJob& job) : job_(&job) {}

  const TrackJob* job_;
  std::unique_ptr<Tracker> first_;
};

/// Of the settings and what they say of other parts.
SessionConfig session_config(const ServeConfig& config, const TrackJob& job, bool live) {
  SessionConfig out = config.session;
  out.search = relocalization_config(job.config.tracker);
  out.waits = !live && config.replay.speed == 0;
  return out;
}

/// Hands what the source brings to the session, and services the outputs, until the source ends or the
/// program is interrupted.
void run_session(Source& source, StreamQueue& queue, Session& session, Outputs& outputs) {
  const SourceThread thread(source, queue);
  StreamItem item;
  for (bool ended = false; !ended && !InterruptGuard::interrupted();) {
    if (queue.pop(item, kIdle)) {
      session.take(item, monotonic_ns());
      ended = item.kind == StreamItem::Kind::end;
    }
    const TimeNs now = monotonic_ns();
    session.tick(now);
    outputs.service(now);
    if (g_reset != 0) {
      g_reset = 0;
      session.reset("asked for by a signal");
    }
  }
}

void print_outcome(const Session& session, const StreamQueue& queue, const Outputs& outputs) {
  const auto& c = session.counts();
  const auto q = queue.counts();
  const auto thinned =
      c.events_thinned +
      (session.tracker() ? static_cast<std::uint64_t>(session.tracker()->events().counts().shed) : 0);
  std::printf("%s; %llu updates, %llu restarts, %llu stalls\n", to_string(outputs.health()),
              static_cast<unsigned long long>(c.updates), static_cast<unsigned long long>(c.restarts),
              static_cast<unsigned long long>(c.stalls));
  if (c.updates > 0) std::printf("updates: %s\n", outputs.healths().c_str());
  if (c.searches > 0)
    std::printf("searches for the pose: %llu, found %llu times\n",
                static_cast<unsigned long long>(c.searches), static_cast<unsigned long long>(c.found));
  std::printf("events: %llu arrived, %llu shed, %llu late; most waiting at once %llu\n",
              static_cast<unsigned long long>(q.events_in),
              static_cast<unsigned long long>(q.events_shed + c.events_shed + thinned),
              static_cast<unsigned long long>(c.events_late),
              static_cast<unsigned long long>(q.most_waiting));
  if (c.updates > 0) std::printf("contours looked at: %s\n", outputs.looked_at().c_str());
  if (outputs.delays().count() > 0)
    std::printf("delay from an update's instant to the outputs: p50 %.2f ms, p99 %.2f ms, largest %.2f ms\n",
                outputs.delays().quantile_ms(0.5), outputs.delays().quantile_ms(0.99),
                outputs.delays().largest_ms());
  if (outputs.delays().late_share() > kLateShare)
    log_warning(text("not real time: ", std::round(100 * outputs.delays().late_share()),
                     " % of the poses came more than ", to_seconds(Delays::kLate),
                     " s late; lower rate_hz or events.most_mev_s, or take a faster machine"));
  if (const auto* link = outputs.link())
    std::printf("MAVLink: %llu frames sent, %llu lost\n",
                static_cast<unsigned long long>(link->counts().sent),
                static_cast<unsigned long long>(link->counts().lost));
  std::printf("peak memory %.1f MB\n", peak_memory_mb());
}

/// When serving began.
struct Beginning {
  double wall_s = evpose::wall_s(), cpu_s = evpose::cpu_s();
};

/// Writes the run folder's summary and report.
Expected<RunOutcome> finish(RunFolder& run, const TrackJob& job, const ServeRequest& request,
                            ServeConfig& config, const Session& session, const StreamQueue& queue,
                            const Beginning& begin) {
  if (session.counts().updates == 0 || session.tracker() == nullptr)
    return session.searching()
               ? Error{request.track.recording, "the stream ended before the first pose was found",
                       "give it seconds more, a better --init, or the calibration's sigmas "
                       "(docs/use/live.md)"}
               : Error{request.track.recording, "the stream ended before the first update",
                       "check that events and IMU arrive and cover the start"};
  RunSummary summary = summarise(job, request.track, *session.tracker(), session.tracker()->calibration());
  summary.events_read = session.counts().events - session.counts().events_shed;
  summary.events_kept += session.counts().events_kept;
  summary.events_shed +=
      queue.counts().events_shed + session.counts().events_shed + session.counts().events_thinned;
  summary.wall_s = wall_s() - begin.wall_s;
  summary.cpu_s = cpu_s() - begin.cpu_s;
  summary.peak_memory_mb = peak_memory_mb();
  config.run = job.config;
  ConfigTable table;
  describe(table, config);
  return run.finish(summary, table);
}

}  // namespace

void describe(ConfigTable& table, FramesConfig& c) {
  table.add("map_heading_deg", c.map_heading_deg, "deg", "compass heading of the map's x axis; 90: east",
            {-360, 360});
  table.add("vehicle_x_m", c.vehicle_x_m, "m", "the vehicle's origin in the IMU's axes", {-100, 100});
  table.add("vehicle_y_m", c.vehicle_y_m, "m", "the vehicle's origin in the IMU's axes", {-100, 100});
  table.add("vehicle_z_m", c.vehicle_z_m, "m", "the vehicle's origin in the IMU's axes", {-100, 100});
  table.add("vehicle_roll_deg", c.vehicle_roll_deg, "deg",
            "the vehicle's axes (forward, left, up) against the IMU's: yaw, then pitch, then roll",
            {-360, 360});
  table.add("vehicle_pitch_deg", c.vehicle_pitch_deg, "deg", "", {-360, 360});
  table.add("vehicle_yaw_deg", c.vehicle_yaw_deg, "deg", "", {-360, 360});
}

void describe(ConfigTable& table, ServeConfig& c) {
  describe(table, c.run);
  table.group("replay", c.replay);
  table.group("queue", c.queue);
  table.group("session", c.session);
  table.group("mavlink", c.mavlink);
  table.group("frames", c.frames);
  table.add("view_address", c.view_address,
            "address that the viewer is bound to; not loopback: anybody on the network may look");
}

Expected<ServeConfig> load_serve_config(const TrackRequest& request) {
  ServeConfig config;
  config.run.tracker.threads = 2;
  config.run.tracker.events.most_mev_s = 6;  // with which two slow cores keep up
  ConfigTable table;
  describe(table, config);
  if (auto ok = apply_settings(table, request.config_file, request.assignments); !ok) return ok.error();
  return config;
}

Expected<int> serve(const ServeRequest& request) {
  auto config = load_serve_config(request.track);
  if (!config) return config.error();
  const std::string& address = request.track.recording;
  const bool live = is_live(address);
  auto job = live ? prepare_source(request, config->run) : prepare(request.track, config->run);
  if (!job) return job.error();
  auto source = open_source(address, *job, config->replay);
  if (!source) return source.error();
  if (const double speed = config->replay.speed; !live && speed != 1)
    log_warning(speed > 0 ? text("not real time: the recording is replayed at ", speed, " times its speed")
                          : std::string("not real time: the recording is replayed as fast as it is tracked"));
  if (!job->setup.places) job->setup.places = std::make_shared<PlaceCache>();
  auto maker = TrackerMaker::create(*job);
  if (!maker) return maker.error();
  const auto placement = read_map_placement(job->map->source);
  if (!placement) return placement.error();
  take_origin(*placement, config->mavlink);
  Outputs outputs(*config, *job, *placement);
  if (auto ok = outputs.open(request, *config, *job); !ok) return ok.error();

  Session session(
      session_config(*config, *job, live), job->recording.has_imu, maker->first_start(),
      live ? std::nullopt : std::optional(job->start.t),
      [&](const TrackerStart& start) { return maker->make(start); },
      {[&](const Update& u, TimeNs offset, Tracker& tracker) { outputs.add(u, offset, tracker); },
       [&](const std::string& why) { outputs.restarted(why); },
       [&](const std::string& what) { outputs.stalled(what); },
       [&](const std::string& words) { outputs.notice(words); }, [&] { return outputs.whereabouts(); },
       [&](const std::string& poses) { outputs.ambiguous(poses); }});
  StreamQueue queue(config->queue);
  const InterruptGuard guard;
  std::signal(SIGHUP, ask_reset);
  const Beginning begin;
  run_session(**source, queue, session, outputs);
  std::signal(SIGHUP, SIG_DFL);
  const bool interrupted = InterruptGuard::interrupted();
  print_outcome(session, queue, outputs);
  const RunVerdict verdict = outputs.verdict();
  int status = verdict.good() ? 0 : 1;
  if (outputs.run() != nullptr) {
    const auto outcome = finish(*outputs.run(), *job, request, *config, session, queue, begin);
    if (!outcome) return outcome.error();
    status = report_run(outcome);
  } else if (session.counts().updates > 0) {
    std::printf("%s\n", verdict_text(verdict, job->findings).c_str());
  }
  return interrupted ? kInterruptedStatus : status;
}

}  // namespace evpose
