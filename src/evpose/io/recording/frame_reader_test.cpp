// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/recording/frame_reader.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "evpose/io/files/png_file.h"
#include "evpose/io/files/test_files.h"

namespace evpose {
namespace {

class FrameFiles : public ::testing::Test {
 protected:
  FrameFiles() {
    std::filesystem::create_directory(folder_ / "data");
    for (const auto& [name, level] : {std::pair("a.png", 10), std::pair("data/b.png", 20)}) {
      const std::vector<std::uint8_t> pixels(4 * 3, static_cast<std::uint8_t>(level));
      EXPECT_TRUE(write_png_grey8(folder_ / name, 4, 3, pixels).ok());
    }
    options_.size = {4, 3};
  }
  Expected<FrameReader> open(const std::string& rows) const {
    return FrameReader::open(folder_.file("list.csv", "#timestamp [ns],filename\n" + rows), options_);
  }

  TemporaryFolder folder_;
  FrameReadOptions options_;
};

TEST_F(FrameFiles, StandBesideTheListOrInItsDataFolder) {
  auto reader = open("1000,a.png\n2000,b.png,600\n");
  ASSERT_TRUE(reader.ok()) << reader.error().line();
  Frame frame;
  ASSERT_TRUE(*reader->next(frame));
  EXPECT_EQ(frame.t, 1000);
  EXPECT_EQ(frame.exposure, 0);
  EXPECT_EQ(frame.grey, std::vector<std::uint8_t>(12, 10));
  ASSERT_TRUE(*reader->next(frame));
  EXPECT_EQ(frame.exposure, 600);
  EXPECT_EQ(frame.grey.front(), 20);
  EXPECT_FALSE(*reader->next(frame));
}

TEST_F(FrameFiles, TimeIsTheMiddleOfTheExposureAfterTheOffset) {
  options_.offset_ns = 50;
  options_.exposure = 200;
  using Stamp = FrameReadOptions::Stamp;
  for (const auto& [stamp, middle] :
       {std::pair(Stamp::start, 1150), std::pair(Stamp::middle, 1050), std::pair(Stamp::end, 950)}) {
    options_.stamp = stamp;
    EXPECT_EQ(open("1000,a.png\n")->rows().front().t, middle);
  }
}

TEST_F(FrameFiles, CropLeavesOutWhatIsOutside) {
  options_.t_start_ns = 1500;
  EXPECT_EQ(open("1000,a.png\n2000,b.png\n")->rows().size(), 1U);
}

TEST_F(FrameFiles, BadListsAreNamedByLine) {
  for (const auto& [rows, words] :
       {std::pair("", "lists no frames"), std::pair("x,a.png\n", "list.csv:2: 'x,a.png' is no row"),
        std::pair("1000\n", "is no row"), std::pair("1000,c.png\n", "list.csv:2: the picture 'c.png'"),
        std::pair("1000,../a.png\n", "does not stay inside"), std::pair("1000,a.png,-3\n", "out of range"),
        std::pair("1000,a.png,z\n", "no exposure"),
        std::pair("1000,a.png\n1000,b.png\n", "list.csv:3: the frame does not come after")})
    EXPECT_NE(error_line(open(rows)).find(words), std::string::npos) << rows << error_line(open(rows));
}

TEST_F(FrameFiles, PicturesOfAnotherSizeAreRefused) {
  options_.size = {8, 3};
  auto reader = open("1000,a.png\n");
  Frame frame;
  EXPECT_NE(error_line(reader->next(frame)).find("is 4 x 3 pixels"), std::string::npos);
}

}  // namespace
}  // namespace evpose
