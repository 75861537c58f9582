// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/event_sensor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "evpose/core/config.h"
#include "evpose/io/files/test_files.h"
#include "evpose/sim/sensors/camera_rig.h"
#include "evpose/sim/world/random.h"

namespace evpose::sim {
namespace {

constexpr EventSensorPreset kSensors[] = {EventSensorPreset::imx636, EventSensorPreset::dvxplorer,
                                          EventSensorPreset::davis346};

EventCameraConfig pixels(EventSensorPreset preset) {
  EventSensorConfig config;
  config.preset = preset;
  const auto values = with_preset_values(config);
  EXPECT_TRUE(values.ok());
  return *values;
}

TEST(EventSensor, WithoutAPresetThePixelsAreTheTypicalOnes) {
  const EventCameraConfig typical, own = pixels(EventSensorPreset::typical);
  EXPECT_EQ(own.threshold_on, typical.threshold_on);
  EXPECT_EQ(own.bandwidth_hz_per_cd_m2, typical.bandwidth_hz_per_cd_m2);
  EXPECT_EQ(own.reference_spread, typical.reference_spread);
}

TEST(EventSensor, WhatIsSetPrevailsInAnyOrder) {
  for (const bool preset_first : {true, false}) {
    EventSensorConfig config;
    ConfigTable table;
    table.group("events", config);
    const auto choose = [&] { return table.set("events.preset", "davis346", "test").ok(); };
    ASSERT_TRUE(!preset_first || choose());
    ASSERT_TRUE(table.set("events.threshold_on", "0.25", "test").ok());
    ASSERT_TRUE(table.set("events.leak_hz", "0", "test").ok());
    ASSERT_TRUE(preset_first || choose());
    const auto values = with_preset_values(config);
    ASSERT_TRUE(values.ok());
    EXPECT_EQ(values->threshold_on, 0.25);
    EXPECT_EQ(values->leak_hz, 0);
    EXPECT_EQ(values->threshold_off, pixels(EventSensorPreset::davis346).threshold_off);
  }
}

TEST(EventSensor, SettledValuesStayAsTheyAre) {
  for (const EventSensorPreset preset : kSensors) {
    EventSensorConfig config;
    config.preset = preset;
    const auto once = with_preset_values(config);
    ASSERT_TRUE(once.ok());
    EventSensorConfig settled = *once;
    settled.preset = EventSensorPreset::typical;
    const auto twice = with_preset_values(settled);
    ASSERT_TRUE(twice.ok());
    EXPECT_EQ(twice->threshold_off, once->threshold_off);
    EXPECT_EQ(twice->shot_noise_dark_hz, once->shot_noise_dark_hz);
    EXPECT_EQ(twice->bandwidth_max_hz, once->bandwidth_max_hz);
  }
}

TEST(EventSensor, ThresholdsFollowThePublishedContrasts) {
  EXPECT_NEAR(pixels(EventSensorPreset::imx636).threshold_on, std::log(1.25), 1e-3);
  EXPECT_NEAR(pixels(EventSensorPreset::davis346).threshold_on, std::log(1.143), 1e-3);
  EXPECT_NEAR(pixels(EventSensorPreset::davis346).threshold_off, std::log(1.225), 1e-3);
  // Nearly all pixels answer to a contrast of 27.5 %.
  const EventCameraConfig dvx = pixels(EventSensorPreset::dvxplorer);
  EXPECT_GT(std::log(1.275), dvx.threshold_on + dvx.threshold_sigma);
}

// Latency of the first event of a step of 80 %: what the data sheets call latency.
double step_latency_us(EventSensorPreset preset, double lux_on_chip) {
  EventCameraConfig config = pixels(preset);
  config.threshold_sigma = config.reference_spread = config.leak_hz = 0;
  config.shot_noise_dark_hz = config.shot_noise_bright_hz = config.hot_pixel_fraction = 0;
  // f/2, transmission 0.9: E = pi / 4 * 0.9 * L / 4.
  const auto level = static_cast<float>(lux_on_chip / (std::numbers::pi / 16 * 0.9));
  EventPixels sensor({1, 1}, config, 1);
  std::vector<SimEvent> events;
  sensor.start(0, 0, level);
  sensor.advance(0, 0, kNsPerMs, level, level, events);
  sensor.advance(0, kNsPerMs, kNsPerMs + kNsPerUs, level, 1.8F * level, events);
  sensor.advance(0, kNsPerMs + kNsPerUs, 200 * kNsPerMs, 1.8F * level, 1.8F * level, events);
  EXPECT_FALSE(events.empty());
  return events.empty() ? 0 : 1e-3 * static_cast<double>(events[0].t - kNsPerMs);
}

TEST(EventSensor, LatencyIsThatOfTheDataSheetsAndGrowsInTheDark) {
  EXPECT_LT(step_latency_us(EventSensorPreset::imx636, 1000), 100);
  EXPECT_GT(step_latency_us(EventSensorPreset::imx636, 1000), 10);
  for (const EventSensorPreset preset : kSensors) {
    EXPECT_LT(step_latency_us(preset, 1000), 1000);
    EXPECT_GT(step_latency_us(preset, 1), 300);
    EXPECT_GT(step_latency_us(preset, 1), 10 * step_latency_us(preset, 1000));
  }
}

TEST(Vignetting, FallsFromThePrincipalPointToTheGivenLossInTheFarthestCorner) {
  CameraConfig camera;
  for (const float gain : lens_gain(camera)) ASSERT_EQ(gain, 1);
  camera.vignetting = 0.6;
  const auto gain = lens_gain(camera);
  const CameraIntrinsics c = intrinsics(camera);
  const auto at = [&](int x, int y) {
    return static_cast<double>(gain[static_cast<std::size_t>(y) * c.size.width + x]);
  };
  EXPECT_NEAR(*std::min_element(gain.begin(), gain.end()), 0.4, 1e-6);
  const int cx = static_cast<int>(std::lround(c.cx)), cy = static_cast<int>(std::lround(c.cy));
  EXPECT_GT(at(cx, cy), 0.99999);
  // 1 / sqrt(gain) - 1 grows with the square of the radius.
  const auto bend = [&](int x) { return (1 / std::sqrt(at(x, cy)) - 1) / std::pow(x - c.cx, 2); };
  EXPECT_NEAR(bend(100) / bend(600), 1, 1e-3);
  EXPECT_NEAR(bend(20) / bend(600), 1, 1e-3);
}

TEST(Vignetting, APixelWithLessLightIsAPixelInDimmerLight) {
  EventCameraConfig config = pixels(EventSensorPreset::imx636);
  EventPixels full({8, 1}, config, 3), lossy({8, 1}, config, 3, std::vector<float>(8, 0.25F));
  std::vector<SimEvent> a, b;
  for (std::size_t i = 0; i < 8; ++i) {
    full.start(i, 0, 5);
    lossy.start(i, 0, 20);
    for (int k = 0; k < 400; ++k) {
      const TimeNs t = k * 10 * kNsPerMs;
      const auto level = [](int n) { return n % 2 == 0 ? 20.0F : 44.0F; };
      full.advance(i, t, t + 10 * kNsPerMs, 0.25F * level(k), 0.25F * level(k + 1), a);
      lossy.advance(i, t, t + 10 * kNsPerMs, level(k), level(k + 1), b);
    }
  }
  ASSERT_EQ(a.size(), b.size());
  ASSERT_GT(a.size(), 1000u);
  for (std::size_t i = 0; i < a.size(); ++i) ASSERT_EQ(a[i].t, b[i].t);
}

TEST(EventSensor, ThePresetSelectsTheReadOutUnlessThatIsSet) {
  EXPECT_EQ(with_preset_values(ReadOutConfig(), EventSensorPreset::imx636).kind, ReadOutKind::rows);
  EXPECT_EQ(with_preset_values(ReadOutConfig(), EventSensorPreset::dvxplorer).kind, ReadOutKind::scan);
  EXPECT_EQ(with_preset_values(ReadOutConfig(), EventSensorPreset::davis346).max_rate_mev_s, 12);
  ReadOutConfig set;
  set.kind = ReadOutKind::queue;
  set.max_rate_mev_s = 0;
  const ReadOutConfig kept = with_preset_values(set, EventSensorPreset::imx636);
  EXPECT_EQ(kept.kind, ReadOutKind::queue);
  EXPECT_EQ(kept.max_rate_mev_s, 0);
}

TEST(EventSensor, FaultsAreToldInOneLine) {
  const auto line = [](double EventCameraConfig::*member, double value) {
    EventSensorConfig config;
    config.*member = value;
    return error_line(with_preset_values(config));
  };
  EXPECT_EQ(line(&EventCameraConfig::threshold_on, 0),
            "events.threshold_on: 0 is less than 0.02; give more, or -1 for the value of the preset");
  EXPECT_EQ(line(&EventCameraConfig::threshold_off, -0.2),
            "events.threshold_off: -0.2 is less than 0.02; give more, or -1 for the value of the preset");
  EventSensorConfig config;
  ConfigTable table;
  table.group("events", config);
  EXPECT_FALSE(table.set("events.preset", "dvs128", "test").ok());
  EXPECT_FALSE(table.set("events.threshold_on", "11", "test").ok());
}

}  // namespace
}  // namespace evpose::sim
