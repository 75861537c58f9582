// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/recording/scenario.h"

#include "evpose/core/config.h"

namespace evpose::sim {

void describe(ConfigTable& table, LampConfig& c) {
  table.add("off_at_s", c.off_at_s, "s", "time at which the lamps are switched off; negative: never",
            {-1, 1e6});
  table.add("on_at_s", c.on_at_s, "s", "time at which they are switched on again; negative: never",
            {-1, 1e6});
  table.add("off_factor", c.off_factor, "", "remaining fraction of the light when they are off", {0, 1});
  table.add("fade_ms", c.fade_ms, "ms", "duration of switching on or off", {0.01, 1e5});
  table.add("flicker_hz", c.flicker_hz, "Hz", "of the light: twice the mains frequency; 0: none", {0, 2000});
  table.add("flicker_depth", c.flicker_depth, "", "of the light's mean, up and down", {0, 1});
}

void describe(ConfigTable& table, TruthConfig& c) {
  table.add("rate_hz", c.rate_hz, "Hz", "of the true poses", {1, 1e5});
  table.add("events", c.events, "write the cause and origin of each event");
  table.add("contour_spacing_m", c.contour_spacing_m, "m", "between points of the true contours", {1e-3, 1});
}

void describe(ConfigTable& table, Scenario& s) {
  table.add("name", s.name, "of the scenario");
  table.add("description", s.description, "one line");
  table.add("seed", s.seed, "", "of the sensors' noise; world and trajectory have their own", {0, 2e9});
  table.add("duration_s", s.duration_s, "s", "of the recording", {1e-3, 1e5});
  table.add("scene_file", s.scene_file, "file of a custom scene; empty: a built-in world");
  table.group("world", s.world);
  table.group("lamps", s.lamps);
  table.group("trajectory", s.trajectory);
  table.group("camera", s.camera);
  table.group("events", s.events);
  table.group("read_out", s.read_out);
  table.group("integrator", s.integrator);
  table.group("imu", s.imu);
  table.group("frames", s.frames);
  table.group("depth", s.depth);
  table.group("lidar", s.lidar);
  table.group("handed_over", s.handed_over);
  table.group("truth", s.truth);
}

Expected<Scenario> with_preset_values(const Scenario& scenario) {
  Scenario out = scenario;
  const auto events = with_preset_values(scenario.events);
  if (!events) return events.error();
  out.events = *events;
  out.read_out = with_preset_values(scenario.read_out, scenario.events.preset);
  out.handed_over = with_preset_values(scenario.handed_over);
  return out;
}

}  // namespace evpose::sim
