// SPDX-License-Identifier: BSD-3-Clause
// One update of the tracker by stage, at two image sizes, with either field; all on one core.
#include <benchmark/benchmark.h>

#include <ctime>

#include <algorithm>

#include "evpose/bench/micro/scene.h"
#include "evpose/map/visible_set.h"
#include "evpose/tracker/tracker.h"

namespace evpose::bench {
namespace {

constexpr double kRate_hz = 300;
constexpr double kRun_s = 0.3;
constexpr TimeNs kStart_ns = 10'000'000;

/// Processor time of this thread: what else the machine does is not counted.
double clock_s() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// A third of a second of tracking under a load of `Mev_s` million events a second.
void update(benchmark::State& state) {
  const Scene scene = make_scene(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
  const double rate = 1e6 * static_cast<double>(state.range(2));
  TrackerConfig config;
  config.rate_hz = kRate_hz;
  config.registration = state.range(3) == 0 ? RegistrationKind::events : RegistrationKind::temporal_field;
  // The random load must not move the pose, nor start a search for it; all stages run all the same.
  config.health.innovation_gate = -1;
  config.relocalization.on = false;
  config.fusion.cv_accel_density = config.fusion.cv_angular_density = 1e-3;
  config.fusion.start_position_sigma_m = config.fusion.start_rotation_sigma_rad = 3e-4;
  config.fusion.start_velocity_sigma_m_s = config.fusion.start_angular_rate_sigma_rad_s = 1e-3;
  TrackerSetup setup;
  setup.camera = scene.camera;
  setup.motion = MotionModel::constant_velocity;
  setup.map = std::make_shared<const ContourMap>(scene.map);
  StartState start;
  start.T_map_body = scene.T_map_cam;
  start.velocity = scene.velocity;
  start.angular_rate_body = scene.angular_rate;
  const EventPacket packet = make_events(scene, static_cast<std::size_t>(rate * kRun_s), kRun_s);
  std::vector<double> events, choose, align, all;
  double points = 0;
  for (auto _ : state) {
    auto tracker = std::move(Tracker::create(setup, config, start, clock_s)).value();
    tracker->on_update([&](const Update& u) {
      if (u.t <= kStart_ns) return;  // the first choice of points belongs to the start
      events.push_back(u.times.events_s);
      choose.push_back(u.times.choose_s);
      align.push_back(u.times.register_s);
      all.push_back(u.times.after_newest_event_s());
      points += u.points;
    });
    tracker->add_events(packet);
  }
  const auto quantile_ms = [](std::vector<double>& v, double q) {
    const auto at = v.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(v.size() - 1));
    std::nth_element(v.begin(), at, v.end());
    return 1e3 * *at;
  };
  state.counters["points"] = points / static_cast<double>(all.size());
  state.counters["events_p50_ms"] = quantile_ms(events, 0.5);
  state.counters["choose_p50_ms"] = quantile_ms(choose, 0.5);
  state.counters["choose_p99_ms"] = quantile_ms(choose, 0.99);
  state.counters["register_p50_ms"] = quantile_ms(align, 0.5);
  state.counters["register_p99_ms"] = quantile_ms(align, 0.99);
  state.counters["pose_p50_ms"] = quantile_ms(all, 0.5);
  state.counters["pose_p99_ms"] = quantile_ms(all, 0.99);
}
BENCHMARK(update)
    ->ArgNames({"width", "height", "Mev_s_in", "temporal_field"})
    ->Args({640, 480, 2, 0})
    ->Args({640, 480, 2, 1})
    ->Args({1280, 720, 2, 0})
    ->Args({1280, 720, 2, 1})
    ->Args({1280, 720, 20, 0})
    ->Unit(benchmark::kMillisecond)
    ->Iterations(4);

/// The choice of points when the view has moved (the dearest moment of an update), in a map of so many rooms.
void visible_refresh(benchmark::State& state) {
  Scene scene = make_scene(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
  repeat_room(scene.map, static_cast<int>(state.range(2)));
  const ContourIndex index(scene.map);
  VisibleSetConfig config;
  config.refresh_px = 0;
  VisibleSet visible(index, *scene.camera, config);
  Pose pose = scene.T_map_cam;
  std::size_t points = 0;
  for (auto _ : state) {
    pose.p.y() += 1e-4;
    points = visible.choose(pose).size();
  }
  state.counters["points"] = static_cast<double>(points);
  state.counters["map_points"] = static_cast<double>(scene.map.points.size());
}
BENCHMARK(visible_refresh)
    ->ArgNames({"width", "height", "rooms"})
    ->Args({640, 480, 1})
    ->Args({1280, 720, 1})
    ->Args({1280, 720, 10})
    ->Args({1280, 720, 100})
    ->Args({1280, 720, 250})
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace evpose::bench
