// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/flat_buffer.h"

namespace evpose {
namespace {

bool fits(std::span<const std::byte> buffer, std::size_t position, std::size_t bytes) {
  return position <= buffer.size() && bytes <= buffer.size() - position;
}

}  // namespace

std::optional<FlatTable> FlatTable::at(std::span<const std::byte> buffer, std::size_t position) {
  if (!fits(buffer, position, 4)) return std::nullopt;
  const auto back = static_cast<std::int64_t>(load<std::int32_t>(buffer, position));
  const std::int64_t fields = static_cast<std::int64_t>(position) - back;
  if (fields < 0 || !fits(buffer, static_cast<std::size_t>(fields), 4)) return std::nullopt;
  const auto at = static_cast<std::size_t>(fields);
  const std::size_t fields_bytes = load<std::uint16_t>(buffer, at),
                    bytes = load<std::uint16_t>(buffer, at + 2);
  if (fields_bytes < 4 || !fits(buffer, at, fields_bytes) || bytes < 4 || !fits(buffer, position, bytes))
    return std::nullopt;
  return FlatTable(buffer, position, at + 4, (fields_bytes - 4) / 2, bytes);
}

std::optional<FlatTable> FlatTable::root(std::span<const std::byte> buffer, std::string_view identifier) {
  if (!fits(buffer, 0, 8) || as_text(buffer.subspan(4, 4)) != identifier) return std::nullopt;
  return at(buffer, load<std::uint32_t>(buffer, 0));
}

std::size_t FlatTable::field(unsigned slot, std::size_t size) const {
  if (slot >= slots_) return 0;
  const std::size_t offset = load<std::uint16_t>(buffer_, fields_ + 2 * std::size_t{slot});
  return offset < 4 || offset > bytes_ || size > bytes_ - offset ? 0 : position_ + offset;
}

std::optional<FlatVector> FlatTable::vector(unsigned slot, std::size_t item_bytes) const {
  const std::size_t reference = field(slot, 4);
  if (reference == 0) return std::nullopt;
  const std::size_t position = reference + load<std::uint32_t>(buffer_, reference);
  if (!fits(buffer_, position, 4)) return std::nullopt;
  const std::size_t count = load<std::uint32_t>(buffer_, position);
  if (count > (buffer_.size() - position - 4) / item_bytes) return std::nullopt;
  return FlatVector(buffer_, position + 4, count, item_bytes);
}

std::optional<FlatTable> FlatVector::table(std::size_t i) const {
  const std::size_t reference = position_ + 4 * i;
  return FlatTable::at(buffer_, reference + load<std::uint32_t>(buffer_, reference));
}

}  // namespace evpose
