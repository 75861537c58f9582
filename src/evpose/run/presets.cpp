// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/run/presets.h"

#include <array>

namespace evpose {
namespace {

struct Setting {
  const char* key;
  const char* value;
};

/// EV-Pose: visible points on the temporal distance field of the predicted polarity, with one time constant
/// for all, bilinear between pixels (4.1 to 4.3, 5.1, eq. 1); noise filter with a constant window (4.1);
/// motion prior, measurements and IMU in a graph over a window (5.2, eq. 2 to 6). Signs of contrast are the
/// map's where it states them, and learnt where it does not.
constexpr std::array kPaper{
    Setting{"registration.kind", "temporal_field"},
    Setting{"temporal_field.kernel", "bilinear"},
    Setting{"temporal_field.eta_s", "0.01"},
    Setting{"events.noise_filter.support_min_s", "0.01"},
    Setting{"events.noise_filter.support_max_s", "0.01"},
    Setting{"fusion.kind", "graph"},
    Setting{"frames.use", "off"},
};

}  // namespace

Status apply_preset(ConfigTable& table, const std::string& name) {
  if (name.empty()) return {};
  if (name != "paper") return Error{"--preset " + name, "there is no such preset", "known: paper"};
  for (const Setting& s : kPaper)
    if (auto ok = table.set(s.key, s.value, "--preset " + name); !ok) return ok;
  return {};
}

}  // namespace evpose
