// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/bags/rosbag1.h"

#include <algorithm>
#include <map>
#include <optional>
#include <unordered_map>

#include "evpose/core/log.h"
#include "evpose/io/files/binary_file.h"
#include "evpose/io/files/compression.h"

namespace evpose {
namespace {

constexpr std::string_view kAnyMagic = "#ROSBAG V";
const std::string kCopyAgain = "copy the bag again from its source";

std::string_view text_of(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

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
    const std::string_view whole = text_of(field);
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
    if (name == "compression") out.compression = text_of(value.rest());
    if (name == "topic") out.topic = text_of(value.rest());
    if (name == "type") out.type = text_of(value.rest());
    if (name == "md5sum") out.md5 = text_of(value.rest());
    if (!value.ok()) return false;
  }
  return reader.ok();
}

class Rosbag1Reader : public BagReader {
 public:
  explicit Rosbag1Reader(BinaryFile file) : file_(std::move(file)) {}

  Status open();
  Status select(const std::vector<std::size_t>& topics) override {
    selected_.assign(topics_.size(), false);
    for (const std::size_t topic : topics) selected_[topic] = true;
    return {};
  }
  Expected<bool> next(BagMessage& message) override;
  Status rewind() override { return go_to(first_record_); }
  Status go_to_last(std::size_t topic) override { return go_to(last_chunk_[topic]); }
  Status count_messages() override { return {}; }

 private:
  Expected<Header> read_head();
  Expected<bool> read_index(const Header& head);
  Status scan();
  bool add_connection(const Header& header, std::span<const std::byte> data);
  void add_messages(std::size_t topic, std::int64_t count, std::int64_t chunk);
  Status go_to(std::int64_t position);
  Expected<bool> next_record(BagMessage& message, bool& is_message);
  Expected<bool> next_in_chunk(BagMessage& message);
  Status load_chunk(const Header& header, std::span<const std::byte> data);
  Expected<bool> deliver(const Header& header, std::span<const std::byte> data, BagMessage& message);
  bool read_record(Header& header, std::uint32_t& data_size);
  void warn_of_cut();
  Error damaged(std::int64_t byte, const std::string& what) const {
    return Error{text(file_.path(), ", byte ", byte), what, kCopyAgain};
  }

  BinaryFile file_;
  std::int64_t first_record_ = 0;
  std::unordered_map<std::uint32_t, std::size_t> topic_of_connection_;
  std::vector<bool> selected_;
  std::vector<std::int64_t> last_chunk_;  ///< of each topic: where its last message is
  bool scanning_ = false, warned_ = false, ended_ = false;

  std::vector<std::byte> length_room_, header_room_, data_room_, chunk_room_;
  std::span<const std::byte> chunk_;  ///< what is left of the open chunk
  std::int64_t chunk_byte_ = 0;       ///< where the open chunk or record begins
};

Status Rosbag1Reader::go_to(std::int64_t position) {
  chunk_ = {};
  ended_ = false;
  return file_.seek(position);
}

/// Reads a record up to its data. False: the file ends before the record does.
bool Rosbag1Reader::read_record(Header& header, std::uint32_t& data_size) {
  chunk_byte_ = file_.position();
  const auto number = [&](std::uint32_t& out) {
    const auto got = file_.read(4, length_room_);
    if (!got || !*got) return false;
    out = MessageReader(length_room_).u32();
    return true;
  };
  std::uint32_t header_size = 0;
  if (!number(header_size) || header_size > file_.left()) return false;
  const auto got = file_.read(header_size, header_room_);
  if (!got || !*got || !number(data_size) || data_size > file_.left()) return false;
  if (!parse_header(std::span(header_room_).first(header_size), header)) header.op = Rosbag1Op::none;
  return true;
}

void Rosbag1Reader::warn_of_cut() {
  if (warned_ || chunk_byte_ >= file_.size()) return;
  warned_ = true;
  log_warning(text(file_.path(), ", byte ", chunk_byte_,
                   ": the bag ends inside a record; what is whole before it is read"));
}

Expected<Header> Rosbag1Reader::read_head() {
  const auto magic = file_.read(kRosbag1Magic.size(), data_room_);
  if (!magic) return magic.error();
  const std::string_view head = text_of(data_room_);
  if (!*magic || head != kRosbag1Magic) {
    if (head.starts_with(kAnyMagic))
      return Error{file_.path(), "is a bag of another version than 2.0", "bring it to 2.0 by `rosbag fix`"};
    return Error{file_.path(), "is not a ROS 1 bag", "check the path"};
  }
  Header header;
  std::uint32_t data_size = 0;
  if (!read_record(header, data_size) || header.op != Rosbag1Op::bag)
    return damaged(static_cast<std::int64_t>(kRosbag1Magic.size()), "the bag's head is damaged");
  first_record_ = file_.position() + data_size;
  return header;
}

Status Rosbag1Reader::open() {
  const auto head = read_head();
  if (!head) return head.error();
  bool indexed = false;
  if (head->position != 0) {
    const auto read = read_index(*head);
    if (!read) return read.error();
    indexed = *read;
  }
  if (!indexed) {
    log_warning(file_.path() +
                ": the bag has no whole index, it was not closed: all of it is read for its topics");
    if (auto status = scan(); !status) return status;
  }
  selected_.assign(topics_.size(), true);
  return rewind();
}

bool Rosbag1Reader::add_connection(const Header& header, std::span<const std::byte> data) {
  Header more;
  if (!parse_header(data, more)) return false;
  const auto same = [&](const BagTopic& t) {
    return t.name == header.topic && t.type == more.type && t.md5 == more.md5;
  };
  const auto it = std::find_if(topics_.begin(), topics_.end(), same);
  topic_of_connection_[header.connection] = static_cast<std::size_t>(it - topics_.begin());
  if (it != topics_.end()) return true;
  topics_.push_back(
      {std::string(header.topic), std::string(more.type), Wire::ros1, std::string(more.md5), 0});
  last_chunk_.push_back(first_record_);
  return true;
}

void Rosbag1Reader::add_messages(std::size_t topic, std::int64_t count, std::int64_t chunk) {
  if (count <= 0) return;
  topics_[topic].messages += count;
  last_chunk_[topic] = std::max(last_chunk_[topic], chunk);
}

/// Connections and chunk infos from the index on; false if they are not all there.
Expected<bool> Rosbag1Reader::read_index(const Header& head) {
  const std::uint64_t index = head.position;
  const auto size = static_cast<std::uint64_t>(file_.size());
  if (index < static_cast<std::uint64_t>(first_record_) || index > size) return false;
  if (auto status = file_.seek(static_cast<std::int64_t>(index)); !status) return status.error();
  std::uint32_t connections = 0, chunks = 0;
  bool sound = true;
  Header header;
  std::uint32_t data_size = 0;
  while (sound && file_.left() > 0 && (sound = read_record(header, data_size))) {
    const auto got = file_.read(data_size, data_room_);
    if (!got) return got.error();
    const auto data = std::span(data_room_).first(data_size);
    if (header.op == Rosbag1Op::connection) {
      sound = add_connection(header, data);
      ++connections;
    } else if (header.op == Rosbag1Op::chunk_info) {
      sound = header.position >= static_cast<std::uint64_t>(first_record_) && header.position < index;
      MessageReader counts(data);
      for (std::uint32_t k = 0; sound && k < header.count && counts.ok(); ++k) {
        const std::uint32_t connection = counts.u32(), count = counts.u32();
        const auto topic = topic_of_connection_.find(connection);
        sound = counts.ok() && topic != topic_of_connection_.end();
        if (sound) add_messages(topic->second, count, static_cast<std::int64_t>(header.position));
      }
      ++chunks;
    }
  }
  if (sound && connections == head.connections && chunks == head.chunks) return true;
  topics_.clear(), last_chunk_.clear(), topic_of_connection_.clear();
  return false;
}

Status Rosbag1Reader::scan() {
  scanning_ = true;
  if (auto status = rewind(); !status) return status;
  BagMessage message;
  while (true) {
    const auto more = next(message);
    if (!more) return more.error();
    if (!*more) break;
    add_messages(message.topic, 1, chunk_byte_);
  }
  scanning_ = false;
  return {};
}

Status Rosbag1Reader::load_chunk(const Header& header, std::span<const std::byte> data) {
  if (header.compression == "none") {
    if (header.size != data.size()) return damaged(chunk_byte_, "a chunk states a wrong size");
    chunk_ = data;
    return {};
  }
  if (header.compression != "lz4" && header.compression != "bz2")
    return damaged(chunk_byte_,
                   text("a chunk with the unknown compression '", header.compression.substr(0, 20), "'"));
  const auto method = header.compression == "lz4" ? Compression::lz4 : Compression::bz2;
  const auto size =
      decompress(method, data, kLargestChunk, text(file_.path(), ", byte ", chunk_byte_), chunk_room_);
  if (!size) return size.error();
  if (*size != header.size) return damaged(chunk_byte_, "a chunk states a wrong size");
  chunk_ = std::span(chunk_room_).first(*size);
  return {};
}

/// True if the message is one that is wanted.
Expected<bool> Rosbag1Reader::deliver(const Header& header, std::span<const std::byte> data,
                                      BagMessage& message) {
  const auto topic = topic_of_connection_.find(header.connection);
  if (topic == topic_of_connection_.end())
    return damaged(chunk_byte_,
                   text("a message of connection ", header.connection, ", which the bag does not describe"));
  if (!scanning_ && !selected_[topic->second]) return false;
  message = {topic->second, header.t, data};
  return true;
}

Expected<bool> Rosbag1Reader::next_in_chunk(BagMessage& message) {
  MessageReader reader(chunk_);
  const auto header_bytes = reader.byte_sequence();
  const auto data = reader.byte_sequence();
  Header header;
  if (!reader.ok() || !parse_header(header_bytes, header) || header.op == Rosbag1Op::none)
    return damaged(chunk_byte_, "a chunk holds something else than records");
  chunk_ = reader.rest();
  if (header.op == Rosbag1Op::connection && scanning_ && !add_connection(header, data))
    return damaged(chunk_byte_, "a connection record is damaged");
  if (header.op != Rosbag1Op::message) return false;
  return deliver(header, data, message);
}

/// One record outside of chunks; false at the end of the file.
Expected<bool> Rosbag1Reader::next_record(BagMessage& message, bool& is_message) {
  Header header;
  std::uint32_t data_size = 0;
  if (!read_record(header, data_size)) {
    warn_of_cut();
    return false;
  }
  if (header.op == Rosbag1Op::none) return damaged(chunk_byte_, "no record begins here");
  const bool wanted = header.op == Rosbag1Op::chunk || header.op == Rosbag1Op::message ||
                      (scanning_ && header.op == Rosbag1Op::connection);
  if (!wanted) {
    if (auto status = file_.seek(file_.position() + data_size); !status) return status.error();
    return true;
  }
  if (data_size > kLargestChunk) return damaged(chunk_byte_, text("a record of ", data_size, " bytes"));
  const auto got = file_.read(data_size, data_room_);
  if (!got) return got.error();
  const auto data = std::span(data_room_).first(data_size);
  if (header.op == Rosbag1Op::connection && !add_connection(header, data))
    return damaged(chunk_byte_, "a connection record is damaged");
  if (header.op == Rosbag1Op::chunk)
    if (auto status = load_chunk(header, data); !status) return status.error();
  if (header.op == Rosbag1Op::message) {
    const auto given = deliver(header, data, message);
    if (!given) return given.error();
    is_message = *given;
  }
  return true;
}

Expected<bool> Rosbag1Reader::next(BagMessage& message) {
  while (true) {
    while (!chunk_.empty()) {
      const auto given = next_in_chunk(message);
      if (!given) return given.error();
      if (*given) return true;
    }
    if (ended_) return false;
    bool is_message = false;
    const auto more = next_record(message, is_message);
    if (!more) return more.error();
    ended_ = !*more;
    if (is_message) return true;
  }
}

}  // namespace

Expected<std::unique_ptr<BagReader>> open_rosbag1(const std::string& path) {
  auto file = BinaryFile::open(path);
  if (!file) return file.error();
  auto reader = std::make_unique<Rosbag1Reader>(*std::move(file));
  if (auto status = reader->open(); !status) return status.error();
  return std::unique_ptr<BagReader>(std::move(reader));
}

}  // namespace evpose
