// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "evpose/io/hdf5/ecf.h"

namespace evpose {

enum class EcfPacking { none, columns, all };

template <class T>
void put_number(std::string& out, T value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

/// Times as steps and the number of events that follow.
inline void encode_times(std::span<const EcfEvent> events, std::string& out) {
  std::uint64_t t = events.empty() ? 0 : static_cast<std::uint64_t>(events[0].t_us);
  put_number(out, t);
  for (std::size_t i = 0; i < events.size();) {
    std::size_t run = 1;
    while (i + run < events.size() && events[i + run].t_us == events[i].t_us && run < 65535) ++run;
    std::uint64_t step = static_cast<std::uint64_t>(events[i].t_us) - t;
    t += step;
    if (step >= 15)
      for (; step > 0; step >>= 4) put_number(out, static_cast<std::uint8_t>(0xF0 | (step & 15)));
    put_number(out, static_cast<std::uint8_t>(step << 4 | (run < 15 ? run : 15)));
    if (run >= 15) put_number(out, static_cast<std::uint16_t>(run));
    i += run;
  }
}

inline void encode_packed(std::span<const EcfEvent> events, bool rows, std::string& out) {
  for (std::size_t i = 0; i < events.size(); i += 4) {
    std::uint32_t v[4] = {};
    for (std::size_t k = 0; k < 4 && i + k < events.size(); ++k) {
      const EcfEvent& e = events[i + k];
      v[k] = static_cast<std::uint32_t>(e.p) | static_cast<std::uint32_t>(e.x) << 1 |
             (rows ? static_cast<std::uint32_t>(e.y) << 12 : 0);
    }
    if (rows) {
      put_number(out, v[0] << 8 | (v[1] & 0xFF));
      put_number(out, v[1] >> 8 << 16 | (v[2] & 0xFFFF));
      put_number(out, v[2] >> 16 << 24 | v[3]);
    } else {
      put_number(out, static_cast<std::uint16_t>(v[0] << 4 | (v[1] & 15)));
      put_number(out, static_cast<std::uint16_t>(v[1] >> 4 << 8 | (v[2] & 0xFF)));
      put_number(out, static_cast<std::uint16_t>(v[2] >> 8 << 12 | v[3]));
    }
  }
}

inline void encode_rows(std::span<const EcfEvent> events, std::string& out) {
  for (std::size_t i = 0; i < events.size();) {
    std::size_t run = 1;
    while (i + run < events.size() && events[i + run].y == events[i].y && run < 65535) ++run;
    put_number(out, static_cast<std::uint16_t>(events[i].y << 5 | (run < 31 ? run : 31)));
    if (run >= 31) put_number(out, static_cast<std::uint16_t>(run));
    i += run;
  }
}

inline void encode_columns(std::span<const EcfEvent> events, std::string& out) {
  for (std::size_t i = 0; i < events.size();) {
    const int x = events[i++].x;
    unsigned mask = 0;
    for (int last = x; i < events.size() && events[i].x > last && events[i].x <= x + 5; ++i) {
      last = events[i].x;
      mask |= 1u << (5 - (last - x));
    }
    put_number(out, static_cast<std::uint16_t>(static_cast<unsigned>(x) << 5 | mask));
  }
}

inline void encode_polarities(std::span<const EcfEvent> events, std::string& out) {
  for (std::size_t i = 0; i < events.size();) {
    std::size_t run = 1;
    while (i + run < events.size() && events[i + run].p == events[i].p && run < 65535) ++run;
    put_number(out, static_cast<std::uint8_t>(events[i].p << 7 | (run < 127 ? run : 127)));
    if (run >= 127) put_number(out, static_cast<std::uint16_t>(run));
    i += run;
  }
}

/// The other direction of decode_ecf(), written from the description of the format.
inline std::string encode_ecf(std::span<const EcfEvent> events, EcfPacking packing) {
  std::string out;
  const unsigned flags = packing == EcfPacking::all ? 2 : packing == EcfPacking::columns ? 1 : 0;
  put_number(out, static_cast<std::uint32_t>(events.size() << 2 | flags));
  encode_times(events, out);
  if (packing == EcfPacking::all) {
    encode_packed(events, true, out);
    return out;
  }
  encode_rows(events, out);
  if (packing == EcfPacking::columns) {
    encode_packed(events, false, out);
    return out;
  }
  encode_columns(events, out);
  encode_polarities(events, out);
  return out;
}

/// Runs of equal times and rows, and what interrupts them.
inline std::vector<EcfEvent> some_ecf_events(std::size_t count) {
  std::mt19937 engine(11);
  const auto random = [&] { return static_cast<unsigned>(engine()); };
  std::vector<EcfEvent> events(count);
  std::int64_t t = 1'000'000;
  unsigned x = 0, y = 0;
  for (EcfEvent& e : events) {
    const unsigned kind = random() % 16;
    t += kind < 12 ? 0 : kind < 15 ? random() % 40 : random() % 3000;
    if (kind > 4) y = random() % 720;
    x = kind < 6 ? (x + 1 + random() % 5) % 1280 : random() % 1280;
    e = {static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y),
         static_cast<std::int16_t>(random() / 7 % 2), t};
  }
  return events;
}

inline bool same_events(const std::vector<EcfEvent>& a, const std::vector<EcfEvent>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const EcfEvent& l, const EcfEvent& r) {
    return l.x == r.x && l.y == r.y && l.p == r.p && l.t_us == r.t_us;
  });
}

}  // namespace evpose
