// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "evpose/io/bags/bag_container_writer.h"
#include "evpose/io/bags/message_writer.h"
#include "evpose/io/files/atomic_file.h"

namespace evpose {

/// What writers of ROS 1 bags and MCAP files share: messages are gathered in chunks, each of which is
/// compressed and followed by its index. A format says how the records of both look.
class ChunkedBagWriter : public BagContainerWriter {
 public:
  /// Chunks end once they have `chunk_bytes`.
  ChunkedBagWriter(AtomicFile file, Compression compression, std::size_t chunk_bytes)
      : file_(std::move(file)), compression_(compression), chunk_bytes_(chunk_bytes) {}

  std::size_t add_topic(const std::string& name, const std::string& type) override;
  void write(std::size_t topic, TimeNs t, std::span<const std::byte> message) override;

 protected:
  struct Topic {
    std::string name, type;
    bool described = false;
    std::uint32_t messages = 0;
  };
  struct IndexEntry {
    TimeNs t = 0;
    std::uint64_t offset = 0;  ///< in the unpacked chunk
  };
  struct Chunk {
    TimeNs first = 0, last = 0;
    std::uint64_t start = 0, length = 0;                 ///< of its record in the file
    std::uint64_t index_length = 0;                      ///< of its index, which follows
    std::uint64_t stored = 0, size = 0;                  ///< packed and unpacked
    std::map<std::size_t, std::uint64_t> index_offsets;  ///< by topic
    std::map<std::size_t, std::uint32_t> counts;         ///< of messages, by topic
  };

  // The format's part.
  virtual void append_topic(MessageWriter& chunk, std::size_t topic) const = 0;
  virtual void append_message(MessageWriter& chunk, std::size_t topic, TimeNs t,
                              std::span<const std::byte> message) const = 0;
  virtual void put_chunk(const Chunk& chunk, std::span<const std::byte> unpacked,
                         std::span<const std::byte> stored) = 0;
  /// `entries` in order of time.
  virtual void put_index(std::size_t topic, const std::vector<IndexEntry>& entries) = 0;

  /// Adds to the file.
  virtual void put(std::string_view bytes);
  /// Ends the open chunk.
  void flush();

  AtomicFile file_;
  Compression compression_;
  std::vector<Topic> topics_;
  std::uint64_t position_ = 0;  ///< bytes put so far
  std::vector<Chunk> chunks_;

 private:
  std::size_t chunk_bytes_;
  MessageWriter chunk_;
  std::map<std::size_t, std::vector<IndexEntry>> index_;  ///< of the open chunk, by topic
};

}  // namespace evpose
