// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/decode_faults.h"

#include "evpose/core/error.h"
#include "evpose/core/log.h"

namespace evpose {

void report(const std::string& path, const DecodeFaults& faults) {
  std::string lost;
  const auto add = [](std::string& list, std::int64_t count, const char* what) {
    if (count > 0) list += text(list.empty() ? "" : ", ", count, what);
  };
  add(lost, faults.time_regressions, " events whose stamp goes back got that of the event before");
  add(lost, faults.discontinuities, " steps back in time are too large for a hiccup");
  add(lost, faults.outside, " events outside of the image were dropped");
  if (!lost.empty()) log_warning(path + ": " + lost);
  std::string rest;
  add(rest, faults.missing_time_high, " gaps in the time words");
  add(rest, faults.skipped_words, " words of unknown kinds were skipped");
  if (!rest.empty()) log_detail(path + ": " + rest);
}

}  // namespace evpose
