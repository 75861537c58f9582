// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <map>

#include "evpose/core/version.h"
#include "evpose/io/bags/bag_container_writer.h"
#include "evpose/io/bags/mcap.h"
#include "evpose/io/bags/message_definitions.h"
#include "evpose/io/bags/message_writer.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/io/files/crc32.h"

namespace evpose {
namespace {

constexpr std::size_t kChunkBytes = 1 << 20;

std::string_view text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

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

class McapWriter : public BagContainerWriter {
 public:
  McapWriter(AtomicFile file, Compression compression) : file_(std::move(file)), compression_(compression) {
    put(std::string_view(reinterpret_cast<const char*>(kMcapMagic.data()), kMcapMagic.size()));
    MessageWriter header;
    header.string("ros2");
    header.string(text("evpose ", version()));
    put_record(McapOp::header, header);
  }

  Wire wire() const override { return Wire::cdr; }
  std::size_t add_topic(const std::string& name, const std::string& type) override {
    topics_.push_back({name, type});
    return topics_.size() - 1;
  }
  void write(std::size_t topic, TimeNs t, std::span<const std::byte> message) override;
  Status finish() override;

 private:
  struct Topic {
    std::string name, type;
    bool described = false;
    std::uint32_t messages = 0;
  };
  struct Entry {
    TimeNs t = 0;
    std::uint64_t offset = 0;
  };
  struct ChunkIndex {
    TimeNs first = INT64_MAX, last = INT64_MIN;
    std::uint64_t start = 0, length = 0, index_length = 0, stored = 0, size = 0;
    std::map<std::size_t, std::uint64_t> index_offsets;  ///< by topic
  };

  void put(std::string_view bytes) {
    file_.write(bytes);
    crc_ = crc32(bytes.data(), bytes.size(), crc_);
    position_ += bytes.size();
  }
  void put_record(McapOp op, const MessageWriter& content) {
    MessageWriter record;
    append_record(record, op, content);
    put(text_of(record.data()));
  }
  MessageWriter schema(std::size_t topic) const;
  MessageWriter channel(std::size_t topic) const;
  MessageWriter statistics() const;
  MessageWriter chunk_index(const ChunkIndex& chunk) const;
  void flush();
  void put_message_indexes(ChunkIndex& info);
  void put_summary();

  AtomicFile file_;
  Compression compression_;
  std::vector<Topic> topics_;
  std::uint64_t position_ = 0;
  std::uint32_t crc_ = 0;
  MessageWriter chunk_;
  std::map<std::size_t, std::vector<Entry>> index_;  ///< of the open chunk, by topic
  std::vector<ChunkIndex> chunks_;
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

void McapWriter::write(std::size_t topic, TimeNs t, std::span<const std::byte> message) {
  Topic& known = topics_[topic];
  if (!known.described) {
    append_record(chunk_, McapOp::schema, schema(topic));
    append_record(chunk_, McapOp::channel, channel(topic));
    known.described = true;
  }
  index_[topic].push_back({t, chunk_.size()});
  MessageWriter content;
  content.u16(id_of(topic));
  content.u32(known.messages++);
  content.u64(static_cast<std::uint64_t>(t));
  content.u64(static_cast<std::uint64_t>(t));
  content.bytes(message);
  append_record(chunk_, McapOp::message, content);
  if (chunk_.size() >= kChunkBytes) flush();
}

void McapWriter::put_message_indexes(ChunkIndex& info) {
  for (auto& [topic, entries] : index_) {
    std::stable_sort(entries.begin(), entries.end(),
                     [](const Entry& a, const Entry& b) { return a.t < b.t; });
    info.first = std::min(info.first, entries.front().t);
    info.last = std::max(info.last, entries.back().t);
    MessageWriter pairs;
    for (const Entry& entry : entries) {
      pairs.u64(static_cast<std::uint64_t>(entry.t));
      pairs.u64(entry.offset);
    }
    MessageWriter content;
    content.u16(id_of(topic));
    content.byte_sequence(pairs.data());
    info.index_offsets[topic] = position_;
    put_record(McapOp::message_index, content);
  }
}

void McapWriter::flush() {
  if (chunk_.size() == 0) return;
  ChunkIndex info;
  for (const auto& [topic, entries] : index_) {
    for (const Entry& entry : entries) {
      info.first = std::min(info.first, entry.t);
      info.last = std::max(info.last, entry.t);
    }
  }
  const auto stored = compress(compression_, chunk_.data());
  info.start = position_;
  info.size = chunk_.size();
  info.stored = stored.size();
  MessageWriter content;
  content.u64(static_cast<std::uint64_t>(info.first));
  content.u64(static_cast<std::uint64_t>(info.last));
  content.u64(info.size);
  content.u32(crc32(chunk_.data().data(), chunk_.size()));
  content.string(name_of(compression_));
  content.u64(info.stored);
  content.bytes(stored);
  put_record(McapOp::chunk, content);
  info.length = position_ - info.start;
  put_message_indexes(info);
  info.index_length = position_ - info.start - info.length;
  chunks_.push_back(std::move(info));
  chunk_.clear();
  index_.clear();
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
  for (const ChunkIndex& chunk : chunks_) {
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

MessageWriter McapWriter::chunk_index(const ChunkIndex& chunk) const {
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
  put(text_of(offsets.data()));
  MessageWriter footer;  // its checksum goes up to itself
  footer.u8(static_cast<std::uint8_t>(McapOp::footer));
  footer.u64(20);
  footer.u64(start);
  footer.u64(offsets_start);
  put(text_of(footer.data()));
  MessageWriter crc;
  crc.u32(crc_);
  put(text_of(crc.data()));
}

Status McapWriter::finish() {
  flush();
  put_summary();
  put(std::string_view(reinterpret_cast<const char*>(kMcapMagic.data()), kMcapMagic.size()));
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
