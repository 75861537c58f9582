// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "evpose/io/bags/bag_reader.h"
#include "evpose/io/files/binary_file.h"

namespace evpose {

/// What ROS 1 bags and MCAP files share: messages stand in records, most of them inside of compressed chunks,
/// and an index at the end names topics and chunks. A format says how its records are framed and what their
/// fields mean.
class ChunkedBagReader : public BagReader {
 public:
  explicit ChunkedBagReader(BinaryFile file) : file_(std::move(file)) {}

  /// Reads head and index; all of the file for its topics where the index is missing or damaged.
  Status open();
  Status select(const std::vector<std::size_t>& topics) override;
  Expected<bool> next(BagMessage& message) override;
  Status rewind() override { return go_to(first_record_); }
  Status go_to_last(std::size_t topic) override { return go_to(last_chunk_[topic]); }
  Status count_messages() override { return {}; }

 protected:
  enum class RecordKind : std::uint8_t {
    invalid,
    topic,  ///< describes one, or a part of one
    chunk,
    message,
    end,  ///< of the data
    other
  };
  struct Record {
    RecordKind kind = RecordKind::invalid;
    std::span<const std::byte> data;  ///< empty where nothing is done with it
  };
  struct Chunk {
    std::string_view compression;  ///< "none" or empty, lz4, zstd, bz2
    std::span<const std::byte> stored;
    std::uint64_t size = 0;  ///< when unpacked
    std::uint32_t crc = 0;   ///< when unpacked; 0: not known
  };
  struct Message {
    std::uint32_t channel = 0;
    TimeNs t = 0;
    std::span<const std::byte> data;
  };

  // The format's part. It may keep fields of the record that it read last: what is asked next is about that
  // record.

  /// From the beginning of the file; returns the byte at which the first record begins.
  virtual Expected<std::int64_t> read_file_head() = 0;
  /// Adds the topics, with their messages and last chunks. False: the file has no index, or a damaged one.
  virtual Expected<bool> read_index() = 0;
  /// What stands before a record's data, from the file's place on. False: the file ends before that.
  virtual Expected<bool> read_record_head(RecordKind& kind, std::uint64_t& data_size) = 0;
  /// Takes a record from the front of a chunk; false if it is not whole.
  virtual bool take_record(std::span<const std::byte>& chunk, Record& record) = 0;
  /// Calls add_topic(). False, here and below: the record is damaged.
  virtual bool add_topic_record(std::span<const std::byte> data) = 0;
  virtual bool parse_chunk(std::span<const std::byte> data, Chunk& chunk) const = 0;
  virtual bool parse_message(std::span<const std::byte> data, Message& message) const = 0;

  /// Channels of equal topics count as one.
  void add_topic(std::uint32_t channel, const BagTopic& topic);
  /// The topic of a channel, or nullptr.
  const std::size_t* topic_of(std::uint32_t channel) const;
  void add_messages(std::size_t topic, std::int64_t count) { topics_[topic].messages += count; }
  void add_chunk(std::size_t topic, std::int64_t chunk);
  Error damaged(const std::string& what) const;

  BinaryFile file_;
  std::int64_t first_record_ = 0;
  std::vector<std::int64_t>
      last_chunk_;               ///< of each topic: where its last message is; the first record: nowhere
  std::vector<std::byte> room_;  ///< of data read last

 private:
  Status go_to(std::int64_t position);
  Status scan();
  bool is_wanted(RecordKind kind) const;
  Expected<bool> read_record(Record& record);
  Expected<bool> next_record(Record& record);
  Expected<bool> deliver(std::span<const std::byte> data, BagMessage& message);
  Status load_chunk(std::span<const std::byte> data);
  void warn_of_cut();

  std::unordered_map<std::uint32_t, std::size_t> topic_of_channel_;
  std::vector<bool> selected_;
  bool scanning_ = false, warned_ = false, ended_ = false;
  std::vector<std::byte> chunk_room_;
  std::span<const std::byte> chunk_;  ///< what is left of the open chunk
  std::int64_t record_byte_ = 0;      ///< where the record read last, or the open chunk, begins
};

/// Opens a file as the format of `Reader`.
template <class Reader>
Expected<std::unique_ptr<BagReader>> open_chunked_bag(const std::string& path) {
  auto file = BinaryFile::open(path);
  if (!file) return file.error();
  auto reader = std::make_unique<Reader>(*std::move(file));
  if (auto status = reader->open(); !status) return status.error();
  return std::unique_ptr<BagReader>(std::move(reader));
}

}  // namespace evpose
