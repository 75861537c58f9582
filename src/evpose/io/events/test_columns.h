// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "evpose/io/events/event_reader.h"
#include "evpose/io/files/test_sha3.h"

namespace evpose {

/// The events of a file as known answers have them.
struct EventColumns {
  std::vector<std::uint64_t> t_us;
  std::vector<std::uint16_t> x, y;
  std::vector<std::uint8_t> p;
};

inline Expected<EventColumns> read_columns(EventReader& reader) {
  EventColumns c;
  EventPacket packet;
  while (true) {
    const auto more = reader.next(packet);
    if (!more) return more.error();
    if (!*more) return c;
    for (const Event& e : packet.events) {
      c.t_us.push_back(static_cast<std::uint64_t>(packet.time(e) / kNsPerUs));
      c.x.push_back(e.x);
      c.y.push_back(e.y);
      c.p.push_back(e.on);
    }
  }
}

template <class T>
std::string digest(const std::vector<T>& column) {
  return sha3_224(std::as_bytes(std::span(column)));
}

template <class T>
std::uint64_t sum(const std::vector<T>& column) {
  std::uint64_t total = 0;
  for (const T value : column) total += value;
  return total;
}

}  // namespace evpose
