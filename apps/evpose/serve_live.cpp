// SPDX-License-Identifier: BSD-3-Clause
#include "serve_live.h"

#include <array>
#include <csignal>
#include <cstdio>
#include <limits>
#include <memory>
#include <numeric>
#include <thread>
#include <vector>

#include "commands.h"
#include "evpose/core/log.h"
#include "evpose/io/calibration/calibration.h"
#include "evpose/io/calibration/kalibr.h"
#include "evpose/io/files/config_yaml.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/mavlink/link.h"
#include "evpose/run/start.h"
#include "evpose/serve/metavision_source.h"
#include "evpose/serve/packet_source.h"
#include "evpose/view/viewer.h"
#include "interrupt.h"

namespace evpose {
namespace {

constexpr TimeNs kIdle = 5 * kNsPerMs;     // the longest wait for data before links are looked after
constexpr double kAgainPosition_m = 0.03;  // of a pose that is some time old
constexpr double kAgainRotation_rad = 0.02;
constexpr double kAgainSpeed_m_s = 0.5;

volatile std::sig_atomic_t g_reset = 0;
void ask_reset(int) { g_reset = 1; }

/// How long after its instant each pose was on the socket, to a hundredth of a millisecond.
class Delays {
 public:
  void add(TimeNs delay) {
    const TimeNs bin = std::clamp<TimeNs>(delay / kBin, 0, static_cast<TimeNs>(bins_.size()) - 1);
    ++bins_[static_cast<std::size_t>(bin)];
    ++count_;
  }
  std::uint64_t count() const { return count_; }
  double quantile_ms(double share) const {
    const auto wanted = static_cast<std::uint64_t>(share * static_cast<double>(count_));
    std::uint64_t seen = 0;
    std::size_t bin = 0;
    while (bin + 1 < bins_.size() && (seen += bins_[bin]) <= wanted) ++bin;
    return 1e3 * to_seconds(static_cast<TimeNs>(bin) * kBin);
  }

 private:
  static constexpr TimeNs kBin = 10 * kNsPerUs;
  std::vector<std::uint64_t> bins_ = std::vector<std::uint64_t>(100'000);
  std::uint64_t count_ = 0;
};

/// As prepare(), for a source that has no folder: calibration, map and start are all given.
Expected<TrackJob> prepare_source(const ServeRequest& request, const RunConfig& config) {
  const TrackRequest& track = request.track;
  if (track.calibration.empty())
    return Error{track.recording, "a source has no calibration of its own", "give one with --calibration"};
  const auto calibration = read_calibration(track.calibration);
  if (!calibration) return calibration.error();
  const auto chosen = choose_camera(*calibration);
  if (!chosen) return chosen.error();
  TrackJob job;
  job.config = config;
  Recording& recording = job.recording;
  recording.folder = recording.name = track.recording;
  recording.camera = *chosen->intrinsics;
  recording.calibration_path = track.calibration;
  recording.has_imu = chosen->T_cam_imu.has_value() && (!is_metavision_address(track.recording) ||
                                                        metavision_address_has_imu(track.recording));
  recording.T_cam_body = chosen->T_cam_imu.value_or(Pose{});
  recording.last_ns = std::numeric_limits<TimeNs>::max();
  if (calibration->imu_noise) recording.imu_noise = *calibration->imu_noise;
  if (!request.imu_model.empty()) {
    const auto noise = read_imu_noise(request.imu_model);
    if (!noise) return noise.error();
    recording.imu_noise = *noise;
  }
  auto map = load_map(track, recording);
  if (!map) return map.error();
  auto camera = make_camera(recording.camera);
  if (!camera) return Error{track.calibration, camera.error().what, camera.error().fix};
  const auto start = choose_start(track.init, recording, {}, {track.init_sigma[0], track.init_sigma[1]},
                                  &job.config.tracker.fusion);
  if (!start) return start.error();
  job.map = *map;
  job.start = *start;
  job.setup = {*camera, recording.T_cam_body.inverse(),
               recording.has_imu ? MotionModel::imu : MotionModel::constant_velocity, recording.imu_noise,
               *map};
  return job;
}

/// recording.yaml knows best, then the map file, then the configuration.
VehicleFrames vehicle_frames(const FramesConfig& c, const Recording& recording,
                             const MapPlacement& placement) {
  VehicleFrames out;
  constexpr double kRad = M_PI / 180;
  out.T_ned_map = recording.T_ned_map   ? Pose::from_matrix(*recording.T_ned_map)
                  : placement.T_ned_map ? *placement.T_ned_map
                                        : ned_from_heading(c.map_heading_deg * kRad);
  out.T_body_vehicle.p = {c.vehicle_x_m, c.vehicle_y_m, c.vehicle_z_m};
  out.T_body_vehicle.q = so3::exp({0, 0, c.vehicle_yaw_deg * kRad}) *
                         so3::exp({0, c.vehicle_pitch_deg * kRad, 0}) *
                         so3::exp({c.vehicle_roll_deg * kRad, 0, 0});
  return out;
}

/// The map's own origin, where the configuration names none.
void take_origin(const MapPlacement& placement, MavlinkConfig& c) {
  if (!placement.origin_llh || c.origin_latitude_deg != 0 || c.origin_longitude_deg != 0) return;
  c.origin_latitude_deg = placement.origin_llh->x();
  c.origin_longitude_deg = placement.origin_llh->y();
  if (c.origin_altitude_m == 0) c.origin_altitude_m = placement.origin_llh->z();
}

/// Everything that hears of the poses.
class Outputs {
 public:
  Outputs(const ServeConfig& config, const TrackJob& job, const MapPlacement& placement)
      : frames_(vehicle_frames(config.frames, job.recording, placement)) {}

  Status open(const ServeRequest& request, const ServeConfig& config, const TrackJob& job) {
    if (request.view >= 0) {
      auto viewer = Viewer::start({config.view_address, request.view}, job.recording.name, *job.map);
      if (!viewer) return viewer.error();
      viewer_ = std::move(*viewer);
      std::fprintf(stderr, "evpose: open %s in a browser\n", viewer_->address().c_str());
    }
    if (!request.mavlink.empty()) {
      auto link = mavlink::Link::open(request.mavlink);
      if (!link) return link.error();
      link_ = std::move(*link);
      reporter_ = std::make_unique<mavlink::Reporter>(config.mavlink, frames_,
                                                      [this](mavlink::Bytes frame) { link_->send(frame); });
    }
    if (!request.track.output.empty()) {
      auto run = RunFolder::create(request.track.output);
      if (!run) return run.error();
      run_ = std::make_unique<RunFolder>(std::move(*run));
    }
    return {};
  }

  void add(const Update& u, TimeNs data_to_monotonic, const Tracker& tracker) {
    if (reporter_) reporter_->add(u, data_to_monotonic);
    const TimeNs delay = monotonic_ns() - (u.t + data_to_monotonic);
    delays_.add(delay);
    if (viewer_) viewer_->add(u, tracker, 1e3 * to_seconds(delay));
    health_ = u.health;
    ++updates_[static_cast<std::size_t>(u.health)];
    if (!u.reason.empty()) log_detail(text(to_string(u.health), ": ", u.reason));
    if (run_ && u.t > recorded_until_) run_->add(u);
    recorded_until_ = std::max(recorded_until_, u.t);
  }
  void restarted(const std::string& why) {
    if (reporter_) reporter_->restarted(why);
  }
  void notice(const std::string& words) {
    log_warning(words);
    if (viewer_) viewer_->notice(words);
  }
  void stalled(const std::string& what) {
    if (reporter_) reporter_->stalled(what);
  }
  void look_after(TimeNs now_ns) {
    if (!reporter_) return;
    for (int i = 0; i < 16; ++i) {  // whatever floods us does not keep us from tracking
      const auto bytes = link_->receive();
      if (bytes.empty()) break;
      reporter_->receive(bytes, monotonic_ns());
    }
    reporter_->tick(now_ns);
    if (const std::string words = link_->take_notice(); !words.empty()) notice(words);
  }

  Health health() const { return health_; }
  /// How the updates were judged: "tracking 98.5 %, initialising 1.5 %"; empty without updates.
  std::string healths() const {
    const auto all = std::accumulate(updates_.begin(), updates_.end(), std::uint64_t{0});
    std::string out;
    for (const Health h :
         {Health::tracking, Health::degraded, Health::lost, Health::initialising, Health::waiting}) {
      const std::uint64_t count = updates_[static_cast<std::size_t>(h)];
      if (count == 0) continue;
      std::array<char, 40> share{};
      std::snprintf(share.data(), share.size(), " %.2f %%",
                    100 * static_cast<double>(count) / static_cast<double>(all));
      out += (out.empty() ? "" : ", ") + std::string(to_string(h)) + share.data();
    }
    return out;
  }
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
  std::printf("events: %llu arrived, %llu shed, %llu late; most waiting at once %llu\n",
              static_cast<unsigned long long>(q.events_in),
              static_cast<unsigned long long>(q.events_shed + c.events_shed + thinned),
              static_cast<unsigned long long>(c.events_late),
              static_cast<unsigned long long>(q.most_waiting));
  if (outputs.delays().count() > 0)
    std::printf("delay from an update's instant to the outputs: p50 %.2f ms, p99 %.2f ms, largest %.2f ms\n",
                outputs.delays().quantile_ms(0.5), outputs.delays().quantile_ms(0.99),
                outputs.delays().quantile_ms(1));
  if (const auto* link = outputs.link())
    std::printf("MAVLink: %llu frames sent, %llu lost\n",
                static_cast<unsigned long long>(link->counts().sent),
                static_cast<unsigned long long>(link->counts().lost));
  std::printf("peak memory %.1f MB\n", peak_memory_mb());
}

Expected<RunOutcome> finish(RunFolder& run, const TrackJob& job, const ServeRequest& request,
                            ServeConfig& config, const Session& session, const StreamQueue& queue,
                            double wall_start, double cpu_start) {
  RunSummary summary = summarise(job, request.track, *session.tracker());
  summary.events_read = session.counts().events - session.counts().events_shed;
  summary.events_kept += session.counts().events_kept;
  summary.events_shed +=
      queue.counts().events_shed + session.counts().events_shed + session.counts().events_thinned;
  summary.wall_s = wall_s() - wall_start;
  summary.cpu_s = cpu_s() - cpu_start;
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
  config.run.tracker.relocalization.on = false;  // a search takes longer than the data it looks at
  config.run.tracker.threads = 2;
  config.run.tracker.events.most_mev_s = 6;  // with which two slow cores keep up
  ConfigTable table;
  describe(table, config);
  if (!request.config_file.empty())
    if (auto ok = apply_yaml(table, request.config_file); !ok) return ok.error();
  for (const auto& assignment : request.assignments)
    if (auto ok = apply_assignment(table, assignment); !ok) return ok.error();
  return config;
}

Expected<int> serve(const ServeRequest& request) {
  auto config = load_serve_config(request.track);
  if (!config) return config.error();
  const std::string& address = request.track.recording;
  const bool live = is_packet_address(address) || is_metavision_address(address);
  const auto job = live ? prepare_source(request, config->run) : prepare(request.track, config->run);
  if (!job) return job.error();
  std::unique_ptr<Source> source;
  if (live) {
    const auto open = is_metavision_address(address) ? open_metavision_source : open_packet_source;
    auto opened = open(address, job->recording.camera.size);
    if (!opened) return opened.error();
    source = std::move(*opened);
  } else {
    source = std::make_unique<ReplaySource>(job->recording, config->replay);
  }
  std::unique_ptr<Tracker> first;  // made before the data come: it takes a while
  const auto make = [&](const StartState& start, bool again) -> Expected<std::unique_ptr<Tracker>> {
    if (first && !again && start.t == job->start.t) return std::move(first);
    TrackerConfig tracker = job->config.tracker;
    if (again) {
      auto& fusion = tracker.fusion;
      fusion.start_position_sigma_m = std::max(fusion.start_position_sigma_m, kAgainPosition_m);
      fusion.start_rotation_sigma_rad = std::max(fusion.start_rotation_sigma_rad, kAgainRotation_rad);
      fusion.start_velocity_sigma_m_s = std::max(fusion.start_velocity_sigma_m_s, kAgainSpeed_m_s);
    }
    return Tracker::create(job->setup, tracker, start, wall_s);
  };
  auto made = make(job->start, false);
  if (!made) return made.error();
  first = std::move(*made);
  const auto placement = read_map_placement(job->map->source);
  if (!placement) return placement.error();
  take_origin(*placement, config->mavlink);
  Outputs outputs(*config, *job, *placement);
  if (auto ok = outputs.open(request, *config, *job); !ok) return ok.error();

  Session session(
      config->session, job->recording.has_imu, job->start, live ? std::nullopt : std::optional(job->start.t),
      make,
      {[&](const Update& u, TimeNs offset, const Tracker& tracker) { outputs.add(u, offset, tracker); },
       [&](const std::string& why) { outputs.restarted(why); },
       [&](const std::string& what) { outputs.stalled(what); },
       [&](const std::string& words) { outputs.notice(words); }});
  StreamQueue queue(config->queue);
  const InterruptGuard guard;
  std::signal(SIGHUP, ask_reset);
  const double wall_start = wall_s(), cpu_start = cpu_s();
  {
    const SourceThread thread(*source, queue);
    StreamItem item;
    bool ended = false;
    while (!ended && !InterruptGuard::interrupted()) {
      if (queue.pop(item, kIdle)) {
        session.take(item, monotonic_ns());
        ended = item.kind == StreamItem::Kind::end;
      }
      const TimeNs now = monotonic_ns();
      session.tick(now);
      outputs.look_after(now);
      if (g_reset != 0) {
        g_reset = 0;
        session.reset("asked for by a signal");
      }
    }
  }
  std::signal(SIGHUP, SIG_DFL);
  const bool interrupted = InterruptGuard::interrupted();
  print_outcome(session, queue, outputs);
  if (outputs.run() != nullptr) {
    if (session.counts().updates == 0 || session.tracker() == nullptr)
      return Error{request.track.recording, "the stream ended before the first update",
                   "check that events and IMU arrive and cover the start"};
    const auto outcome =
        finish(*outputs.run(), *job, request, *config, session, queue, wall_start, cpu_start);
    const int status = report_run(outcome);
    return interrupted ? kInterruptedStatus : status;
  }
  return interrupted ? kInterruptedStatus : outputs.health() == Health::lost ? 1 : 0;
}

}  // namespace evpose
