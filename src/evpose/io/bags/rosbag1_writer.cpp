// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <map>

#include "evpose/io/bags/bag_container_writer.h"
#include "evpose/io/bags/message_definitions.h"
#include "evpose/io/bags/message_writer.h"
#include "evpose/io/bags/rosbag1.h"
#include "evpose/io/files/atomic_file.h"

namespace evpose {
namespace {

constexpr std::size_t kChunkBytes = 768 << 10;  // as rosbag makes them
constexpr std::size_t kHeadBytes = 4096;        // of the first record's header and data

std::string_view text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

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
    return add(name, text_of(number.data()));
  }
  Fields& u64(std::string_view name, std::uint64_t value) {
    MessageWriter number;
    number.u64(value);
    return add(name, text_of(number.data()));
  }
  Fields& time(std::string_view name, TimeNs t) {
    MessageWriter number;
    number.time(t);
    return add(name, text_of(number.data()));
  }
  std::span<const std::byte> data() const { return out_.data(); }

 private:
  MessageWriter out_;
};

class Rosbag1Writer : public BagContainerWriter {
 public:
  Rosbag1Writer(AtomicFile file, Compression compression)
      : file_(std::move(file)), compression_(compression) {
    put(kRosbag1Magic);
    put_head(0);
  }

  Wire wire() const override { return Wire::ros1; }
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
  };
  struct Entry {
    TimeNs t = 0;
    std::uint32_t offset = 0;
  };
  struct ChunkInfo {
    std::uint64_t position = 0;
    TimeNs first = 0, last = 0;
    std::map<std::size_t, std::uint32_t> counts;  ///< by topic
  };

  void put(std::string_view bytes) {
    file_.write(bytes);
    position_ += bytes.size();
  }
  void put_record(const Fields& header, std::span<const std::byte> data);
  void put_head(std::uint64_t index);
  MessageWriter head(std::uint64_t index) const;
  MessageWriter connection(std::size_t topic) const;
  void flush();

  AtomicFile file_;
  Compression compression_;
  std::vector<Topic> topics_;
  std::uint64_t position_ = 0;
  MessageWriter chunk_;
  std::map<std::size_t, std::vector<Entry>> index_;  ///< of the open chunk, by topic
  std::vector<ChunkInfo> chunks_;
};

void append_record(MessageWriter& out, const Fields& header, std::span<const std::byte> data) {
  out.byte_sequence(header.data());
  out.byte_sequence(data);
}

void Rosbag1Writer::put_record(const Fields& header, std::span<const std::byte> data) {
  MessageWriter record;
  append_record(record, header, data);
  put(text_of(record.data()));
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

void Rosbag1Writer::put_head(std::uint64_t index) { put(text_of(head(index).data())); }

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

void Rosbag1Writer::write(std::size_t topic, TimeNs t, std::span<const std::byte> message) {
  if (!topics_[topic].described) chunk_.bytes(connection(topic).data());
  topics_[topic].described = true;
  index_[topic].push_back({t, static_cast<std::uint32_t>(chunk_.size())});
  Fields header(Rosbag1Op::message);
  header.u32("conn", static_cast<std::uint32_t>(topic)).time("time", t);
  append_record(chunk_, header, message);
  if (chunk_.size() >= kChunkBytes) flush();
}

void Rosbag1Writer::flush() {
  if (chunk_.size() == 0) return;
  ChunkInfo info{position_, INT64_MAX, INT64_MIN, {}};
  Fields header(Rosbag1Op::chunk);
  header.add("compression", compression_ == Compression::lz4 ? "lz4" : "none")
      .u32("size", static_cast<std::uint32_t>(chunk_.size()));
  put_record(header, compress(compression_, chunk_.data()));
  for (auto& [topic, entries] : index_) {
    std::stable_sort(entries.begin(), entries.end(),
                     [](const Entry& a, const Entry& b) { return a.t < b.t; });
    Fields fields(Rosbag1Op::index);
    fields.u32("ver", 1)
        .u32("conn", static_cast<std::uint32_t>(topic))
        .u32("count", static_cast<std::uint32_t>(entries.size()));
    MessageWriter data;
    for (const Entry& entry : entries) {
      data.time(entry.t);
      data.u32(entry.offset);
    }
    put_record(fields, data.data());
    info.first = std::min(info.first, entries.front().t);
    info.last = std::max(info.last, entries.back().t);
    info.counts[topic] = static_cast<std::uint32_t>(entries.size());
  }
  chunks_.push_back(std::move(info));
  chunk_.clear();
  index_.clear();
}

Status Rosbag1Writer::finish() {
  flush();
  const std::uint64_t index = position_;
  for (std::size_t topic = 0; topic < topics_.size(); ++topic) put(text_of(connection(topic).data()));
  for (const ChunkInfo& chunk : chunks_) {
    Fields fields(Rosbag1Op::chunk_info);
    fields.u32("ver", 1)
        .u64("chunk_pos", chunk.position)
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
  file_.overwrite(static_cast<std::int64_t>(kRosbag1Magic.size()), text_of(head(index).data()));
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
