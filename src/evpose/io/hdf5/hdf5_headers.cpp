// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/hdf5/hdf5_headers.h"

#include <algorithm>
#include <cstring>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "evpose/io/files/byte_stream.h"

namespace evpose {
namespace {

using Bytes = std::span<const std::byte>;

constexpr std::size_t kPrefix = 16, kMessageHead = 8;  // bytes
constexpr unsigned kContinuation = 0x10, kAttribute = 0x0C, kFilters = 0x0B;
constexpr unsigned kSharedMessage = 2, kSharedType = 1, kSharedSpace = 2;  // flags
constexpr std::uint64_t kLongestBlock = 1 << 26;
constexpr std::uint64_t kMostElements = 1 << 16;  // a message is shorter
constexpr std::size_t kMostBlocks = 10'000;

std::optional<std::vector<std::byte>> block(std::FILE* file, std::uint64_t file_bytes, std::uint64_t address,
                                            std::uint64_t length) {
  if (length > kLongestBlock || address > file_bytes || length > file_bytes - address) return std::nullopt;
  std::vector<std::byte> bytes(static_cast<std::size_t>(length));
  if (::fseeko(file, static_cast<off_t>(address), SEEK_SET) != 0 ||
      std::fread(bytes.data(), 1, bytes.size(), file) != bytes.size())
    return std::nullopt;
  return bytes;
}

/// Of a dataspace message, or kMostElements; none if it is damaged.
std::optional<std::uint64_t> elements(Bytes space) {
  if (space.size() < 4) return std::nullopt;
  const unsigned version = load<std::uint8_t>(space), rank = load<std::uint8_t>(space, 1);
  if (version == 2 && load<std::uint8_t>(space, 3) == 2) return 0;  // of the null kind
  const std::size_t head = version == 1 ? 8 : 4;
  if (version < 1 || version > 2 || space.size() < head + 8 * std::size_t{rank}) return std::nullopt;
  std::uint64_t count = 1;
  for (std::size_t i = 0; i < rank; ++i)
    count =
        std::min(count * std::min(load<std::uint64_t>(space, head + 8 * i), kMostElements), kMostElements);
  return count;
}

bool has_end(Bytes name) { return std::find(name.begin(), name.end(), std::byte{0}) != name.end(); }

bool attribute_lies_within(Bytes message) {
  if (message.size() < 9) return false;
  const unsigned version = load<std::uint8_t>(message);
  const unsigned flags = version == 1 ? 0U : load<std::uint8_t>(message, 1);
  if (version < 1 || version > 3) return false;
  std::size_t at = version == 3 ? 9 : 8;
  const auto part = [&](std::size_t size_at) -> std::optional<Bytes> {
    const std::size_t size = load<std::uint16_t>(message, size_at);
    const std::size_t padded = version == 1 ? (size + 7) / 8 * 8 : size;
    if (padded > message.size() - at) return std::nullopt;
    return message.subspan(std::exchange(at, at + padded), size);
  };
  const auto name = part(2);
  const auto type = name ? part(4) : std::nullopt;
  const auto space = type ? part(6) : std::nullopt;
  if (!space || !has_end(*name)) return false;
  if ((flags & (kSharedType | kSharedSpace)) != 0) return true;  // sizes are said elsewhere
  const auto count = elements(*space);
  return type->size() >= 8 && count && *count * load<std::uint32_t>(*type, 4) <= message.size() - at;
}

bool filters_lie_within(Bytes message) {
  if (message.size() < 2) return false;
  const unsigned version = load<std::uint8_t>(message), count = load<std::uint8_t>(message, 1);
  std::size_t at = version == 1 ? 8 : 2;
  for (unsigned i = 0; i < count; ++i) {
    constexpr unsigned kFirstWithName = 256;
    if (message.size() < at + 2) return false;
    const bool named = version == 1 || load<std::uint16_t>(message, at) >= kFirstWithName;
    const std::size_t head = named ? 8 : 6;
    if (message.size() < at + head) return false;
    const std::size_t name = named ? load<std::uint16_t>(message, at + 2) : 0U;
    const std::size_t values = load<std::uint16_t>(message, at + head - 2);
    const std::size_t bytes = name + 4 * (version == 1 ? (values + 1) / 2 * 2 : values);
    at += head;
    if (bytes > message.size() - at || (name > 0 && !has_end(message.subspan(at, name)))) return false;
    at += bytes;
  }
  return true;
}

}  // namespace

bool messages_are_sound(std::FILE* file, std::uint64_t bytes, std::uint64_t base, std::uint64_t address) {
  const auto prefix = block(file, bytes, base + address, kPrefix);
  if (!prefix) return false;
  if (std::memcmp(prefix->data(), "OHDR", 4) == 0) return true;
  if (prefix->front() != std::byte{1}) return false;
  std::vector<std::pair<std::uint64_t, std::uint64_t>> blocks{
      {base + address + kPrefix, load<std::uint32_t>(*prefix, 8)}};
  for (std::size_t i = 0; i < blocks.size() && i < kMostBlocks; ++i) {
    const auto messages = block(file, bytes, blocks[i].first, blocks[i].second);
    if (!messages) return false;
    Bytes rest(*messages);
    while (rest.size() >= kMessageHead) {
      const auto kind = load<std::uint16_t>(rest), size = load<std::uint16_t>(rest, 2);
      const unsigned flags = load<std::uint8_t>(rest, 4);
      rest = rest.subspan(kMessageHead);
      if (size > rest.size()) return false;
      const Bytes message = rest.first(size);
      rest = rest.subspan(message.size());
      const bool here = (flags & kSharedMessage) == 0;
      if (here && kind == kAttribute && !attribute_lies_within(message)) return false;
      if (here && kind == kFilters && !filters_lie_within(message)) return false;
      if (kind == kContinuation) {
        if (message.size() < 16) return false;
        blocks.emplace_back(base + load<std::uint64_t>(message), load<std::uint64_t>(message, 8));
      }
    }
  }
  return true;
}

}  // namespace evpose
