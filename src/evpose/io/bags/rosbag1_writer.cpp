// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/bags/chunked_bag_writer.h"
#include "evpose/io/bags/message_definitions.h"
#include "evpose/io/bags/rosbag1.h"
#include "evpose/io/files/byte_stream.h"

namespace evpose {
namespace {

constexpr std::size_t kChunkBytes = 768 << 10;  // as rosbag makes them
constexpr std::size_t kHeadBytes = 4096;        // of the first record's header and data

/// The fields of a record's header.
class Fields {
 public:
  explicit Fields(Rosbag1Op op) { add("op", std::string(1, static_cast<char>(op))); }
  Fields() = default;

  Fields& add(std::string_view name, std::string_view value) {
    out_.byte_sequence(std::string(name) + "=" + std::string(value));
    return *this;
  }
  Fields& u32(std::string_view name, std::uint32_t value) {
    MessageWriter number;
    number.u32(value);
    return add(name, as_text(number.data()));
  }
  Fields& u64(std::string_view name, std::uint64_t value) {
    MessageWriter number;
    number.u64(value);
    return add(name, as_text(number.data()));
  }
  Fields& time(std::string_view name, TimeNs t) {
    MessageWriter number;
    number.time(t);
    return add(name, as_text(number.data()));
  }
  std::span<const std::byte> data() const { return out_.data(); }

 private:
  MessageWriter out_;
};

class Rosbag1Writer : public ChunkedBagWriter {
 public:
  Rosbag1Writer(AtomicFile file, Compression compression)
      : ChunkedBagWriter(std::move(file), compression, kChunkBytes) {
    put(kRosbag1Magic);
    put(as_text(head(0).data()));
  }

  Wire wire() const override { return Wire::ros1; }
  Status finish() override;

 private:
  void append_topic(MessageWriter& chunk, std::size_t topic) const override {
    chunk.bytes(connection(topic).data());
  }
  void append_message(MessageWriter& chunk, std::size_t topic, TimeNs t,
                      std::span<const std::byte> message) const override;
  void put_chunk(const Chunk& chunk, std::span<const std::byte> unpacked,
                 std::span<const std::byte> stored) override;
  void put_index(std::size_t topic, const std::vector<IndexEntry>& entries) override;

  void put_record(const Fields& header, std::span<const std::byte> data);
  MessageWriter head(std::uint64_t index) const;
  MessageWriter connection(std::size_t topic) const;
};

void append_record(MessageWriter& out, const Fields& header, std::span<const std::byte> data) {
  out.byte_sequence(header.data());
  out.byte_sequence(data);
}

void Rosbag1Writer::put_record(const Fields& header, std::span<const std::byte> data) {
  MessageWriter record;
  append_record(record, header, data);
  put(as_text(record.data()));
}

MessageWriter Rosbag1Writer::head(std::uint64_t index) const {
  Fields fields(Rosbag1Op::bag);
  fields.u64("index_pos", index)
      .u32("conn_count", static_cast<std::uint32_t>(topics_.size()))
      .u32("chunk_count", static_cast<std::uint32_t>(chunks_.size()));
  const std::string blanks(kHeadBytes - fields.data().size(), ' ');
  MessageWriter out;
  append_record(out, fields, std::as_bytes(std::span(blanks)));
  return out;
}

MessageWriter Rosbag1Writer::connection(std::size_t topic) const {
  const Topic& t = topics_[topic];
  Fields header(Rosbag1Op::connection);
  header.u32("conn", static_cast<std::uint32_t>(topic)).add("topic", t.name);
  Fields body;
  body.add("topic", t.name)
      .add("type", t.type)
      .add("md5sum", message_md5(t.type))
      .add("message_definition", message_definition(t.type, Wire::ros1));
  MessageWriter out;
  append_record(out, header, body.data());
  return out;
}

void Rosbag1Writer::append_message(MessageWriter& chunk, std::size_t topic, TimeNs t,
                                   std::span<const std::byte> message) const {
  Fields header(Rosbag1Op::message);
  header.u32("conn", static_cast<std::uint32_t>(topic)).time("time", t);
  append_record(chunk, header, message);
}

void Rosbag1Writer::put_chunk(const Chunk& chunk, std::span<const std::byte>,
                              std::span<const std::byte> stored) {
  Fields header(Rosbag1Op::chunk);
  header.add("compression", compression_ == Compression::lz4 ? "lz4" : "none")
      .u32("size", static_cast<std::uint32_t>(chunk.size));
  put_record(header, stored);
}

void Rosbag1Writer::put_index(std::size_t topic, const std::vector<IndexEntry>& entries) {
  Fields header(Rosbag1Op::index);
  header.u32("ver", 1)
      .u32("conn", static_cast<std::uint32_t>(topic))
      .u32("count", static_cast<std::uint32_t>(entries.size()));
  MessageWriter data;
  for (const IndexEntry& entry : entries) {
    data.time(entry.t);
    data.u32(static_cast<std::uint32_t>(entry.offset));
  }
  put_record(header, data.data());
}

Status Rosbag1Writer::finish() {
  flush();
  const std::uint64_t index = position_;
  for (std::size_t topic = 0; topic < topics_.size(); ++topic) put(as_text(connection(topic).data()));
  for (const Chunk& chunk : chunks_) {
    Fields fields(Rosbag1Op::chunk_info);
    fields.u32("ver", 1)
        .u64("chunk_pos", chunk.start)
        .time("start_time", chunk.first)
        .time("end_time", chunk.last)
        .u32("count", static_cast<std::uint32_t>(chunk.counts.size()));
    MessageWriter data;
    for (const auto& [topic, count] : chunk.counts) {
      data.u32(static_cast<std::uint32_t>(topic));
      data.u32(count);
    }
    put_record(fields, data.data());
  }
  file_.overwrite(static_cast<std::int64_t>(kRosbag1Magic.size()), as_text(head(index).data()));
  return file_.commit();
}

}  // namespace

Expected<std::unique_ptr<BagContainerWriter>> create_rosbag1(const std::string& path,
                                                             Compression compression) {
  EVPOSE_CHECK(compression == Compression::none || compression == Compression::lz4);
  auto file = AtomicFile::create(path);
  if (!file) return file.error();
  return std::unique_ptr<BagContainerWriter>(std::make_unique<Rosbag1Writer>(*std::move(file), compression));
}

}  // namespace evpose
