// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/aedat4_file.h"

#include <algorithm>

#include "evpose/core/log.h"
#include "evpose/io/files/compression.h"
#include "evpose/io/files/numbers.h"

namespace evpose {
namespace {

constexpr std::string_view kMagic = "#!AER-DAT4.0\r\n";
constexpr std::size_t kPacketHead = 8;
/// No packet of a camera comes near.
constexpr std::size_t kLargestHeader = 16 << 20, kLargestPayload = 256u << 20, kLargestMessage = 1u << 30;

enum StoredCompression { kNone = 0, kLz4 = 1, kLz4High = 2, kZstd = 3, kZstdHigh = 4 };

/// The text of `<attr key="KEY" ...>TEXT<` in a piece of XML; empty if it is not there.
std::string_view attribute(std::string_view xml, std::string_view key) {
  const auto at = xml.find(text("key=\"", key, "\""));
  if (at == std::string_view::npos) return {};
  const auto begin = xml.find('>', at);
  if (begin == std::string_view::npos) return {};
  return trimmed(xml.substr(begin + 1, xml.find('<', begin) - begin - 1));
}

bool parse_side(std::string_view s, int& out) {
  std::int64_t value = 0;
  if (!parse_integer(s, value) || value < 1 || value > 32768) return false;
  out = static_cast<int>(value);
  return true;
}

/// The streams are the nodes below outInfo whose name is a number; each reaches to the next.
std::vector<Aedat4Stream> read_streams(std::string_view xml) {
  constexpr std::string_view kNode = "<node name=\"";
  std::vector<Aedat4Stream> streams;
  std::vector<std::size_t> begins;
  xml = xml.substr(std::min(xml.find("<node name=\"outInfo\""), xml.size()));
  for (auto at = xml.find(kNode); at != std::string_view::npos; at = xml.find(kNode, at + 1)) {
    const std::string_view name = xml.substr(at + kNode.size(), xml.substr(at + kNode.size()).find('"'));
    std::int64_t id = 0;
    if (!parse_integer(name, id) || id < 0 || id > INT32_MAX) continue;
    begins.push_back(at);
    streams.push_back({.id = static_cast<int>(id), .type = {}, .size = {}});
  }
  for (std::size_t i = 0; i < streams.size(); ++i) {
    const auto end = i + 1 < begins.size() ? begins[i + 1] : xml.size();
    const std::string_view node = xml.substr(begins[i], end - begins[i]);
    streams[i].type = attribute(node, "typeIdentifier");
    ImageSize size;
    if (parse_side(attribute(node, "sizeX"), size.width) && parse_side(attribute(node, "sizeY"), size.height))
      streams[i].size = size;
  }
  return streams;
}

}  // namespace

Expected<Aedat4File> Aedat4File::open(const std::string& path) {
  auto bytes = ByteStream::open(path);
  if (!bytes) return bytes.error();
  Aedat4File file(*std::move(bytes));
  if (auto status = file.read_header(); !status) return status.error();
  return file;
}

Status Aedat4File::read_header() {
  const Error damaged{path(), "the header of the AEDAT4 file is damaged or cut off", "copy the file again"};
  if (as_text(bytes_.peek(kMagic.size())).substr(0, kMagic.size()) != kMagic)
    return Error{path(), "does not begin as an AEDAT4 file", "name another events.format"};
  bytes_.skip(kMagic.size());
  const auto head = bytes_.peek(4);
  if (head.size() < 4) return damaged;
  const std::size_t length = load<std::uint32_t>(head);
  bytes_.skip(4);
  if (length > kLargestHeader || length > static_cast<std::size_t>(bytes_.left())) return damaged;
  const auto content = bytes_.peek(length);
  if (content.size() < length) return damaged;
  const auto header = FlatTable::root(content.first(length), "IOHE");
  if (!header) return damaged;
  compression_ = header->number<std::int32_t>(0);
  if (compression_ < kNone || compression_ > kZstdHigh)
    return Error{path(), text("compression ", compression_, " is unknown"),
                 "only LZ4 and Zstandard can be read"};
  const auto table = header->number<std::int64_t>(1, -1);
  const auto xml = header->vector(2, 1);
  if (xml) streams_ = read_streams(as_text(xml->bytes()));
  if (streams_.empty()) return Error{path(), "the header describes no stream", "record again"};
  bytes_.skip(length);
  // An interrupted recording has no table, or names a place that was never written.
  end_ = table > bytes_.position() && table <= bytes_.size() ? table : bytes_.size();
  return {};
}

const Aedat4Stream* Aedat4File::find(const std::string& type, const std::string& number) const {
  const auto it = std::find_if(streams_.begin(), streams_.end(), [&](const Aedat4Stream& s) {
    return s.type == type && (number.empty() || std::to_string(s.id) == number);
  });
  return it == streams_.end() ? nullptr : &*it;
}

bool Aedat4File::next() {
  bytes_.skip(payload_);
  payload_ = 0;
  const std::int64_t left = end_ - bytes_.position();
  if (left <= 0) return false;
  const auto head = bytes_.peek(kPacketHead);
  cut_ = head.size() < kPacketHead;
  if (cut_) return false;
  stream_ = load<std::int32_t>(head);
  const auto size = load<std::int32_t>(head, 4);
  cut_ = size < 0 || size > left - static_cast<std::int64_t>(kPacketHead);
  if (cut_) return false;
  bytes_.skip(kPacketHead);
  payload_ = static_cast<std::size_t>(size);
  ++packets_;
  return true;
}

Expected<FlatTable> Aedat4File::message(const std::string& type) {
  const Error damaged{path(), text("packet ", packets_ - 1, " (from 0) is damaged"), "copy the file again"};
  if (payload_ > kLargestPayload) return damaged;
  auto content = bytes_.peek(payload_);
  if (content.size() < payload_) return damaged;
  content = content.first(payload_);
  if (compression_ != kNone) {
    const Compression method =
        compression_ == kLz4 || compression_ == kLz4High ? Compression::lz4 : Compression::zstd;
    const std::string where = text(path(), ": packet ", packets_ - 1, " (from 0)");
    const auto size = decompress(method, content, kLargestMessage, where, unpacked_);
    if (!size) return size.error();
    content = std::span(unpacked_).first(*size);
  }
  if (content.size() < 4) return damaged;
  const auto table = FlatTable::root(content.subspan(4), type);
  if (!table) return damaged;
  return *table;
}

void Aedat4File::warn_if_cut() const {
  if (cut_) log_warning(text(path(), ": ends within a packet, after ", packets_, " whole ones"));
}

}  // namespace evpose
