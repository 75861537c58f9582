// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/files/png_file.h"

#include <gtest/gtest.h>
#include <png.h>

#include <algorithm>
#include <cstring>
#include <numeric>
#include <random>

#include "evpose/io/files/test_files.h"

namespace evpose {
namespace {

/// Values of each channel: eight colours, which have a palette, or a thousand, which have none.
class PngColours : public testing::TestWithParam<int> {};

TEST_P(PngColours, DecodeToTheSameImage) {
  RgbImage image(40, 30);
  std::mt19937 random(1);
  for (std::uint8_t& byte : image.rgb)
    byte = static_cast<std::uint8_t>(random() % static_cast<unsigned>(GetParam()));
  const std::string bytes = encode_png(image);
  constexpr std::size_t kColourType = 25;  // of the header
  EXPECT_EQ(bytes[kColourType], GetParam() == 2 ? PNG_COLOR_TYPE_PALETTE : PNG_COLOR_TYPE_RGB);
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  ASSERT_NE(png_image_begin_read_from_memory(&png, bytes.data(), bytes.size()), 0);
  png.format = PNG_FORMAT_RGB;
  ASSERT_EQ(png.width, 40u);
  ASSERT_EQ(png.height, 30u);
  std::vector<std::uint8_t> decoded(PNG_IMAGE_SIZE(png));
  ASSERT_NE(png_image_finish_read(&png, nullptr, decoded.data(), 0, nullptr), 0);
  EXPECT_EQ(decoded, image.rgb);
}
INSTANTIATE_TEST_SUITE_P(FewAndMany, PngColours, testing::Values(2, 256));

/// The samples of a grey file, as libpng gives them back.
template <class T>
std::vector<T> read_grey(const std::string& path, int width, int height) {
  const std::string bytes = content_of(path);
  std::vector<T> out;
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  std::string_view rest = bytes;
  png_set_read_fn(png, &rest, [](png_structp reader, png_bytep to, png_size_t count) {
    auto& left = *static_cast<std::string_view*>(png_get_io_ptr(reader));
    if (count > left.size()) png_error(reader, "the file ends too early");
    std::memcpy(to, left.data(), count);
    left.remove_prefix(count);
  });
  png_read_info(png, info);
  EXPECT_EQ(png_get_image_width(png, info), static_cast<png_uint_32>(width));
  EXPECT_EQ(png_get_image_height(png, info), static_cast<png_uint_32>(height));
  EXPECT_EQ(png_get_bit_depth(png, info), 8 * sizeof(T));
  EXPECT_EQ(png_get_color_type(png, info), PNG_COLOR_TYPE_GRAY);
  if (sizeof(T) == 2) png_set_swap(png);
  std::vector<T> row(png_get_rowbytes(png, info) / sizeof(T));
  for (int y = 0; y < height; ++y) {
    png_read_row(png, reinterpret_cast<png_bytep>(row.data()), nullptr);
    out.insert(out.end(), row.begin(), row.end());
  }
  png_destroy_read_struct(&png, &info, nullptr);
  return out;
}

TEST(Png, GreyOfEitherDepthDecodesToTheSameSamples) {
  const TemporaryFolder folder;
  std::vector<std::uint8_t> bytes(7 * 4);
  std::iota(bytes.begin(), bytes.end(), std::uint8_t{200});
  ASSERT_TRUE(write_png_grey8(folder / "8.png", 7, 4, bytes).ok());
  EXPECT_EQ(read_grey<std::uint8_t>(folder / "8.png", 7, 4), bytes);
  std::vector<std::uint16_t> words(bytes.size());
  std::iota(words.begin(), words.end(), std::uint16_t{0xA0F0});
  ASSERT_TRUE(write_png_grey16(folder / "16.png", 7, 4, words).ok());
  EXPECT_EQ(read_grey<std::uint16_t>(folder / "16.png", 7, 4), words);
}

TEST(Png, ReadingGreyUndoesWriting) {
  const TemporaryFolder folder;
  std::vector<std::uint8_t> bytes(7 * 4);
  std::iota(bytes.begin(), bytes.end(), std::uint8_t{200});
  ASSERT_TRUE(write_png_grey8(folder / "8.png", 7, 4, bytes).ok());
  const auto read = read_png_grey8(folder / "8.png");
  ASSERT_TRUE(read.ok()) << read.error().line();
  EXPECT_EQ(read->width, 7);
  EXPECT_EQ(read->height, 4);
  EXPECT_EQ(read->pixels, bytes);
  std::vector<std::uint16_t> words;
  for (const std::uint8_t b : bytes) words.push_back(static_cast<std::uint16_t>(257 * b));
  ASSERT_TRUE(write_png_grey16(folder / "16.png", 7, 4, words).ok());
  EXPECT_EQ(read_png_grey8(folder / "16.png")->pixels, bytes);
}

/// Eight colours, which have a palette, or a thousand, which have none; grey ones keep their level.
TEST_P(PngColours, AreReadByTheirLuma) {
  const TemporaryFolder folder;
  RgbImage image(40, 30);
  std::mt19937 random(1);
  for (std::size_t i = 0; i < image.rgb.size(); i += 3)
    for (std::size_t k = 0; k < 3; ++k)
      image.rgb[i + k] =
          k == 0 ? static_cast<std::uint8_t>(random() % static_cast<unsigned>(GetParam())) : image.rgb[i];
  folder.file("it.png", encode_png(image));
  const auto read = read_png_grey8(folder / "it.png");
  ASSERT_TRUE(read.ok()) << read.error().line();
  for (std::size_t i = 0; i < read->pixels.size(); ++i) ASSERT_EQ(read->pixels[i], image.rgb[3 * i]) << i;
}

TEST(Png, DamagedOnesAreRefused) {
  const TemporaryFolder folder;
  const std::string good = encode_png(RgbImage(40, 30, 7));
  for (std::size_t size = 0; size < good.size() - 12; size += 5) {  // the last twelve bytes are its end
    folder.file("cut.png", good.substr(0, size));
    EXPECT_FALSE(read_png_grey8(folder / "cut.png").ok()) << size;
  }
  std::string vast = good;
  vast[17] = 0x7F;  // of its width
  folder.file("vast.png", vast);
  const auto refused = read_png_grey8(folder / "vast.png");
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().line().find("vast.png"), std::string::npos);
}

}  // namespace
}  // namespace evpose
