// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/events_text_writer.h"

#include <array>
#include <charconv>

namespace evpose {
namespace {

constexpr std::size_t kFlushBytes = 256 << 10;
constexpr std::int64_t kUsPerS = 1'000'000;

void put(std::string& out, std::int64_t value) {
  std::array<char, 20> digits{};
  const auto [end, error] = std::to_chars(digits.data(), digits.data() + digits.size(), value);
  out.append(digits.data(), end);
}

/// Seconds with six decimals.
void put_seconds(std::string& out, std::int64_t t_us) {
  if (t_us < 0) out += '-';
  const std::int64_t size = t_us < 0 ? -t_us : t_us;
  put(out, size / kUsPerS);
  std::array<char, 7> decimals = {'.'};
  std::int64_t rest = size % kUsPerS;
  for (std::size_t i = 6; i > 0; --i, rest /= 10) decimals[i] = static_cast<char>('0' + rest % 10);
  out.append(decimals.data(), decimals.size());
}

}  // namespace

EventWriterText::EventWriterText(AtomicFile file, ImageSize size, bool commas)
    : file_(std::move(file)), size_(size), commas_(commas) {}

Expected<EventWriterText> EventWriterText::create(const std::string& path, ImageSize size) {
  EVPOSE_CHECK(size.width > 0 && size.height > 0);
  auto file = AtomicFile::create(path);
  if (!file) return file.error();
  const bool commas = path.ends_with(".csv");
  if (commas) file->write(text("%geometry:", size.width, ",", size.height, "\n"));
  return EventWriterText(*std::move(file), size, commas);
}

Status EventWriterText::append(const EventPacket& packet) {
  const char separator = commas_ ? ',' : ' ';
  for (const Event& e : packet.events) {
    const TimeNs t = packet.time(e);
    EVPOSE_CHECK(t >= last_ && e.x < size_.width && e.y < size_.height);
    last_ = t;
    const std::int64_t t_us = t / kNsPerUs - (t % kNsPerUs < 0 ? 1 : 0);
    if (!commas_) put_seconds(buffer_, t_us), buffer_ += separator;
    put(buffer_, e.x);
    buffer_ += separator;
    put(buffer_, e.y);
    buffer_ += separator;
    buffer_ += e.on != 0 ? '1' : '0';
    if (commas_) buffer_ += separator, put(buffer_, t_us);
    buffer_ += '\n';
    if (buffer_.size() >= kFlushBytes) file_.write(buffer_), buffer_.clear();
  }
  return {};
}

Status EventWriterText::finish() {
  file_.write(buffer_);
  buffer_.clear();
  return file_.commit();
}

}  // namespace evpose
