// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/bags/mcap.h"

#include <algorithm>
#include <cstring>
#include <optional>
#include <unordered_map>

#include "evpose/core/log.h"
#include "evpose/io/files/binary_file.h"
#include "evpose/io/files/compression.h"
#include "evpose/io/files/crc32.h"

namespace evpose {
namespace {

constexpr std::size_t kRecordHead = 9;  // op and length
constexpr std::int64_t kFooterBytes = kRecordHead + 20;
constexpr std::size_t kLargestSummary = 256 << 20;
const std::string kCopyAgain = "copy the file again from its source";

struct Record {
  McapOp op = McapOp::header;
  std::span<const std::byte> content;
};

/// Takes one record from the front of `bytes`; false if it is not whole.
bool take_record(std::span<const std::byte>& bytes, Record& record) {
  MessageReader reader(bytes);
  record.op = static_cast<McapOp>(reader.u8());
  const std::uint64_t size = reader.u64();
  if (!reader.ok() || size > reader.left()) return false;
  record.content = reader.bytes(size);
  bytes = reader.rest();
  return true;
}

/// "package/msg/Type" as ROS 1 would write it.
std::string plain_type(std::string_view type) {
  std::string out(type);
  if (const auto middle = out.find("/msg/"); middle != std::string::npos) out.erase(middle, 4);
  return out;
}

class McapReader : public BagReader {
 public:
  explicit McapReader(BinaryFile file) : file_(std::move(file)) {}

  Status open();
  Status select(const std::vector<std::size_t>& topics) override {
    selected_.assign(topics_.size(), false);
    for (const std::size_t topic : topics) selected_[topic] = true;
    return {};
  }
  Expected<bool> next(BagMessage& message) override;
  Status rewind() override { return go_to(static_cast<std::int64_t>(kMcapMagic.size())); }
  Status go_to_last(std::size_t topic) override { return go_to(last_chunk_[topic]); }
  Status count_messages() override { return {}; }

 private:
  Expected<bool> read_summary();
  bool parse_summary(std::span<const std::byte> summary);
  bool add_statistics(std::span<const std::byte> content);
  bool add_chunk_index(std::span<const std::byte> content);
  Status scan();
  bool add_schema(std::span<const std::byte> content);
  bool add_channel(std::span<const std::byte> content);
  void forget();
  Status go_to(std::int64_t position);
  Expected<bool> read_record(Record& record);
  bool is_wanted(McapOp op) const;
  Status take(const Record& record, BagMessage& message, bool& given);
  Status load_chunk(std::span<const std::byte> content);
  Error damaged(const std::string& what) const {
    return Error{text(file_.path(), ", byte ", record_byte_), what, kCopyAgain};
  }

  BinaryFile file_;
  std::unordered_map<std::uint16_t, std::string> type_of_schema_;
  std::unordered_map<std::uint16_t, std::size_t> topic_of_channel_;
  std::vector<bool> selected_;
  std::vector<std::int64_t> last_chunk_;  ///< of each topic: where its last message is
  bool scanning_ = false, warned_ = false, ended_ = false;

  std::vector<std::byte> head_room_, room_, chunk_room_;
  std::span<const std::byte> chunk_;  ///< what is left of the open chunk
  std::int64_t record_byte_ = 0;      ///< where the record read last, or the open chunk, begins
};

Status McapReader::go_to(std::int64_t position) {
  chunk_ = {};
  ended_ = false;
  return file_.seek(position);
}

void McapReader::forget() {
  topics_.clear(), last_chunk_.clear(), topic_of_channel_.clear(), type_of_schema_.clear();
}

bool McapReader::add_schema(std::span<const std::byte> content) {
  MessageReader reader(content);
  const std::uint16_t id = reader.u16();
  const std::string_view name = reader.string();
  if (reader.ok()) type_of_schema_[id] = plain_type(name);
  return reader.ok();
}

bool McapReader::add_channel(std::span<const std::byte> content) {
  MessageReader reader(content);
  const std::uint16_t id = reader.u16(), schema = reader.u16();
  const std::string_view name = reader.string(), encoding = reader.string();
  if (!reader.ok()) return false;
  const auto wire = encoding == "cdr" ? Wire::cdr : encoding == "ros1" ? Wire::ros1 : Wire::other;
  const auto found = type_of_schema_.find(schema);
  const std::string type = found == type_of_schema_.end() ? "" : found->second;
  const auto same = [&](const BagTopic& t) { return t.name == name && t.type == type && t.wire == wire; };
  const auto it = std::find_if(topics_.begin(), topics_.end(), same);
  topic_of_channel_[id] = static_cast<std::size_t>(it - topics_.begin());
  if (it != topics_.end()) return true;
  topics_.push_back({std::string(name), type, wire, "", 0});
  last_chunk_.push_back(static_cast<std::int64_t>(kMcapMagic.size()));
  return true;
}

bool McapReader::add_statistics(std::span<const std::byte> content) {
  MessageReader reader(content);
  reader.skip(8 + 2 + 4 * 4 + 8 + 8);
  MessageReader counts(reader.byte_sequence());
  while (counts.ok() && counts.left() > 0) {
    const auto topic = topic_of_channel_.find(counts.u16());
    const std::uint64_t count = counts.u64();
    if (!counts.ok() || topic == topic_of_channel_.end() || count > INT64_MAX / 65536) return false;
    topics_[topic->second].messages += static_cast<std::int64_t>(count);
  }
  return reader.ok() && counts.ok();
}

bool McapReader::add_chunk_index(std::span<const std::byte> content) {
  MessageReader reader(content);
  reader.skip(16);
  const std::uint64_t start = reader.u64();
  reader.skip(8);
  MessageReader offsets(reader.byte_sequence());
  if (!reader.ok() || start > static_cast<std::uint64_t>(file_.size())) return false;
  while (offsets.ok() && offsets.left() > 0) {
    const auto topic = topic_of_channel_.find(offsets.u16());
    offsets.u64();
    if (topic == topic_of_channel_.end()) return false;
    auto& last = last_chunk_[topic->second];
    last = std::max(last, static_cast<std::int64_t>(start));
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
      if (!sound || record.op != wanted) continue;
      if (wanted == McapOp::schema) sound = add_schema(record.content);
      if (wanted == McapOp::channel) sound = add_channel(record.content);
      if (wanted == McapOp::statistics) sound = statistics = add_statistics(record.content);
      if (wanted == McapOp::chunk_index) sound = add_chunk_index(record.content);
    }
  }
  const auto start = static_cast<std::int64_t>(kMcapMagic.size());
  for (std::size_t i = 0; i < topics_.size(); ++i)  // not in a chunk that is indexed
    sound = sound && (topics_[i].messages == 0 || last_chunk_[i] != start);
  return sound && statistics;
}

/// False: the file has none, or a damaged one.
Expected<bool> McapReader::read_summary() {
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

Status McapReader::open() {
  const auto magic = file_.read(kMcapMagic.size(), room_);
  if (!magic) return magic.error();
  if (!*magic || std::memcmp(room_.data(), kMcapMagic.data(), kMcapMagic.size()) != 0)
    return Error{file_.path(), "is not an MCAP file", "check the path"};
  const auto summary = read_summary();
  if (!summary) return summary.error();
  if (!*summary) {
    log_warning(file_.path() +
                ": the file has no whole summary, it was not closed: all of it is read for its topics");
    forget();
    if (auto status = scan(); !status) return status;
  }
  selected_.assign(topics_.size(), true);
  return rewind();
}

Status McapReader::scan() {
  scanning_ = true;
  if (auto status = rewind(); !status) return status;
  BagMessage message;
  while (true) {
    const auto more = next(message);
    if (!more) return more.error();
    if (!*more) break;
    ++topics_[message.topic].messages;
    last_chunk_[message.topic] = record_byte_;
  }
  scanning_ = false;
  return {};
}

Status McapReader::load_chunk(std::span<const std::byte> content) {
  MessageReader reader(content);
  reader.skip(16);
  const std::uint64_t size = reader.u64();
  const std::uint32_t crc = reader.u32();
  const std::string_view name = reader.string();
  const std::uint64_t stored = reader.u64();
  const auto data = reader.bytes(stored);
  if (!reader.ok()) return damaged("a chunk is damaged");
  if (name.empty()) {
    chunk_ = data;
  } else if (name == "lz4" || name == "zstd") {
    const auto method = name == "lz4" ? Compression::lz4 : Compression::zstd;
    const auto got = decompress(method, data, kLargestChunk, damaged("").where, chunk_room_);
    if (!got) return got.error();
    chunk_ = std::span(chunk_room_).first(*got);
  } else {
    return damaged(text("a chunk with the unknown compression '", name.substr(0, 20), "'"));
  }
  if (chunk_.size() != size) return damaged("a chunk states a wrong size");
  if (crc != 0 && !crc32_agrees(crc, crc32(chunk_.data(), chunk_.size())))
    return damaged("a chunk's checksum does not fit its data");
  return {};
}

/// Does with a record what there is to do; `given` when it is a wanted message.
Status McapReader::take(const Record& record, BagMessage& message, bool& given) {
  given = false;
  if (record.op == McapOp::schema && scanning_ && !add_schema(record.content))
    return damaged("a schema record is damaged");
  if (record.op == McapOp::channel && scanning_ && !add_channel(record.content))
    return damaged("a channel record is damaged");
  if (record.op == McapOp::chunk) return load_chunk(record.content);
  if (record.op != McapOp::message) return {};
  MessageReader reader(record.content);
  const std::uint16_t channel = reader.u16();
  reader.skip(4);
  const std::uint64_t t = reader.u64();
  reader.skip(8);
  if (!reader.ok()) return damaged("a message record is damaged");
  const auto topic = topic_of_channel_.find(channel);
  if (topic == topic_of_channel_.end())
    return damaged(text("a message of channel ", channel, ", which the file does not describe"));
  given = scanning_ || selected_[topic->second];
  if (given)
    message = {topic->second, static_cast<TimeNs>(std::min<std::uint64_t>(t, INT64_MAX)), reader.rest()};
  return {};
}

bool McapReader::is_wanted(McapOp op) const {
  return op == McapOp::chunk || op == McapOp::message ||
         (scanning_ && (op == McapOp::schema || op == McapOp::channel));
}

/// The next record outside of chunks, its content only if it is wanted; false at the end of the data.
Expected<bool> McapReader::read_record(Record& record) {
  record = {};
  record_byte_ = file_.position();
  const auto head = file_.read(kRecordHead, head_room_);
  if (!head) return head.error();
  MessageReader reader{std::span(head_room_).first(*head ? kRecordHead : 0)};
  record.op = static_cast<McapOp>(reader.u8());
  const std::uint64_t size = reader.u64();
  if (!reader.ok() || size > file_.left()) {
    if (!warned_ && record_byte_ < file_.size())
      log_warning(text(file_.path(), ", byte ", record_byte_,
                       ": the file ends inside a record; what is whole before it is read"));
    warned_ = true;
    return false;
  }
  if (record.op == McapOp::data_end || record.op == McapOp::footer) return false;
  if (static_cast<std::uint8_t>(record.op) == 0) return damaged("no record begins here");
  if (!is_wanted(record.op)) {
    if (auto status = file_.seek(file_.position() + static_cast<std::int64_t>(size)); !status)
      return status.error();
    return true;
  }
  if (size > kLargestChunk) return damaged(text("a record of ", size, " bytes"));
  const auto got = file_.read(size, room_);
  if (!got) return got.error();
  record.content = std::span(room_).first(size);
  return true;
}

Expected<bool> McapReader::next(BagMessage& message) {
  Record record;
  bool given = false;
  while (!given) {
    if (chunk_.empty()) {
      if (ended_) return false;
      const auto more = read_record(record);
      if (!more) return more.error();
      ended_ = !*more;
      if (ended_) return false;
    } else if (!take_record(chunk_, record) || record.op == McapOp::chunk) {
      return damaged("a chunk holds something else than records");
    }
    if (record.content.empty()) continue;
    if (auto status = take(record, message, given); !status) return status.error();
  }
  return true;
}

}  // namespace

Expected<std::unique_ptr<BagReader>> open_mcap(const std::string& path) {
  auto file = BinaryFile::open(path);
  if (!file) return file.error();
  auto reader = std::make_unique<McapReader>(*std::move(file));
  if (auto status = reader->open(); !status) return status.error();
  return std::unique_ptr<BagReader>(std::move(reader));
}

}  // namespace evpose
