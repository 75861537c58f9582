// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <memory>
#include <string>

#include "evpose/io/bags/bag_reader.h"

namespace evpose {

/// First and last bytes of an MCAP file.
inline constexpr std::array<unsigned char, 8> kMcapMagic = {0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};

/// Kinds of records in an MCAP file; others are skipped.
enum class McapOp : std::uint8_t {
  header = 0x01,
  footer = 0x02,
  schema = 0x03,
  channel = 0x04,
  message = 0x05,
  chunk = 0x06,
  message_index = 0x07,
  chunk_index = 0x08,
  statistics = 0x0B,
  summary_offset = 0x0E,
  data_end = 0x0F
};

/// Checksums of chunks and summary are checked. A file whose summary is missing or damaged is read through
/// once for its topics.
Expected<std::unique_ptr<BagReader>> open_mcap(const std::string& path);

}  // namespace evpose
