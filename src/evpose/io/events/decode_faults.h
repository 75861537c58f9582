// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

namespace evpose {

/// What a decoder met that a sound camera does not send.
struct DecodeFaults {
  std::int64_t time_regressions = 0;   ///< events held at the last stamp since time went back
  std::int64_t discontinuities = 0;    ///< steps back too large for a hiccup of the sensor
  std::int64_t missing_time_high = 0;  ///< jumps over words that carry the time: lost data
  std::int64_t outside = 0;            ///< events dropped since their pixel lies outside of the image
  std::int64_t skipped_words = 0;      ///< of reserved kinds
};

/// One warning that names the file, if anything was changed or lost; a detail line for the harmless rest.
void report(const std::string& path, const DecodeFaults& faults);

}  // namespace evpose
