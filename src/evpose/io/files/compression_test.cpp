// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/files/compression.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>

#include "evpose/io/files/crc32.h"
#include "evpose/io/files/test_files.h"

namespace evpose {
namespace {

std::string unpacked(const std::string& packed, std::size_t size) {
  std::vector<std::byte> out(size);
  if (!decompress_lzf(std::as_bytes(std::span(packed)), out)) return "(damaged)";
  return {reinterpret_cast<const char*>(out.data()), out.size()};
}

TEST(Lzf, RunsAndCopies) {
  EXPECT_EQ(unpacked("\x02"
                     "abc",
                     3),
            "abc");
  // A copy that overlaps itself: one byte back, five long.
  EXPECT_EQ(unpacked(std::string("\0a\x60\0", 4), 6), "aaaaaa");
  // The long form: 7 in the head, then 20 more.
  EXPECT_EQ(unpacked(std::string("\0a\xE0\x14\0", 5), 30), std::string(30, 'a'));
  for (const char* bad : {"\x05"
                          "abc",
                          "\x20", "\x20\x05", "\xE0"})
    EXPECT_EQ(unpacked(bad, 3), "(damaged)");
  EXPECT_EQ(unpacked("\x02"
                     "abc",
                     2),
            "(damaged)");
  EXPECT_EQ(unpacked("\x02"
                     "abc",
                     4),
            "(damaged)");
  EXPECT_EQ(unpacked("", 0), "");
  EXPECT_EQ(unpacked("", 1), "(damaged)");
}

TEST(Compression, BlocksComeBackAndDamageIsTold) {
  std::string content;
  for (int i = 0; i < 100'000; ++i) content += static_cast<char>('a' + i * i % 23);
  const auto plain = std::as_bytes(std::span(content));
  std::vector<std::byte> room;
  for (const auto method : {Compression::none, Compression::lz4, Compression::zstd}) {
    const auto packed = compress(method, plain);
    const auto size = decompress(method, packed, content.size(), "here", room);
    ASSERT_TRUE(size.ok()) << error_line(size);
    ASSERT_EQ(*size, content.size());
    EXPECT_TRUE(std::equal(plain.begin(), plain.end(), room.begin()));
    EXPECT_TRUE(says(error_line(decompress(method, packed, content.size() - 1, "here", room)), {"here"}));
    if (method == Compression::none) continue;
    for (std::size_t n = 0; n < packed.size(); n += packed.size() / 40 + 1)
      EXPECT_FALSE(decompress(method, std::span(packed).first(n), content.size(), "here", room).ok()) << n;
  }
}

TEST(Crc32, IsTheDefinitionBitByBit) {
  std::string data = "123456789";
  EXPECT_EQ(crc32(data.data(), data.size()), 0xCBF43926u);
  for (int i = 0; i < 100; ++i) data += static_cast<char>(i * 37);
  for (std::size_t begin = 0; begin < 9; ++begin) {
    for (std::size_t size = 0; size < 40; ++size) {
      std::uint32_t slow = 0xFFFFFFFF;
      for (std::size_t i = 0; i < size; ++i) {
        slow ^= static_cast<unsigned char>(data[begin + i]);
        for (int bit = 0; bit < 8; ++bit) slow = slow >> 1 ^ ((slow & 1) != 0 ? 0xEDB88320 : 0);
      }
      EXPECT_EQ(crc32(data.data() + begin, size), ~slow);
      EXPECT_EQ(crc32(data.data() + begin + size / 3, size - size / 3, crc32(data.data() + begin, size / 3)),
                ~slow);
    }
  }
}

}  // namespace
}  // namespace evpose
