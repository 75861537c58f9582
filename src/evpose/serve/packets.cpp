// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/serve/packets.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace evpose {
namespace {

constexpr std::size_t kImuBytes = 56;  // i64 t_ns, f64 gyro[3], f64 accel[3]

template <class T>
T get(std::span<const std::uint8_t> bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

std::vector<std::uint8_t> with_header(PacketHeader::Kind kind, std::uint32_t sequence, TimeNs base,
                                      const void* payload, std::size_t bytes) {
  std::vector<std::uint8_t> out(PacketHeader::kBytes + bytes);
  const auto put = [&](std::size_t at, const auto& value) {
    std::memcpy(out.data() + at, &value, sizeof value);
  };
  put(0, PacketHeader::kMagic);
  put(4, kind);
  put(8, sequence);
  put(12, static_cast<std::uint32_t>(bytes));
  put(16, base);
  if (bytes > 0) std::memcpy(out.data() + PacketHeader::kBytes, payload, bytes);
  return out;
}

/// How far apart two counters are, over their wrap.
std::uint32_t missed_between(std::uint32_t before, std::uint32_t now) {
  const std::uint32_t gap = now - before - 1;
  return gap < 1u << 31 ? gap : 0;  // older or twice: nothing is missing
}

}  // namespace

std::vector<std::uint8_t> encode_packet(const EventPacket& events, std::uint32_t sequence) {
  return with_header(PacketHeader::Kind::events, sequence, events.base, events.events.data(),
                     events.events.size() * sizeof(Event));
}

std::vector<std::uint8_t> encode_packet(std::span<const ImuSample> imu, std::uint32_t sequence) {
  std::vector<std::uint8_t> rows(imu.size() * kImuBytes);
  for (std::size_t i = 0; i < imu.size(); ++i) {
    std::uint8_t* at = rows.data() + i * kImuBytes;
    std::memcpy(at, &imu[i].t, 8);
    std::memcpy(at + 8, imu[i].gyro.data(), 24);
    std::memcpy(at + 32, imu[i].accel.data(), 24);
  }
  return with_header(PacketHeader::Kind::imu, sequence, imu.empty() ? 0 : imu.front().t, rows.data(),
                     rows.size());
}

std::vector<std::uint8_t> encode_evt3_packet(std::span<const std::uint8_t> words, TimeNs base,
                                             std::uint32_t sequence) {
  return with_header(PacketHeader::Kind::evt3, sequence, base, words.data(), words.size());
}

std::optional<PacketHeader> PacketDecoder::header(std::span<const std::uint8_t> bytes) const {
  if (get<std::uint32_t>(bytes, 0) != PacketHeader::kMagic) return std::nullopt;
  PacketHeader out;
  const auto kind = bytes[4];
  if (kind < 1 || kind > 3 || bytes[5] != 0 || bytes[6] != 0 || bytes[7] != 0) return std::nullopt;
  out.kind = static_cast<PacketHeader::Kind>(kind);
  out.sequence = get<std::uint32_t>(bytes, 8);
  out.payload = get<std::uint32_t>(bytes, 12);
  out.base = get<TimeNs>(bytes, 16);
  const std::uint32_t unit = out.kind == PacketHeader::Kind::events ? sizeof(Event)
                             : out.kind == PacketHeader::Kind::imu  ? kImuBytes
                                                                    : 2;
  if (out.payload > PacketHeader::kMostPayload || out.payload % unit != 0) return std::nullopt;
  // Half of the range of times is room enough for any clock, and sums cannot overflow.
  if (std::abs(out.base / 2) > INT64_MAX / 4) return std::nullopt;
  return out;
}

void PacketDecoder::datagram(std::span<const std::uint8_t> bytes, std::vector<StreamItem>& out) {
  const auto found = bytes.size() < PacketHeader::kBytes ? std::nullopt : header(bytes);
  if (!found || found->payload != bytes.size() - PacketHeader::kBytes) {
    ++counts_.bad_packets;
    counts_.skipped_bytes += bytes.size();
    return;
  }
  payload(*found, bytes.subspan(PacketHeader::kBytes), out);
}

void PacketDecoder::stream(std::span<const std::uint8_t> bytes, std::vector<StreamItem>& out) {
  buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  std::size_t at = 0;
  bool in_garbage = false;
  while (buffer_.size() - at >= PacketHeader::kBytes) {
    const std::span<const std::uint8_t> rest = std::span<const std::uint8_t>(buffer_).subspan(at);
    const auto found = header(rest);
    if (!found) {
      if (!in_garbage) ++counts_.bad_packets;
      in_garbage = true;
      ++counts_.skipped_bytes;
      ++at;
      continue;
    }
    in_garbage = false;
    const std::size_t size = PacketHeader::kBytes + found->payload;
    if (rest.size() < size) break;
    payload(*found, rest.subspan(PacketHeader::kBytes, found->payload), out);
    at += size;
  }
  buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(at));
}

void PacketDecoder::payload(const PacketHeader& header, std::span<const std::uint8_t> bytes,
                            std::vector<StreamItem>& out) {
  ++counts_.packets;
  if (sequence_) counts_.missed += missed_between(*sequence_, header.sequence);
  sequence_ = header.sequence;
  switch (header.kind) {
    case PacketHeader::Kind::events:
      return take_events(header, bytes, out);
    case PacketHeader::Kind::imu:
      return take_imu(bytes, out);
    case PacketHeader::Kind::evt3:
      return take_evt3(header, bytes, out);
  }
}

void PacketDecoder::take_events(const PacketHeader& header, std::span<const std::uint8_t> bytes,
                                std::vector<StreamItem>& out) {
  StreamItem item;
  item.kind = StreamItem::Kind::events;
  item.events.base = header.base;
  item.events.events.reserve(bytes.size() / sizeof(Event));
  std::uint32_t last = 0;
  for (std::size_t at = 0; at < bytes.size(); at += sizeof(Event)) {
    const Event e = event_of_bits(get<std::uint64_t>(bytes, at));
    if (e.dt_us < last || e.x >= size_.width || e.y >= size_.height) {
      ++counts_.bad_events;
      continue;
    }
    last = e.dt_us;
    item.events.events.push_back(e);
  }
  if (!item.events.empty()) out.push_back(std::move(item));
}

void PacketDecoder::take_imu(std::span<const std::uint8_t> bytes, std::vector<StreamItem>& out) {
  StreamItem item;
  item.kind = StreamItem::Kind::imu;
  for (std::size_t at = 0; at < bytes.size(); at += kImuBytes) {
    ImuSample s;
    s.t = get<TimeNs>(bytes, at);
    std::memcpy(s.gyro.data(), bytes.data() + at + 8, 24);
    std::memcpy(s.accel.data(), bytes.data() + at + 32, 24);
    if (!s.gyro.allFinite() || !s.accel.allFinite() || std::abs(s.t / 2) > INT64_MAX / 4)
      ++counts_.bad_samples;
    else
      item.imu.push_back(s);
  }
  if (!item.imu.empty()) out.push_back(std::move(item));
}

void PacketDecoder::take_evt3(const PacketHeader& header, std::span<const std::uint8_t> bytes,
                              std::vector<StreamItem>& out) {
  const auto more = std::as_bytes(bytes);
  words_.insert(words_.end(), more.begin(), more.end());
  std::size_t at = 0;
  while (true) {
    block_.start();
    const std::size_t used = evt3_.decode(std::span<const std::byte>(words_).subspan(at), block_);
    at += used;
    if (block_.count > 0) {
      StreamItem item;
      item.kind = StreamItem::Kind::events;
      item.events.base = header.base + block_.base_us * kNsPerUs;
      item.events.events.assign(block_.events.begin(),
                                block_.events.begin() + static_cast<std::ptrdiff_t>(block_.count));
      out.push_back(std::move(item));
    }
    if (used == 0) break;
  }
  words_.erase(words_.begin(), words_.begin() + static_cast<std::ptrdiff_t>(at));
}

}  // namespace evpose
