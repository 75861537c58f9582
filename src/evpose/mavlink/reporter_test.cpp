// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/mavlink/reporter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "evpose/mavlink/messages.h"

namespace evpose::mavlink {
namespace {

TEST(MavlinkReporter, LongWordsComeInChunksThatJoinToTheWhole) {
  for (const std::size_t length : {1U, 41U, 42U, 43U, 92U, 200U}) {
    std::vector<Statustext> sent;
    Parser parser;
    Reporter reporter({}, {}, [&](Bytes bytes) {
      parser.parse(bytes, [&](const Frame& frame) { sent.push_back(decode<Statustext>(frame).value()); });
    });
    std::string words;
    for (std::size_t i = 0; words.size() < length; ++i) words += static_cast<char>('a' + i % 26);
    reporter.stalled(words);
    reporter.stalled(words);
    const std::string whole = "evpose: " + words;
    const std::size_t chunks = sent.size() / 2;
    EXPECT_EQ(chunks, whole.size() <= 50 ? 1 : whole.size() / 50 + 1);
    EXPECT_EQ(sent.front().id != 0, whole.size() > 50);
    if (chunks > 1) {
      EXPECT_NE(sent.front().id, sent.back().id) << "each text has a number of its own";
    }
    std::string joined;
    for (std::size_t k = 0; k < chunks; ++k) {
      EXPECT_EQ(sent[k].chunk_seq, k);
      EXPECT_EQ(sent[k].id, sent.front().id);
      const std::string part(sent[k].text.begin(), std::find(sent[k].text.begin(), sent[k].text.end(), '\0'));
      EXPECT_TRUE(chunks == 1 || (part.size() == 50) == (k + 1 < chunks)) << "only the last ends with zero";
      joined += part;
    }
    EXPECT_EQ(joined, whole);
  }
}

}  // namespace
}  // namespace evpose::mavlink
