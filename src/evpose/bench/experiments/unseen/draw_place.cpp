// SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <string_view>

#include "evpose/bench/experiments/unseen/drawer.h"

namespace evpose::experiments::unseen {
namespace {

constexpr double kMovers = 0.25;  // share

const std::array<Place, 3> kPlaces{
    {{"hall", 0.4, {{1.2, 1.2, 0.85}, {5.2, 4.8, 2.4}}, 1, 1, {{1.5, 1.5, 0.8}, {5, 4.5, 2.2}}},
     {"courtyard", 0.3, {{-4.5, -4.5, 2.3}, {4.5, 4.5, 6.5}}, 1.8, 2, {{-3.5, -3, 2.3}, {3.5, 3, 3.7}}},
     {"canyon", 0.3, {{-10, -1.7, 1.2}, {10, 1.7, 6}}, 2, 2, {{-10, -1.5, 2.2}, {10, 1.5, 4.2}}}}};

void draw_movers(Drawer& d, Plan& plan, Draw& out) {
  if (!d.chance(kMovers)) return;
  plan.movers = true;
  const bool hall = std::string_view(plan.place.kind) == "hall";
  const std::array<Choice, 3> things{{{"people", 0.5}, {"fans", 0.25}, {"cars", hall ? 0 : 0.25}}};
  const Choice& thing = d.pick<Choice>(things);
  const int count = std::string_view(thing.word) == "people" ? d.whole(1, 2) : 1;
  d.set(text("world.movers.", thing.word), count);
  out.scene += text(", ", thing.word);
}

void draw_lamp_changes(Drawer& d, const Plan& plan, Draw& out) {
  if (d.chance(0.2)) {
    d.set("lamps.flicker_hz", d.chance(0.5) ? 100 : 120);
    d.set_log_uniform("lamps.flicker_depth", 0.03, 0.25);
    out.light += ", flicker";
  }
  if (!d.chance(0.1)) return;
  const double off_s = d.uniform(0.4, 0.7) * plan.duration_s;
  d.set("lamps.off_at_s", off_s);
  if (d.chance(0.5)) d.set("lamps.on_at_s", off_s + d.uniform(0.1, 0.25) * plan.duration_s);
  d.set_log_uniform("lamps.off_factor", 0.02, 0.5);
  d.set_log_uniform("lamps.fade_ms", 2, 50);
  out.light += ", step";
}

}  // namespace

Place draw_place(Drawer& d) { return d.pick<Place>(kPlaces); }

double draw_street_x(Drawer& d) { return d.uniform(15, 85); }

void draw_world(Drawer& d, Plan& plan, Draw& out) {
  out.scene = plan.place.kind;
  d.set("world.kind", plan.place.kind);
  const double contrast = d.uniform(0.4, 1.4);
  d.set("world.texture_contrast", contrast);
  out.scene += text(", texture ", number(contrast, 2));
  draw_movers(d, plan, out);
}

void draw_looks(Drawer& d, const Plan& plan, Draw& out) {
  const std::string_view kind = plan.place.kind;
  if (kind != "hall" && d.chance(0.25)) {
    d.set("world.repeated_facades", "true");
    out.scene += ", windows alike";
  }
  if (d.chance(0.2)) {
    const double mirror = d.log_uniform(0.02, 0.12);
    d.set("world.mirror", mirror);
    out.scene += text(", mirrors ", number(mirror, 2));
  }
  constexpr std::array<Choice, 4> kMarks{{{"none", 1}, {"h", 1}, {"ring", 1}, {"squares", 1}}};
  if (kind == "courtyard") d.set("world.pad_mark", d.pick<Choice>(kMarks).word);
}

void draw_light(Drawer& d, Plan& plan, Draw& out) {
  if (std::string_view(plan.place.kind) == "hall") {
    const double lux = d.log_uniform(100, 1000);
    d.set("world.lamp_lux", lux);
    d.set_log_uniform("world.window_cd_m2", 300, 6000);
    out.light = text("lamps, ", number(lux, 2), " lux");
    return draw_lamp_changes(d, plan, out);
  }
  plan.night = d.chance(0.08);
  if (plan.night) {
    d.set("world.night", "true");
    const double lux = d.log_uniform(300, 3000);  // a twentieth of it below a street lamp
    d.set("world.lamp_lux", lux);
    out.light = text("street lamps, ", number(0.05 * lux, 2), " lux");
    return draw_lamp_changes(d, plan, out);
  }
  const bool sun = d.chance(0.75);
  const double lux = sun ? d.log_uniform(10000, 100000) : 0;
  d.set("world.sun_lux", lux);
  d.set_uniform("world.sun_azimuth_deg", 0, 360);
  d.set_uniform("world.sun_elevation_deg", 15, 70);
  const double sky = sun ? lux * d.uniform(0.1, 0.4) : d.log_uniform(3000, 20000);
  d.set("world.sky_lux", sky);
  out.light = sun ? text("sun, ", number(lux + sky, 2), " lux") : text("overcast, ", number(sky, 2), " lux");
}

}  // namespace evpose::experiments::unseen
