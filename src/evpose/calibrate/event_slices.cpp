// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/event_slices.h"

namespace evpose {

Expected<bool> EventSlices::next(TimeNs from) {
  bool begun = false;
  EventPacket packet;
  while (true) {
    const auto more = reader_.next(packet);
    if (!more) return more.error();
    if (!*more) return false;
    end_ = packet.time(packet.events.back());
    preprocessor_.take(packet, packet.events);
    if (end_ >= from) {
      if (!begun) slice_.restart(packet.time(packet.events.front()));
      begun = true;
      slice_.add(preprocessor_.kept());
    }
    preprocessor_.clear_kept();
    if (!begun || !slice_.complete(end_)) continue;
    middle_ = end_ - from_seconds(slice_.mean_age_s(preprocessor_.stamp(end_)));
    return true;
  }
}

}  // namespace evpose
