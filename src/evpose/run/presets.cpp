// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/run/presets.h"

#include <array>

namespace evpose {
namespace {

struct Setting {
  const char* key;
  const char* value;
};

/// EV-Pose: temporal distance field with one decay for all points, bilinear between pixels (4.2), registered
/// by Gauss-Newton on the newest event of either polarity (4.3); noise filter with a constant window (4.1);
/// motion prior, STPE factors and IMU factors in a graph over a window (5.2).
constexpr std::array kPaper{
    Setting{"registration.kind", "temporal_field"},
    Setting{"temporal_field.kernel", "bilinear"},
    Setting{"temporal_field.decay_min_s", "0.01"},
    Setting{"temporal_field.decay_max_s", "0.01"},
    Setting{"events.noise_filter.support_min_s", "0.01"},
    Setting{"events.noise_filter.support_max_s", "0.01"},
    Setting{"fusion.kind", "graph"},
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
