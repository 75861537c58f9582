// SPDX-License-Identifier: BSD-3-Clause
#include "engine.h"

#include <atomic>
#include <cstdio>
#include <cstring>
#include <span>

#include "evpose/core/config.h"
#include "evpose/io/bags/event_messages.h"
#include "evpose/io/calibration/calibration.h"
#include "evpose/io/calibration/kalibr.h"
#include "evpose/io/maps/contour_files.h"
#include "evpose/io/maps/ply.h"
#include "evpose/mavlink/frames.h"
#include "evpose/mavlink/link.h"
#include "evpose/serve/session.h"

namespace evpose_ros {
namespace {

using namespace evpose;

constexpr TimeNs kIdle = 5 * kNsPerMs;

struct Setup {
  TrackerSetup tracker;
  TrackerConfig config;
  StartState start;
  bool has_imu = false;
};

Expected<Setup> read_setup(const Parameters& parameters) {
  const std::pair<const char*, const std::string&> needed[] = {
      {"map", parameters.map}, {"calibration", parameters.calibration}, {"init", parameters.init}};
  for (const auto& [name, value] : needed)
    if (value.empty())
      return Error{std::string("parameter ~") + name, "is not given", "see docs/use/live.md"};
  const auto calibration = read_calibration(parameters.calibration);
  if (!calibration) return calibration.error();
  const auto chosen = choose_camera(*calibration);
  if (!chosen) return chosen.error();
  const auto camera = make_camera(*chosen->intrinsics);
  if (!camera) return camera.error();
  auto map = read_contour_map(parameters.map);
  if (!map) return map.error();
  if (!parameters.occluders.empty()) {
    auto mesh = read_ply_mesh(parameters.occluders, map->anchor);
    if (!mesh) return mesh.error();
    map->occluders = std::move(*mesh);
  }
  Setup out;
  out.has_imu = chosen->T_cam_imu.has_value();
  out.tracker = {*camera,
                 chosen->T_cam_imu.value_or(Pose{}).inverse(),
                 out.has_imu ? MotionModel::imu : MotionModel::constant_velocity,
                 {},
                 nullptr,
                 chosen->intrinsics};
  out.tracker.places = std::make_shared<PlaceCache>();
  if (calibration->imu_noise) out.tracker.imu_noise = *calibration->imu_noise;
  if (!parameters.imu_model.empty()) {
    const auto noise = read_imu_noise(parameters.imu_model);
    if (!noise) return noise.error();
    out.tracker.imu_noise = *noise;
  }
  out.tracker.map = std::make_shared<const ContourMap>(std::move(*map));
  double v[7];
  if (std::sscanf(parameters.init.c_str(), "%lf,%lf,%lf,%lf,%lf,%lf,%lf", v, v + 1, v + 2, v + 3, v + 4,
                  v + 5, v + 6) != 7)
    return Error{"parameter ~init", "is no pose", "give x,y,z,qx,qy,qz,qw"};
  out.start.T_map_body = {Eigen::Quaterniond(v[6], v[3], v[4], v[5]).normalized(), {v[0], v[1], v[2]}};
  auto& fusion = out.config.fusion;
  fusion.start_velocity_sigma_m_s = std::max(fusion.start_velocity_sigma_m_s, 0.5);
  fusion.start_angular_rate_sigma_rad_s = std::max(fusion.start_angular_rate_sigma_rad_s, 0.5);
  ConfigTable table;
  describe(table, out.config);
  for (const std::string& setting : parameters.settings) {
    const auto equals = setting.find('=');
    if (auto ok =
            table.set(setting.substr(0, equals),
                      equals == std::string::npos ? "" : setting.substr(equals + 1), "parameter ~settings");
        !ok)
      return ok.error();
  }
  return out;
}

template <std::size_t N>
std::array<double, N> numbers(const auto& matrix) {
  std::array<double, N> out{};
  const auto columns = static_cast<std::size_t>(matrix.cols());
  for (std::size_t i = 0; i < N; ++i)
    out[i] = matrix(static_cast<Eigen::Index>(i / columns), static_cast<Eigen::Index>(i % columns));
  return out;
}

class TrackingEngine : public Engine {
 public:
  TrackingEngine(Setup setup, Callbacks callbacks)
      : setup_(std::move(setup)),
        callbacks_(std::move(callbacks)),
        queue_({}),
        session_(
            session_config(), setup_.has_imu, {setup_.start}, std::nullopt,
            [this](const TrackerStart& start) { return make(start); },
            {[this](const Update& u, TimeNs, const Tracker&) { add(u); }, [](const std::string&) {},
             [](const std::string&) {}, [this](const std::string& words) { callbacks_.notice(words); }}) {}

  Expected<std::unique_ptr<Tracker>> make(const TrackerStart& start) const {
    return make_tracker(setup_.tracker, setup_.config, start);
  }
  const StartState& start() const { return setup_.start; }

  std::string add_events(const std::string& type, const std::string& md5, const std::byte* bytes,
                         std::size_t size) override {
    BagTopic topic;
    topic.name = "events";
    topic.type = type;
    topic.md5 = md5;
    topic.wire = Wire::ros1;
    if (!is_event_array(type) && !is_event_packet(type))
      return "topic events: messages of type " + type + " are no events";
    const auto parsed = parse_event_message(topic, {0, 0, std::span(bytes, size)}, "topic events");
    if (!parsed) return parsed.error().line();
    decoder_.begin(*parsed, "topic events");
    EventBlock block;
    for (bool done = false; !done;) {
      block.start();
      const auto ended = decoder_.decode(block);
      if (!ended) return ended.error().line();
      done = *ended;
      if (block.count == 0) continue;
      StreamItem item;
      item.kind = StreamItem::Kind::events;
      item.events.base = block.base_us * kNsPerUs;
      item.events.events.assign(block.events.begin(),
                                block.events.begin() + static_cast<std::ptrdiff_t>(block.count));
      queue_.push(std::move(item));
    }
    return {};
  }

  void add_imu(std::int64_t t_ns, const std::array<double, 3>& gyro,
               const std::array<double, 3>& accel) override {
    StreamItem item;
    item.kind = StreamItem::Kind::imu;
    item.imu = {{t_ns, Eigen::Vector3d(gyro.data()), Eigen::Vector3d(accel.data())}};
    if (item.imu[0].gyro.allFinite() && item.imu[0].accel.allFinite()) queue_.push(std::move(item));
  }

  void work() override {
    StreamItem item;
    const bool any = queue_.pop(item, kIdle);
    const TimeNs now = monotonic_ns();
    if (any) session_.take(item, now);
    session_.tick(now);
    if (reset_.exchange(false)) session_.reset("asked for by the service");
  }
  void reset() override { reset_ = true; }

  Status status() const override {
    const auto queued = queue_.counts();
    return {to_string(health_),         reason_,          session_.counts().updates,
            session_.counts().restarts, queued.events_in, queued.events_shed + session_.counts().events_shed};
  }

  std::vector<std::array<float, 3>> map_points() const override {
    std::vector<std::array<float, 3>> out;
    const ContourMap& map = *setup_.tracker.map;
    for (std::size_t i = 0; i < map.points.size(); ++i) {
      const Eigen::Vector3f p = map.position(i).cast<float>();
      out.push_back({p.x(), p.y(), p.z()});
    }
    return out;
  }

 private:
  SessionConfig session_config() const {
    SessionConfig out;
    out.search = setup_.config.relocalization;
    return out;
  }
  void add(const Update& u) {
    health_ = u.health;
    if (!u.reason.empty()) reason_ = u.reason;
    if (u.health != Health::tracking && u.health != Health::degraded) return;
    const RosState s = to_ros(u, Pose{});
    callbacks_.pose({u.t, numbers<3>(s.T_map_base.p), numbers<4>(s.T_map_base.q.coeffs()),
                     numbers<3>(s.velocity_base), numbers<3>(s.rates_base), numbers<36>(s.covariance),
                     numbers<9>(s.velocity_covariance_base)});
  }

  Setup setup_;
  Callbacks callbacks_;
  StreamQueue queue_;
  Session session_;
  EventMessageDecoder decoder_;
  std::atomic<bool> reset_{false};
  Health health_ = Health::waiting;
  std::string reason_;
};

}  // namespace

std::unique_ptr<Engine> Engine::create(const Parameters& parameters, const Callbacks& callbacks,
                                       std::string& error) {
  auto setup = read_setup(parameters);
  if (!setup) return error = setup.error().line(), nullptr;
  auto engine = std::make_unique<TrackingEngine>(std::move(*setup), callbacks);
  if (const auto possible = engine->make({engine->start()}); !possible)
    return error = possible.error().line(), nullptr;
  return engine;
}

}  // namespace evpose_ros
