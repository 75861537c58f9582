// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/bags/chunked_bag_reader.h"

#include <algorithm>

#include "evpose/core/log.h"
#include "evpose/io/files/compression.h"
#include "evpose/io/files/crc32.h"

namespace evpose {

Error ChunkedBagReader::damaged(const std::string& what) const {
  return Error{text(file_.path(), ", byte ", record_byte_), what, "copy the file again from its source"};
}

Status ChunkedBagReader::go_to(std::int64_t position) {
  chunk_ = {};
  ended_ = false;
  return file_.seek(position);
}

void ChunkedBagReader::add_topic(std::uint32_t channel, const BagTopic& topic) {
  const auto same = [&](const BagTopic& t) {
    return t.name == topic.name && t.type == topic.type && t.wire == topic.wire && t.md5 == topic.md5;
  };
  const auto it = std::find_if(topics_.begin(), topics_.end(), same);
  topic_of_channel_[channel] = static_cast<std::size_t>(it - topics_.begin());
  if (it != topics_.end()) return;
  topics_.push_back(topic);
  topics_.back().messages = 0;
  last_chunk_.push_back(first_record_);
}

const std::size_t* ChunkedBagReader::topic_of(std::uint32_t channel) const {
  const auto found = topic_of_channel_.find(channel);
  return found == topic_of_channel_.end() ? nullptr : &found->second;
}

void ChunkedBagReader::add_chunk(std::size_t topic, std::int64_t chunk) {
  last_chunk_[topic] = std::max(last_chunk_[topic], chunk);
}

Status ChunkedBagReader::open() {
  const auto first = read_file_head();
  if (!first) return first.error();
  first_record_ = *first;
  const auto indexed = read_index();
  if (!indexed) return indexed.error();
  if (!*indexed) {
    log_warning(file_.path() +
                ": the file has no whole index, it was not closed: all of it is read for its topics");
    topics_.clear(), last_chunk_.clear(), topic_of_channel_.clear();
    if (auto status = scan(); !status) return status;
  }
  selected_.assign(topics_.size(), true);
  return rewind();
}

Status ChunkedBagReader::select(const std::vector<std::size_t>& topics) {
  selected_.assign(topics_.size(), false);
  for (const std::size_t topic : topics) selected_[topic] = true;
  return {};
}

Status ChunkedBagReader::scan() {
  scanning_ = true;
  if (auto status = rewind(); !status) return status;
  BagMessage message;
  while (true) {
    const auto more = next(message);
    if (!more) return more.error();
    if (!*more) break;
    add_messages(message.topic, 1);
    add_chunk(message.topic, record_byte_);
  }
  scanning_ = false;
  return {};
}

bool ChunkedBagReader::is_wanted(RecordKind kind) const {
  return kind == RecordKind::chunk || kind == RecordKind::message || (scanning_ && kind == RecordKind::topic);
}

void ChunkedBagReader::warn_of_cut() {
  if (warned_ || record_byte_ >= file_.size()) return;
  warned_ = true;
  log_warning(text(file_.path(), ", byte ", record_byte_,
                   ": the file ends inside a record; what is whole before it is read"));
}

/// The next record outside of chunks, its data only if it is wanted; false at the end of the data.
Expected<bool> ChunkedBagReader::read_record(Record& record) {
  record_byte_ = file_.position();
  std::uint64_t size = 0;
  const auto whole = read_record_head(record.kind, size);
  if (!whole) return whole.error();
  if (!*whole || size > file_.left()) {
    warn_of_cut();
    return false;
  }
  if (record.kind == RecordKind::end) return false;
  if (record.kind == RecordKind::invalid) return damaged("no record begins here");
  if (!is_wanted(record.kind)) {
    if (auto status = file_.seek(file_.position() + static_cast<std::int64_t>(size)); !status)
      return status.error();
    return true;
  }
  if (size > kLargestChunk) return damaged(text("a record of ", size, " bytes"));
  const auto got = file_.read(size, room_);
  if (!got) return got.error();
  record.data = std::span(room_).first(size);
  return true;
}

/// From the open chunk, or from the file; false at the end of the data.
Expected<bool> ChunkedBagReader::next_record(Record& record) {
  if (chunk_.empty()) {
    if (ended_) return false;
    auto more = read_record(record);
    if (more) ended_ = !*more;
    return more;
  }
  if (!take_record(chunk_, record) || record.kind == RecordKind::invalid || record.kind == RecordKind::chunk)
    return damaged("a chunk holds something else than records");
  return true;
}

Status ChunkedBagReader::load_chunk(std::span<const std::byte> data) {
  Chunk chunk;
  if (!parse_chunk(data, chunk)) return damaged("a chunk is damaged");
  const std::string_view name = chunk.compression;
  if (name.empty() || name == "none") {
    chunk_ = chunk.stored;
  } else if (name == "lz4" || name == "zstd" || name == "bz2") {
    const auto method = name == "lz4"    ? Compression::lz4
                        : name == "zstd" ? Compression::zstd
                                         : Compression::bz2;
    const auto got = decompress(method, chunk.stored, kLargestChunk, damaged("").where, chunk_room_);
    if (!got) return got.error();
    chunk_ = std::span(chunk_room_).first(*got);
  } else {
    return damaged(text("a chunk with the unknown compression '", name.substr(0, 20), "'"));
  }
  if (chunk_.size() != chunk.size) return damaged("a chunk states a wrong size");
  if (chunk.crc != 0 && !crc32_agrees(chunk.crc, crc32(chunk_.data(), chunk_.size())))
    return damaged("a chunk's checksum does not fit its data");
  return {};
}

/// True if the message is one that is wanted.
Expected<bool> ChunkedBagReader::deliver(std::span<const std::byte> data, BagMessage& message) {
  Message found;
  if (!parse_message(data, found)) return damaged("a message record is damaged");
  const std::size_t* topic = topic_of(found.channel);
  if (topic == nullptr)
    return damaged(text("a message of channel ", found.channel, ", which the file does not describe"));
  if (!scanning_ && !selected_[*topic]) return false;
  message = {*topic, found.t, found.data};
  return true;
}

Expected<bool> ChunkedBagReader::next(BagMessage& message) {
  while (true) {
    Record record;
    const auto more = next_record(record);
    if (!more || !*more) return more;
    if (record.kind == RecordKind::topic && scanning_ && !add_topic_record(record.data))
      return damaged("a record that describes a topic is damaged");
    if (record.kind == RecordKind::chunk)
      if (auto status = load_chunk(record.data); !status) return status.error();
    if (record.kind != RecordKind::message) continue;
    const auto given = deliver(record.data, message);
    if (!given || *given) return given;
  }
}

}  // namespace evpose
