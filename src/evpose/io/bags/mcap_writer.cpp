// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include "evpose/core/version.h"
#include "evpose/io/bags/chunked_bag_writer.h"
#include "evpose/io/bags/mcap.h"
#include "evpose/io/bags/message_definitions.h"
#include "evpose/io/files/byte_stream.h"
#include "evpose/io/files/crc32.h"

namespace evpose {
namespace {

constexpr std::size_t kChunkBytes = 1 << 20;

std::string_view name_of(Compression compression) {
  return compression == Compression::lz4 ? "lz4" : compression == Compression::zstd ? "zstd" : "";
}

void append_record(MessageWriter& out, McapOp op, const MessageWriter& content) {
  out.u8(static_cast<std::uint8_t>(op));
  out.u64(content.size());
  out.bytes(content.data());
}

/// "sensor_msgs/Imu" as ROS 2 names it.
std::string ros2_type(std::string type) { return type.insert(type.find('/') + 1, "msg/"); }

class McapWriter : public ChunkedBagWriter {
 public:
  McapWriter(AtomicFile file, Compression compression)
      : ChunkedBagWriter(std::move(file), compression, kChunkBytes) {
    put_magic();
    MessageWriter header;
    header.string("ros2");
    header.string(text("evpose ", version()));
    put_record(McapOp::header, header);
  }

  Wire wire() const override { return Wire::cdr; }
  Status finish() override;

 private:
  void append_topic(MessageWriter& chunk, std::size_t topic) const override;
  void append_message(MessageWriter& chunk, std::size_t topic, TimeNs t,
                      std::span<const std::byte> message) const override;
  void put_chunk(const Chunk& chunk, std::span<const std::byte> unpacked,
                 std::span<const std::byte> stored) override;
  void put_index(std::size_t topic, const std::vector<IndexEntry>& entries) override;
  void put(std::string_view bytes) override {
    ChunkedBagWriter::put(bytes);
    crc_ = crc32(bytes.data(), bytes.size(), crc_);
  }

  void put_magic() { put({reinterpret_cast<const char*>(kMcapMagic.data()), kMcapMagic.size()}); }
  void put_record(McapOp op, const MessageWriter& content) {
    MessageWriter record;
    append_record(record, op, content);
    put(as_text(record.data()));
  }
  MessageWriter schema(std::size_t topic) const;
  MessageWriter channel(std::size_t topic) const;
  MessageWriter statistics() const;
  MessageWriter chunk_index(const Chunk& chunk) const;
  void put_summary();

  std::uint32_t crc_ = 0;  ///< of what was put since it was set to 0
};

std::uint16_t id_of(std::size_t topic) { return static_cast<std::uint16_t>(topic + 1); }

/// Each topic has a schema of its own: simple, and a few hundred bytes.
MessageWriter McapWriter::schema(std::size_t topic) const {
  MessageWriter out;
  out.u16(id_of(topic));
  out.string(ros2_type(topics_[topic].type));
  out.string("ros2msg");
  out.byte_sequence(message_definition(topics_[topic].type, Wire::cdr));
  return out;
}

MessageWriter McapWriter::channel(std::size_t topic) const {
  MessageWriter out;
  out.u16(id_of(topic));
  out.u16(id_of(topic));
  out.string(topics_[topic].name);
  out.string("cdr");
  out.u32(0);  // no metadata
  return out;
}

void McapWriter::append_topic(MessageWriter& chunk, std::size_t topic) const {
  append_record(chunk, McapOp::schema, schema(topic));
  append_record(chunk, McapOp::channel, channel(topic));
}

void McapWriter::append_message(MessageWriter& chunk, std::size_t topic, TimeNs t,
                                std::span<const std::byte> message) const {
  MessageWriter content;
  content.u16(id_of(topic));
  content.u32(topics_[topic].messages);
  content.u64(static_cast<std::uint64_t>(t));
  content.u64(static_cast<std::uint64_t>(t));
  content.bytes(message);
  append_record(chunk, McapOp::message, content);
}

void McapWriter::put_chunk(const Chunk& chunk, std::span<const std::byte> unpacked,
                           std::span<const std::byte> stored) {
  MessageWriter content;
  content.u64(static_cast<std::uint64_t>(chunk.first));
  content.u64(static_cast<std::uint64_t>(chunk.last));
  content.u64(chunk.size);
  content.u32(crc32(unpacked.data(), unpacked.size()));
  content.string(name_of(compression_));
  content.u64(chunk.stored);
  content.bytes(stored);
  put_record(McapOp::chunk, content);
}

void McapWriter::put_index(std::size_t topic, const std::vector<IndexEntry>& entries) {
  MessageWriter pairs;
  for (const IndexEntry& entry : entries) {
    pairs.u64(static_cast<std::uint64_t>(entry.t));
    pairs.u64(entry.offset);
  }
  MessageWriter content;
  content.u16(id_of(topic));
  content.byte_sequence(pairs.data());
  put_record(McapOp::message_index, content);
}

MessageWriter McapWriter::statistics() const {
  std::uint64_t messages = 0;
  TimeNs first = chunks_.empty() ? 0 : INT64_MAX, last = 0;
  MessageWriter counts;
  for (std::size_t topic = 0; topic < topics_.size(); ++topic) {
    messages += topics_[topic].messages;
    counts.u16(id_of(topic));
    counts.u64(topics_[topic].messages);
  }
  for (const Chunk& chunk : chunks_) {
    first = std::min(first, chunk.first);
    last = std::max(last, chunk.last);
  }
  MessageWriter out;
  out.u64(messages);
  out.u16(static_cast<std::uint16_t>(topics_.size()));
  out.u32(static_cast<std::uint32_t>(topics_.size()));
  out.u32(0);  // attachments
  out.u32(0);  // metadata
  out.u32(static_cast<std::uint32_t>(chunks_.size()));
  out.u64(static_cast<std::uint64_t>(first));
  out.u64(static_cast<std::uint64_t>(last));
  out.byte_sequence(counts.data());
  return out;
}

MessageWriter McapWriter::chunk_index(const Chunk& chunk) const {
  MessageWriter offsets;
  for (const auto& [topic, offset] : chunk.index_offsets) {
    offsets.u16(id_of(topic));
    offsets.u64(offset);
  }
  MessageWriter out;
  out.u64(static_cast<std::uint64_t>(chunk.first));
  out.u64(static_cast<std::uint64_t>(chunk.last));
  out.u64(chunk.start);
  out.u64(chunk.length);
  out.byte_sequence(offsets.data());
  out.u64(chunk.index_length);
  out.string(name_of(compression_));
  out.u64(chunk.stored);
  out.u64(chunk.size);
  return out;
}

/// From the data's end to the end of the file.
void McapWriter::put_summary() {
  MessageWriter data_end;
  data_end.u32(crc_);
  put_record(McapOp::data_end, data_end);
  const std::uint64_t start = position_;
  crc_ = 0;  // of the summary, from here on
  MessageWriter offsets;
  const auto put_group = [&](McapOp op, std::size_t count, const auto& content) {
    const std::uint64_t begin = position_;
    for (std::size_t i = 0; i < count; ++i) put_record(op, content(i));
    if (count == 0) return;
    MessageWriter offset;
    offset.u8(static_cast<std::uint8_t>(op));
    offset.u64(begin);
    offset.u64(position_ - begin);
    append_record(offsets, McapOp::summary_offset, offset);
  };
  put_group(McapOp::schema, topics_.size(), [this](std::size_t i) { return schema(i); });
  put_group(McapOp::channel, topics_.size(), [this](std::size_t i) { return channel(i); });
  put_group(McapOp::statistics, 1, [this](std::size_t) { return statistics(); });
  put_group(McapOp::chunk_index, chunks_.size(), [this](std::size_t i) { return chunk_index(chunks_[i]); });
  const std::uint64_t offsets_start = position_;
  put(as_text(offsets.data()));
  MessageWriter footer;  // its checksum goes up to itself
  footer.u8(static_cast<std::uint8_t>(McapOp::footer));
  footer.u64(20);
  footer.u64(start);
  footer.u64(offsets_start);
  put(as_text(footer.data()));
  MessageWriter crc;
  crc.u32(crc_);
  put(as_text(crc.data()));
}

Status McapWriter::finish() {
  flush();
  put_summary();
  put_magic();
  return file_.commit();
}

}  // namespace

Expected<std::unique_ptr<BagContainerWriter>> create_mcap(const std::string& path, Compression compression) {
  EVPOSE_CHECK(compression != Compression::bz2);
  auto file = AtomicFile::create(path);
  if (!file) return file.error();
  return std::unique_ptr<BagContainerWriter>(std::make_unique<McapWriter>(*std::move(file), compression));
}

}  // namespace evpose
