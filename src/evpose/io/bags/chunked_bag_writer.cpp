// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/bags/chunked_bag_writer.h"

#include <algorithm>

namespace evpose {

std::size_t ChunkedBagWriter::add_topic(const std::string& name, const std::string& type) {
  topics_.push_back({name, type});
  return topics_.size() - 1;
}

void ChunkedBagWriter::put(std::string_view bytes) {
  file_.write(bytes);
  position_ += bytes.size();
}

void ChunkedBagWriter::write(std::size_t topic, TimeNs t, std::span<const std::byte> message) {
  Topic& known = topics_[topic];
  if (!known.described) append_topic(chunk_, topic);
  known.described = true;
  index_[topic].push_back({t, chunk_.size()});
  append_message(chunk_, topic, t, message);
  ++known.messages;
  if (chunk_.size() >= chunk_bytes_) flush();
}

void ChunkedBagWriter::flush() {
  if (chunk_.size() == 0) return;
  Chunk chunk;
  chunk.first = INT64_MAX, chunk.last = INT64_MIN;
  for (auto& [topic, entries] : index_) {
    std::stable_sort(entries.begin(), entries.end(),
                     [](const IndexEntry& a, const IndexEntry& b) { return a.t < b.t; });
    chunk.first = std::min(chunk.first, entries.front().t);
    chunk.last = std::max(chunk.last, entries.back().t);
    chunk.counts[topic] = static_cast<std::uint32_t>(entries.size());
  }
  const auto stored = compress(compression_, chunk_.data());
  chunk.start = position_;
  chunk.size = chunk_.size();
  chunk.stored = stored.size();
  put_chunk(chunk, chunk_.data(), stored);
  chunk.length = position_ - chunk.start;
  for (const auto& [topic, entries] : index_) {
    chunk.index_offsets[topic] = position_;
    put_index(topic, entries);
  }
  chunk.index_length = position_ - chunk.start - chunk.length;
  chunks_.push_back(std::move(chunk));
  chunk_.clear();
  index_.clear();
}

}  // namespace evpose
