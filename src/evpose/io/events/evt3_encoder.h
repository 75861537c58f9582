// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "evpose/event/event.h"

namespace evpose {

/// Events as words of EVT3, one for each event and what it needs before it: a camera as Evt3Decoder wants it.
class Evt3Encoder {
 public:
  /// Appends the words of events in order of time, none earlier than those before; `base_us`: sensor time of
  /// dt_us == 0.
  void encode(std::span<const Event> events, std::int64_t base_us, std::vector<std::uint16_t>& words);

 private:
  std::int64_t high_ = -1, low_ = -1;  ///< as last sent; -1: not yet
  int y_ = -1;
};

}  // namespace evpose
