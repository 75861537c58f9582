// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/recording/depth_images.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "evpose/io/files/png_file.h"
#include "evpose/io/files/test_files.h"

namespace evpose {
namespace {

class DepthFolder : public ::testing::Test {
 protected:
  DepthFolder() {
    std::filesystem::create_directory(folder_ / "depth");
    EXPECT_TRUE(write_png_grey16(folder_ / "depth/a.png", 2, 1, {7, 65535}).ok());
    EXPECT_TRUE(write_png_grey16(folder_ / "b.png", 2, 1, {0, 256}).ok());
  }
  Expected<std::vector<DepthImageFile>> list(const std::string& rows) const {
    folder_.file("depth.txt", "# timestamp filename\n" + rows);
    return list_depth_images(folder_.path());
  }

  TemporaryFolder folder_;
};

TEST_F(DepthFolder, IsListedInSecondsToTheNanosecond) {
  const auto images = list("1305031102.160407 depth/a.png\n1305031102.194330123 b.png\n");
  ASSERT_TRUE(images.ok()) << images.error().line();
  ASSERT_EQ(images->size(), 2U);
  EXPECT_EQ((*images)[0].t, 1305031102160407000);
  EXPECT_EQ((*images)[1].t, 1305031102194330123);
  const auto image = read_png_grey16((*images)[0].path);
  ASSERT_TRUE(image.ok()) << image.error().line();
  EXPECT_EQ(image->width, 2);
  EXPECT_EQ(image->height, 1);
  EXPECT_EQ(image->pixels, (std::vector<std::uint16_t>{7, 65535}));
}

TEST_F(DepthFolder, OfOurRecordingsIsListedByTimestampsCsv) {
  folder_.file("timestamps.csv", "#timestamp_ns,filename\n5000,b.png\n");
  const auto images = list_depth_images(folder_.path());
  ASSERT_TRUE(images.ok()) << images.error().line();
  ASSERT_EQ(images->size(), 1U);
  EXPECT_EQ((*images)[0].t, 5000);
}

TEST_F(DepthFolder, ThatIsSpoiltNamesItsLine) {
  EXPECT_TRUE(says(error_line(list_depth_images(folder_.path())), {"no depth.txt", "timestamp filename"}));
  EXPECT_TRUE(says(error_line(list_depth_images(folder_ / "none")), {"none: is no folder"}));
  EXPECT_TRUE(says(error_line(list("")), {"depth.txt: lists no depth images"}));
  EXPECT_TRUE(says(error_line(list("1 b.png\n2 c.png\n")), {"depth.txt:3: ", "'c.png' is not there"}));
  EXPECT_TRUE(says(error_line(list("2 b.png\n1 depth/a.png\n")), {"depth.txt:3: ", "after the one before"}));
  EXPECT_TRUE(says(error_line(list("x b.png\n")), {"depth.txt:2: ", "is no row"}));
  EXPECT_TRUE(says(error_line(list("1 ../b.png\n")), {"depth.txt:2: ", "inside the folder"}));
}

TEST_F(DepthFolder, HoldsNumbersOf16BitsAndNoOther) {
  EXPECT_TRUE(write_png_grey8(folder_ / "eight.png", 2, 1, {0, 255}).ok());
  EXPECT_TRUE(says(error_line(read_png_grey16(folder_ / "eight.png")), {"eight.png: ", "16 bits"}));
  folder_.file("no.png", "no picture at all, but longer than a header of one");
  EXPECT_TRUE(says(error_line(read_png_grey16(folder_ / "no.png")), {"no.png: ", "no PNG"}));
}

}  // namespace
}  // namespace evpose
