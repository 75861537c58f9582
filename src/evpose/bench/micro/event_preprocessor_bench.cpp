// SPDX-License-Identifier: BSD-3-Clause
// Noise filter and time surface: speed by image size, and by layout of the events in memory.
#include <benchmark/benchmark.h>

#include <cmath>

#include "evpose/bench/micro/scene.h"
#include "evpose/event/event_preprocessor.h"

namespace evpose::bench {
namespace {

constexpr double kSpan_s = 0.1;

void front(benchmark::State& state) {
  const int width = static_cast<int>(state.range(0)), height = static_cast<int>(state.range(1));
  const double rate = 1e6 * static_cast<double>(state.range(2));
  const Scene scene = make_scene(width, height);
  EventPacket packet = make_events(scene, static_cast<std::size_t>(rate * kSpan_s), kSpan_s);
  EventPreprocessor front(width, height, {});
  front.set_motion(200);
  for (auto _ : state) {
    front.take(packet, packet.events);
    front.clear_kept();
    packet.base += from_seconds(kSpan_s);
  }
  state.counters["Mev/s"] = benchmark::Counter(
      1e-6 * static_cast<double>(state.iterations() * packet.events.size()), benchmark::Counter::kIsRate);
  state.counters["kept"] =
      static_cast<double>(front.counts().kept) / static_cast<double>(front.counts().read);
}
BENCHMARK(front)
    ->ArgNames({"width", "height", "Mev_s_in"})
    ->Args({640, 480, 2})
    ->Args({640, 480, 20})
    ->Args({1280, 720, 2})
    ->Args({1280, 720, 20})
    ->Unit(benchmark::kMillisecond);

/// What the relatives do for every update: the whole image's exponential surface, blurred, and its gradient.
void dense_surface(benchmark::State& state) {
  const int width = static_cast<int>(state.range(0)), height = static_cast<int>(state.range(1));
  const auto w = static_cast<std::size_t>(width), n = w * static_cast<std::size_t>(height);
  std::vector<double> age_s(n), surface(n), rows(n), blurred(n), gx(n), gy(n);
  for (std::size_t i = 0; i < n; ++i) age_s[i] = 1e-4 * static_cast<double>(i * 7919 % 1000);
  constexpr double kBlur[] = {0.0625, 0.25, 0.375, 0.25, 0.0625};
  for (auto _ : state) {
    for (std::size_t i = 0; i < n; ++i) surface[i] = std::exp(-age_s[i] / 0.02);
    for (std::size_t i = 2; i < n - 2; ++i) {
      rows[i] = 0;
      for (std::size_t k = 0; k < 5; ++k) rows[i] += kBlur[k] * surface[i + k - 2];
    }
    for (std::size_t i = 2 * w; i < n - 2 * w; ++i) {
      blurred[i] = 0;
      for (std::size_t k = 0; k < 5; ++k) blurred[i] += kBlur[k] * rows[i + k * w - 2 * w];
    }
    for (std::size_t i = w + 1; i < n - w - 1; ++i) {
      const double *above = &blurred[i - w], *here = &blurred[i], *below = &blurred[i + w];
      gx[i] = above[1] - above[-1] + 2 * (here[1] - here[-1]) + below[1] - below[-1];
      gy[i] = below[-1] + 2 * below[0] + below[1] - above[-1] - 2 * above[0] - above[1];
    }
    benchmark::DoNotOptimize(gx.data());
    benchmark::DoNotOptimize(gy.data());
  }
}
BENCHMARK(dense_surface)
    ->ArgNames({"width", "height"})
    ->Args({640, 480})
    ->Args({1280, 720})
    ->Unit(benchmark::kMillisecond);

// The layouts that were candidates for `Event`: the pass over the events is the same, only their storage
// differs.
struct Plain {  // 16 bytes, absolute time
  std::int64_t t_us;
  std::uint16_t x, y;
  std::uint8_t on;
};
struct Columns {  // one array per field
  std::vector<std::int64_t> t_us;
  std::vector<std::uint16_t> x, y;
  std::vector<std::uint8_t> on;
};

struct Pass {
  Pass() : filter(1280, 720, {}), surface(1280, 720) { filter.set_motion(200); }
  void take(std::int64_t t_us, int x, int y, bool on) {
    const auto stamp = static_cast<std::uint32_t>(t_us + 1);
    if (filter.keep(x, y, stamp)) surface.insert(x, y, on ? Polarity::on : Polarity::off, stamp);
  }
  NoiseFilter filter;
  TimeSurface surface;
};

template <class Body>
void layout(benchmark::State& state, std::size_t bytes, const Body& body) {
  static const EventPacket packet = make_events(make_scene(1280, 720), 2'000'000, kSpan_s);
  Pass pass;
  std::int64_t shift_us = 0;
  body(state, packet, pass, shift_us);
  state.counters["Mev/s"] = benchmark::Counter(
      1e-6 * static_cast<double>(state.iterations() * packet.events.size()), benchmark::Counter::kIsRate);
  state.counters["bytes"] = static_cast<double>(bytes);
}

void layout_packed(benchmark::State& state) {
  layout(state, sizeof(Event),
         [](benchmark::State& s, const EventPacket& packet, Pass& pass, std::int64_t& shift) {
           for (auto _ : s) {
             for (const Event& e : packet.events) pass.take(shift + e.dt_us, e.x, e.y, e.on != 0);
             shift += from_seconds(kSpan_s) / kNsPerUs;
           }
         });
}
void layout_plain(benchmark::State& state) {
  layout(state, sizeof(Plain),
         [](benchmark::State& s, const EventPacket& packet, Pass& pass, std::int64_t& shift) {
           std::vector<Plain> events;
           for (const Event& e : packet.events)
             events.push_back({e.dt_us, e.x, e.y, static_cast<std::uint8_t>(e.on)});
           for (auto _ : s) {
             for (const Plain& e : events) pass.take(shift + e.t_us, e.x, e.y, e.on != 0);
             shift += from_seconds(kSpan_s) / kNsPerUs;
           }
         });
}
void layout_columns(benchmark::State& state) {
  layout(state, 13, [](benchmark::State& s, const EventPacket& packet, Pass& pass, std::int64_t& shift) {
    Columns c;
    for (const Event& e : packet.events) {
      c.t_us.push_back(e.dt_us);
      c.x.push_back(e.x);
      c.y.push_back(e.y);
      c.on.push_back(e.on);
    }
    for (auto _ : s) {
      for (std::size_t i = 0; i < c.x.size(); ++i) pass.take(shift + c.t_us[i], c.x[i], c.y[i], c.on[i] != 0);
      shift += from_seconds(kSpan_s) / kNsPerUs;
    }
  });
}
BENCHMARK(layout_packed)->Unit(benchmark::kMillisecond);
BENCHMARK(layout_plain)->Unit(benchmark::kMillisecond);
BENCHMARK(layout_columns)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace evpose::bench
