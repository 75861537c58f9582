// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/event_sensor.h"

#include <string>

#include "evpose/core/config.h"

namespace evpose::sim {
namespace {

constexpr double kOfPreset = -1;

struct Field {
  const char* key;
  double EventCameraConfig::*member;
  const char* unit;
  const char* help;
  double least, most;
};
// A threshold below 0.02 would trigger on rounding errors.
constexpr Field kFields[] = {
    {"threshold_on", &EventCameraConfig::threshold_on, "",
     "contrast threshold of on events, in log luminance", 0.02, 10},
    {"threshold_off", &EventCameraConfig::threshold_off, "",
     "contrast threshold of off events, in log luminance", 0.02, 10},
    {"threshold_sigma", &EventCameraConfig::threshold_sigma, "", "mismatch of both between pixels, 1 sigma",
     0, 1},
    {"refractory_us", &EventCameraConfig::refractory_us, "us", "refractory period", 0, 1e6},
    {"dark_cd_m2", &EventCameraConfig::dark_cd_m2, "cd/m^2",
     "dark current, as luminance added to every pixel", 1e-4, 1e3},
    {"bandwidth_hz_per_cd_m2", &EventCameraConfig::bandwidth_hz_per_cd_m2, "Hz m^2/cd",
     "bandwidth of a pixel by its luminance; 0: unlimited", 0, 1e6},
    {"bandwidth_max_hz", &EventCameraConfig::bandwidth_max_hz, "Hz", "bandwidth of a pixel in bright light",
     1, 1e6},
    {"leak_hz", &EventCameraConfig::leak_hz, "1/s", "leak events per pixel", 0, 100},
    {"shot_noise_dark_hz", &EventCameraConfig::shot_noise_dark_hz, "1/s",
     "shot noise events per pixel in darkness", 0, 1e4},
    {"shot_noise_bright_hz", &EventCameraConfig::shot_noise_bright_hz, "1/s",
     "shot noise events per pixel in bright light", 0, 1e4},
    {"shot_noise_half_cd_m2", &EventCameraConfig::shot_noise_half_cd_m2, "cd/m^2",
     "luminance where the noise is half-way between dark and bright", 1e-4, 1e6},
    {"hot_pixel_fraction", &EventCameraConfig::hot_pixel_fraction, "", "fraction of hot pixels", 0, 1},
    {"hot_min_hz", &EventCameraConfig::hot_min_hz, "1/s", "lowest rate of a hot pixel", 1e-3, 1e5},
    {"hot_max_hz", &EventCameraConfig::hot_max_hz, "1/s", "highest rate of a hot pixel", 1e-3, 1e5},
    {"reference_spread", &EventCameraConfig::reference_spread, "",
     "initial offset of the reference from the signal, as a fraction of the threshold", 0, 1},
};

// Luminance follows from the data sheets' illuminance on the chip at f/2 and a transmission of 0.9.
EventCameraConfig pixels_of(EventSensorPreset preset) {
  EventCameraConfig c;
  switch (preset) {
    case EventSensorPreset::typical:
      break;
    case EventSensorPreset::imx636:
      c.threshold_on = c.threshold_off = 0.223;
      c.refractory_us = 50;
      c.dark_cd_m2 = 0.45;
      c.bandwidth_hz_per_cd_m2 = 9;
      c.bandwidth_max_hz = 5000;
      c.shot_noise_dark_hz = 5;
      c.shot_noise_bright_hz = 0.05;
      break;
    case EventSensorPreset::dvxplorer:
      c.threshold_on = c.threshold_off = 0.2;
      c.threshold_sigma = 0.04;
      c.dark_cd_m2 = 0.5;
      c.bandwidth_hz_per_cd_m2 = 9;
      c.bandwidth_max_hz = 2000;
      c.leak_hz = 0.03;
      c.shot_noise_dark_hz = 5;
      c.shot_noise_bright_hz = 0.03;
      break;
    case EventSensorPreset::davis346:
      c.threshold_on = 0.134;
      c.threshold_off = 0.203;
      c.refractory_us = 500;
      c.bandwidth_hz_per_cd_m2 = 9;
      c.bandwidth_max_hz = 3000;
      c.shot_noise_dark_hz = 10;
      c.shot_noise_bright_hz = 0.1;
      break;
  }
  return c;
}

}  // namespace

EventSensorConfig::EventSensorConfig() {
  for (const Field& field : kFields) this->*field.member = kOfPreset;
}

void describe(ConfigTable& table, EventSensorConfig& c) {
  table.add("preset", c.preset,
            ConfigTable::Choices<EventSensorPreset>{{"typical", EventSensorPreset::typical},
                                                    {"imx636", EventSensorPreset::imx636},
                                                    {"dvxplorer", EventSensorPreset::dvxplorer},
                                                    {"davis346", EventSensorPreset::davis346}},
            "kind of sensor, for its pixels and read_out; -1 below selects its value");
  for (const Field& f : kFields) table.add(f.key, c.*f.member, f.unit, f.help, {kOfPreset, f.most});
}

Expected<EventSensorConfig> with_preset_values(const EventSensorConfig& config) {
  const EventCameraConfig own = pixels_of(config.preset);
  EventSensorConfig out = config;
  for (const Field& f : kFields) {
    double& value = out.*f.member;
    if (value == kOfPreset) value = own.*f.member;
    if (value < f.least)
      return Error{std::string("events.") + f.key, text(value, " is less than ", f.least),
                   "give more, or -1 for the value of the preset"};
  }
  return out;
}

ReadOutConfig with_preset_values(const ReadOutConfig& config, EventSensorPreset preset) {
  struct Own {
    ReadOutKind kind;
    double max_rate_mev_s;
  };
  const Own own = preset == EventSensorPreset::imx636      ? Own{ReadOutKind::rows, 1066}
                  : preset == EventSensorPreset::dvxplorer ? Own{ReadOutKind::scan, 165}
                  : preset == EventSensorPreset::davis346  ? Own{ReadOutKind::queue, 12}
                                                           : Own{ReadOutKind::queue, 100};
  ReadOutConfig out = config;
  if (out.kind == ReadOutKind::preset) out.kind = own.kind;
  if (out.max_rate_mev_s < 0) out.max_rate_mev_s = own.max_rate_mev_s;
  return out;
}

}  // namespace evpose::sim
