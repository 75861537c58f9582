// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/bags/mcap.h"

#include <algorithm>
#include <cstring>
#include <unordered_map>

#include "evpose/core/log.h"
#include "evpose/io/bags/chunked_bag_reader.h"
#include "evpose/io/files/crc32.h"

namespace evpose {
namespace {

constexpr std::size_t kRecordHead = 9;  // op and length
constexpr std::int64_t kFooterBytes = kRecordHead + 20;
constexpr std::size_t kLargestSummary = 256 << 20;

/// "package/msg/Type" as ROS 1 would write it.
std::string plain_type(std::string_view type) {
  std::string out(type);
  if (const auto middle = out.find("/msg/"); middle != std::string::npos) out.erase(middle, 4);
  return out;
}

class McapReader : public ChunkedBagReader {
 public:
  using ChunkedBagReader::ChunkedBagReader;

 private:
  Expected<std::int64_t> read_file_head() override;
  Expected<bool> read_index() override;
  Expected<bool> read_record_head(RecordKind& kind, std::uint64_t& data_size) override;
  bool take_record(std::span<const std::byte>& chunk, Record& record) override;
  bool add_topic_record(std::span<const std::byte> data) override {
    return op_ == McapOp::schema ? add_schema(data) : add_channel(data);
  }
  bool parse_chunk(std::span<const std::byte> data, Chunk& chunk) const override;
  bool parse_message(std::span<const std::byte> data, Message& message) const override;

  RecordKind kind_of_op() const;
  bool parse_summary(std::span<const std::byte> summary);
  bool add_schema(std::span<const std::byte> data);
  bool add_channel(std::span<const std::byte> data);
  bool add_statistics(std::span<const std::byte> data);
  bool add_chunk_index(std::span<const std::byte> data);

  std::unordered_map<std::uint16_t, std::string> type_of_schema_;
  std::vector<std::byte> head_room_;
  McapOp op_ = McapOp::header;  ///< of the record read last
};

McapReader::RecordKind McapReader::kind_of_op() const {
  if (static_cast<std::uint8_t>(op_) == 0) return RecordKind::invalid;
  if (op_ == McapOp::schema || op_ == McapOp::channel) return RecordKind::topic;
  if (op_ == McapOp::chunk) return RecordKind::chunk;
  if (op_ == McapOp::message) return RecordKind::message;
  if (op_ == McapOp::data_end || op_ == McapOp::footer) return RecordKind::end;
  return RecordKind::other;
}

Expected<bool> McapReader::read_record_head(RecordKind& kind, std::uint64_t& data_size) {
  const auto head = file_.read(kRecordHead, head_room_);
  if (!head || !*head) return head;
  MessageReader reader{std::span(head_room_).first(kRecordHead)};
  op_ = static_cast<McapOp>(reader.u8());
  data_size = reader.u64();
  kind = kind_of_op();
  return true;
}

bool McapReader::take_record(std::span<const std::byte>& chunk, Record& record) {
  MessageReader reader(chunk);
  op_ = static_cast<McapOp>(reader.u8());
  const std::uint64_t size = reader.u64();
  if (!reader.ok() || size > reader.left()) return false;
  record = {kind_of_op(), reader.bytes(size)};
  chunk = reader.rest();
  return true;
}

bool McapReader::add_schema(std::span<const std::byte> data) {
  MessageReader reader(data);
  const std::uint16_t id = reader.u16();
  const std::string_view name = reader.string();
  if (reader.ok()) type_of_schema_[id] = plain_type(name);
  return reader.ok();
}

bool McapReader::add_channel(std::span<const std::byte> data) {
  MessageReader reader(data);
  const std::uint16_t id = reader.u16(), schema = reader.u16();
  const std::string_view name = reader.string(), encoding = reader.string();
  if (!reader.ok()) return false;
  const auto wire = encoding == "cdr" ? Wire::cdr : encoding == "ros1" ? Wire::ros1 : Wire::other;
  const auto found = type_of_schema_.find(schema);
  const std::string type = found == type_of_schema_.end() ? "" : found->second;
  add_topic(id, {std::string(name), type, wire, "", 0});
  return true;
}

bool McapReader::add_statistics(std::span<const std::byte> data) {
  MessageReader reader(data);
  reader.skip(8 + 2 + 4 * 4 + 8 + 8);
  MessageReader counts(reader.byte_sequence());
  while (counts.ok() && counts.left() > 0) {
    const std::size_t* topic = topic_of(counts.u16());
    const std::uint64_t count = counts.u64();
    if (!counts.ok() || topic == nullptr || count > INT64_MAX / 65536) return false;
    add_messages(*topic, static_cast<std::int64_t>(count));
  }
  return reader.ok() && counts.ok();
}

bool McapReader::add_chunk_index(std::span<const std::byte> data) {
  MessageReader reader(data);
  reader.skip(16);
  const std::uint64_t start = reader.u64();
  reader.skip(8);
  MessageReader offsets(reader.byte_sequence());
  if (!reader.ok() || start > static_cast<std::uint64_t>(file_.size())) return false;
  while (offsets.ok() && offsets.left() > 0) {
    const std::size_t* topic = topic_of(offsets.u16());
    offsets.u64();
    if (topic == nullptr) return false;
    add_chunk(*topic, static_cast<std::int64_t>(start));
  }
  return offsets.ok();
}

/// False if it says less than is needed.
bool McapReader::parse_summary(std::span<const std::byte> summary) {
  Record record;
  bool statistics = false, sound = true;
  // Channels name schemas, the others name channels: whatever their order in the file.
  for (const McapOp wanted : {McapOp::schema, McapOp::channel, McapOp::statistics, McapOp::chunk_index}) {
    for (auto rest = summary; sound && !rest.empty();) {
      sound = take_record(rest, record);
      if (!sound || op_ != wanted) continue;
      if (wanted == McapOp::schema) sound = add_schema(record.data);
      if (wanted == McapOp::channel) sound = add_channel(record.data);
      if (wanted == McapOp::statistics) sound = statistics = add_statistics(record.data);
      if (wanted == McapOp::chunk_index) sound = add_chunk_index(record.data);
    }
  }
  for (std::size_t i = 0; i < topics_.size(); ++i)  // not in a chunk that is indexed
    sound = sound && (topics_[i].messages == 0 || last_chunk_[i] != first_record_);
  if (sound && statistics) return true;
  type_of_schema_.clear();
  return false;
}

Expected<bool> McapReader::read_index() {
  const std::int64_t footer = file_.size() - static_cast<std::int64_t>(kMcapMagic.size()) - kFooterBytes;
  if (footer < static_cast<std::int64_t>(kMcapMagic.size())) return false;
  if (auto status = file_.seek(footer); !status) return status.error();
  if (const auto got = file_.read(kFooterBytes + kMcapMagic.size(), room_); !got) return got.error();
  if (std::memcmp(room_.data() + kFooterBytes, kMcapMagic.data(), kMcapMagic.size()) != 0) return false;
  MessageReader reader{std::span(room_).first(kFooterBytes)};
  if (reader.u8() != static_cast<std::uint8_t>(McapOp::footer) || reader.u64() != 20) return false;
  const std::uint64_t start = reader.u64(), offsets = reader.u64();
  const std::uint32_t crc = reader.u32();
  const auto end = static_cast<std::uint64_t>(footer);
  if (start < kMcapMagic.size() || start >= end || end - start > kLargestSummary) return false;
  if (auto status = file_.seek(static_cast<std::int64_t>(start)); !status) return status.error();
  const std::size_t size = end - start;
  // The checksum goes on into the footer, up to itself.
  const std::size_t summed = size + kFooterBytes - sizeof(crc);
  if (const auto got = file_.read(summed, room_); !got) return got.error();
  if (crc != 0 && !crc32_agrees(crc, crc32(room_.data(), summed))) {
    log_warning(file_.path() + ": the file's summary is damaged");
    return false;
  }
  const std::size_t records = offsets > start && offsets < end ? offsets - start : size;
  return parse_summary(std::span(room_).first(records));
}

Expected<std::int64_t> McapReader::read_file_head() {
  const auto magic = file_.read(kMcapMagic.size(), room_);
  if (!magic) return magic.error();
  if (!*magic || std::memcmp(room_.data(), kMcapMagic.data(), kMcapMagic.size()) != 0)
    return Error{file_.path(), "is not an MCAP file", "check the path"};
  return static_cast<std::int64_t>(kMcapMagic.size());
}

bool McapReader::parse_chunk(std::span<const std::byte> data, Chunk& chunk) const {
  MessageReader reader(data);
  reader.skip(16);
  chunk.size = reader.u64();
  chunk.crc = reader.u32();
  chunk.compression = reader.string();
  chunk.stored = reader.bytes(reader.u64());
  return reader.ok();
}

bool McapReader::parse_message(std::span<const std::byte> data, Message& message) const {
  MessageReader reader(data);
  message.channel = reader.u16();
  reader.skip(4);
  message.t = static_cast<TimeNs>(std::min<std::uint64_t>(reader.u64(), INT64_MAX));
  reader.skip(8);
  message.data = reader.rest();
  return reader.ok();
}

}  // namespace

Expected<std::unique_ptr<BagReader>> open_mcap(const std::string& path) {
  return open_chunked_bag<McapReader>(path);
}

}  // namespace evpose
