// SPDX-License-Identifier: BSD-3-Clause
// What arrives over a wire.
#include <algorithm>

#include "evpose/core/error.h"
#include "evpose/mavlink/link_check.h"
#include "evpose/mavlink/reporter.h"
#include "evpose/serve/packets.h"
#include "fuzz.h"

/// A link of any bytes: frames come out the same however it is cut, and both readers of frames live.
EVPOSE_FUZZ_TARGET(mavlink) {
  using namespace evpose;
  using namespace evpose::mavlink;
  if (bytes.empty()) return;
  const std::size_t piece = 1 + bytes[0];
  bytes = bytes.subspan(1);
  Parser whole, pieces;
  std::vector<std::uint32_t> a, b;
  const auto into = [](std::vector<std::uint32_t>& out) {
    return [&out](const Frame& frame) { out.push_back(frame.id << 8 | frame.sequence); };
  };
  whole.parse(bytes, into(a));
  for (std::size_t at = 0; at < bytes.size(); at += piece)
    pieces.parse(bytes.subspan(at, std::min(piece, bytes.size() - at)), into(b));
  EVPOSE_CHECK(a == b);
  LinkCheck check;
  check.receive(bytes, kNsPerS);
  check.receive(bytes, 2 * kNsPerS);
  EVPOSE_CHECK(!check.report().lines.empty());
  std::size_t answers = 0;
  Reporter reporter({}, {}, [&](mavlink::Bytes frame) { answers += frame.size(); });
  reporter.tick(1);
  reporter.receive(bytes, 2);
  EVPOSE_CHECK(answers <= 1000 + 100 * a.size());
}

/// Packets of a driver: whatever they say, events come out in order and inside of the image.
EVPOSE_FUZZ_TARGET(live_packets) {
  using namespace evpose;
  if (bytes.empty()) return;
  const std::size_t piece = 1 + bytes[0];
  bytes = bytes.subspan(1);
  PacketDecoder stream({64, 48}), datagram({64, 48});
  std::vector<StreamItem> items;
  for (std::size_t at = 0; at < bytes.size(); at += piece)
    stream.stream(bytes.subspan(at, std::min(piece, bytes.size() - at)), items);
  datagram.datagram(bytes, items);
  for (const StreamItem& item : items) {
    EVPOSE_CHECK(item.kind != StreamItem::Kind::events || !item.events.empty());
    for (std::size_t i = 0; i < item.events.events.size(); ++i) {
      const Event& e = item.events.events[i];
      EVPOSE_CHECK(e.x < 64 && e.y < 48 && (i == 0 || e.dt_us >= item.events.events[i - 1].dt_us));
    }
    for (const ImuSample& sample : item.imu)
      EVPOSE_CHECK(sample.gyro.allFinite() && sample.accel.allFinite());
  }
}
