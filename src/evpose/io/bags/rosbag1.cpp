// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/bags/rosbag1.h"

#include "evpose/io/bags/chunked_bag_reader.h"
#include "evpose/io/files/byte_stream.h"

namespace evpose {
namespace {

constexpr std::string_view kAnyMagic = "#ROSBAG V";

/// The fields of a record's header that anything is done with.
struct Header {
  Rosbag1Op op = Rosbag1Op::none;
  std::uint32_t connection = 0, count = 0, size = 0;
  std::uint32_t connections = 0, chunks = 0;
  std::uint64_t position = 0;  ///< index_pos, chunk_pos
  TimeNs t = 0;
  std::string_view compression, topic, type, md5;
};

/// False: not a sequence of name=value.
bool parse_header(std::span<const std::byte> bytes, Header& out) {
  out = {};
  MessageReader reader(bytes);
  while (reader.ok() && reader.left() > 0) {
    const auto field = reader.byte_sequence();
    const std::string_view whole = as_text(field);
    const std::size_t equals = whole.find('=');
    if (!reader.ok() || equals == std::string_view::npos) return false;
    const std::string_view name = whole.substr(0, equals);
    MessageReader value(field.subspan(equals + 1));
    if (name == "op") out.op = static_cast<Rosbag1Op>(value.u8());
    if (name == "conn") out.connection = value.u32();
    if (name == "count") out.count = value.u32();
    if (name == "size") out.size = value.u32();
    if (name == "conn_count") out.connections = value.u32();
    if (name == "chunk_count") out.chunks = value.u32();
    if (name == "index_pos" || name == "chunk_pos") out.position = value.u64();
    if (name == "time") out.t = value.time();
    if (name == "compression") out.compression = as_text(value.rest());
    if (name == "topic") out.topic = as_text(value.rest());
    if (name == "type") out.type = as_text(value.rest());
    if (name == "md5sum") out.md5 = as_text(value.rest());
    if (!value.ok()) return false;
  }
  return reader.ok();
}

class Rosbag1Reader : public ChunkedBagReader {
 public:
  using ChunkedBagReader::ChunkedBagReader;

 private:
  Expected<std::int64_t> read_file_head() override;
  Expected<bool> read_index() override;
  Expected<bool> read_record_head(RecordKind& kind, std::uint64_t& data_size) override;
  bool take_record(std::span<const std::byte>& chunk, Record& record) override;
  bool add_topic_record(std::span<const std::byte> data) override;
  bool parse_chunk(std::span<const std::byte> data, Chunk& chunk) const override;
  bool parse_message(std::span<const std::byte> data, Message& message) const override;

  RecordKind kind_of_header() const;
  Expected<bool> read_number(std::uint32_t& out);
  bool add_chunk_info(std::span<const std::byte> data);

  std::vector<std::byte> length_room_, header_room_;
  Header header_;                               ///< of the record read last
  std::uint64_t index_byte_ = 0;                ///< 0: the bag was not closed
  std::uint32_t connections_ = 0, chunks_ = 0;  ///< that the index has to hold
};

Rosbag1Reader::RecordKind Rosbag1Reader::kind_of_header() const {
  if (header_.op == Rosbag1Op::none) return RecordKind::invalid;
  if (header_.op == Rosbag1Op::connection) return RecordKind::topic;
  if (header_.op == Rosbag1Op::chunk) return RecordKind::chunk;
  if (header_.op == Rosbag1Op::message) return RecordKind::message;
  return RecordKind::other;
}

Expected<bool> Rosbag1Reader::read_number(std::uint32_t& out) {
  const auto got = file_.read(sizeof(out), length_room_);
  if (got && *got) out = MessageReader(length_room_).u32();
  return got;
}

Expected<bool> Rosbag1Reader::read_record_head(RecordKind& kind, std::uint64_t& data_size) {
  std::uint32_t header_size = 0, size = 0;
  if (const auto got = read_number(header_size); !got || !*got) return got;
  if (const auto got = file_.read(header_size, header_room_); !got || !*got) return got;
  if (const auto got = read_number(size); !got || !*got) return got;
  data_size = size;
  if (!parse_header(std::span(header_room_).first(header_size), header_)) header_.op = Rosbag1Op::none;
  kind = kind_of_header();
  return true;
}

bool Rosbag1Reader::take_record(std::span<const std::byte>& chunk, Record& record) {
  MessageReader reader(chunk);
  const auto header = reader.byte_sequence();
  const auto data = reader.byte_sequence();
  if (!reader.ok() || !parse_header(header, header_)) return false;
  record = {kind_of_header(), data};
  chunk = reader.rest();
  return true;
}

Expected<std::int64_t> Rosbag1Reader::read_file_head() {
  const auto magic = file_.read(kRosbag1Magic.size(), room_);
  if (!magic) return magic.error();
  const std::string_view head = as_text(room_);
  if (!*magic || head != kRosbag1Magic) {
    if (head.starts_with(kAnyMagic))
      return Error{file_.path(), "is a bag of another version than 2.0", "bring it to 2.0 by `rosbag fix`"};
    return Error{file_.path(), "is not a ROS 1 bag", "check the path"};
  }
  RecordKind kind = RecordKind::invalid;
  std::uint64_t size = 0;
  const auto whole = read_record_head(kind, size);
  if (!whole) return whole.error();
  if (!*whole || header_.op != Rosbag1Op::bag || size > file_.left())
    return damaged("the bag's head is damaged");
  index_byte_ = header_.position;
  connections_ = header_.connections;
  chunks_ = header_.chunks;
  return file_.position() + static_cast<std::int64_t>(size);
}

bool Rosbag1Reader::add_topic_record(std::span<const std::byte> data) {
  Header more;
  if (!parse_header(data, more)) return false;
  add_topic(header_.connection,
            {std::string(header_.topic), std::string(more.type), Wire::ros1, std::string(more.md5), 0});
  return true;
}

bool Rosbag1Reader::add_chunk_info(std::span<const std::byte> data) {
  if (header_.position < static_cast<std::uint64_t>(first_record_) || header_.position >= index_byte_)
    return false;
  MessageReader counts(data);
  for (std::uint32_t k = 0; k < header_.count && counts.ok(); ++k) {
    const std::size_t* topic = topic_of(counts.u32());
    const std::uint32_t count = counts.u32();
    if (!counts.ok() || topic == nullptr) return false;
    if (count == 0) continue;
    add_messages(*topic, count);
    add_chunk(*topic, static_cast<std::int64_t>(header_.position));
  }
  return true;
}

Expected<bool> Rosbag1Reader::read_index() {
  if (index_byte_ < static_cast<std::uint64_t>(first_record_) ||
      index_byte_ > static_cast<std::uint64_t>(file_.size()))
    return false;
  if (auto status = file_.seek(static_cast<std::int64_t>(index_byte_)); !status) return status.error();
  std::uint32_t connections = 0, chunks = 0;
  while (file_.left() > 0) {
    RecordKind kind = RecordKind::invalid;
    std::uint64_t size = 0;
    const auto whole = read_record_head(kind, size);
    if (!whole) return whole.error();
    if (!*whole || size > file_.left()) return false;
    const auto got = file_.read(size, room_);
    if (!got) return got.error();
    const auto data = std::span(room_).first(size);
    if (header_.op == Rosbag1Op::connection) {
      if (!add_topic_record(data)) return false;
      ++connections;
    } else if (header_.op == Rosbag1Op::chunk_info) {
      if (!add_chunk_info(data)) return false;
      ++chunks;
    }
  }
  return connections == connections_ && chunks == chunks_;
}

bool Rosbag1Reader::parse_chunk(std::span<const std::byte> data, Chunk& chunk) const {
  chunk.compression = header_.compression;
  chunk.stored = data;
  chunk.size = header_.size;
  return true;
}

bool Rosbag1Reader::parse_message(std::span<const std::byte> data, Message& message) const {
  message = {header_.connection, header_.t, data};
  return true;
}

}  // namespace

Expected<std::unique_ptr<BagReader>> open_rosbag1(const std::string& path) {
  return open_chunked_bag<Rosbag1Reader>(path);
}

}  // namespace evpose
