// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>

namespace evpose {

/// Nanoseconds on the recording's one clock, that of the IMU. Never stored as floating-point seconds: at Unix
/// time a double resolves only 0.24 us.
using TimeNs = std::int64_t;

inline constexpr TimeNs kNsPerUs = 1'000;
inline constexpr TimeNs kNsPerMs = 1'000'000;
inline constexpr TimeNs kNsPerS = 1'000'000'000;

/// A *difference* of two times in seconds.
inline double to_seconds(TimeNs duration_ns) { return static_cast<double>(duration_ns) * 1e-9; }

/// Nearest nanosecond to a duration in seconds.
inline TimeNs from_seconds(double duration_s) { return static_cast<TimeNs>(std::llround(duration_s * 1e9)); }

}  // namespace evpose
