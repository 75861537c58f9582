// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/files/png_file.h"

#include <png.h>

#include <bit>
#include <csetjmp>
#include <cstring>
#include <unordered_map>

#include "evpose/io/files/atomic_file.h"
#include "evpose/io/files/input_file.h"

namespace evpose {
namespace {

void append(png_structp png, png_bytep data, png_size_t size) {
  static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<const char*>(data), size);
}

struct Pixels {
  int width = 0, height = 0;
  int color_type = PNG_COLOR_TYPE_GRAY;
  int channels = 1, bits = 8;           ///< samples of 16 bits are in the order of this machine
  const std::uint8_t* bytes = nullptr;  ///< row by row
  std::vector<png_color> palette{};
};

/// Empty when memory is short.
std::string encode(const Pixels& pixels) {
  EVPOSE_CHECK(pixels.width > 0 && pixels.height > 0);
  constexpr int kCompressionLevel = 3;  // higher ones take twice the time for a few per cent
  std::string bytes;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  if (info == nullptr || setjmp(png_jmpbuf(png)) != 0) {
    png_destroy_write_struct(&png, &info);
    return {};
  }
  png_set_write_fn(png, &bytes, append, nullptr);
  png_set_IHDR(png, info, static_cast<png_uint_32>(pixels.width), static_cast<png_uint_32>(pixels.height),
               pixels.bits, pixels.color_type, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  if (!pixels.palette.empty()) {
    png_set_PLTE(png, info, pixels.palette.data(), static_cast<int>(pixels.palette.size()));
    png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_NONE);  // numbers have no slope
  }
  png_set_compression_level(png, kCompressionLevel);
  png_write_info(png, info);
  if (pixels.bits == 16) png_set_swap(png);
  const std::size_t row_bytes = static_cast<std::size_t>(pixels.width) * pixels.channels * (pixels.bits / 8);
  for (int y = 0; y < pixels.height; ++y) png_write_row(png, pixels.bytes + y * row_bytes);
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  return bytes;
}

/// The image's colours in the order of their first pixels and a number for each pixel; no palette if there
/// are more than 256.
struct PaletteImage {
  std::vector<png_color> palette;
  std::vector<std::uint8_t> numbers;
};

PaletteImage with_palette(const RgbImage& image) {
  PaletteImage out;
  std::unordered_map<std::uint32_t, std::uint8_t> known;
  out.numbers.reserve(image.rgb.size() / 3);
  for (std::size_t i = 0; i < image.rgb.size(); i += 3) {
    const std::uint8_t* c = &image.rgb[i];
    const std::uint32_t colour = (std::uint32_t{c[0]} << 16) | (std::uint32_t{c[1]} << 8) | c[2];
    const auto [found, is_new] = known.try_emplace(colour, static_cast<std::uint8_t>(out.palette.size()));
    if (is_new && out.palette.size() == 256) return {};
    if (is_new) out.palette.push_back({c[0], c[1], c[2]});
    out.numbers.push_back(found->second);
  }
  return out;
}

Status write_grey(const std::string& path, const Pixels& pixels) {
  const std::string bytes = encode(pixels);
  if (bytes.empty()) return Error{path, "the picture cannot be encoded", "free some memory"};
  return write_text_file(path, bytes);
}

/// What is left to be read of a file that is in memory.
struct Bytes {
  const char* at;
  std::size_t left;
};

void take(png_structp png, png_bytep to, png_size_t count) {
  auto& bytes = *static_cast<Bytes*>(png_get_io_ptr(png));
  if (count > bytes.left) png_error(png, "the file ends too early");
  std::memcpy(to, bytes.at, count);
  bytes.at += count, bytes.left -= count;
}

void say_nothing(png_structp, png_const_charp) {}

[[noreturn]] void give_up(png_structp png, png_const_charp) { png_longjmp(png, 1); }

void make_grey8(png_structp png, png_infop info) {
  png_set_expand(png);
  png_set_scale_16(png);
  png_set_strip_alpha(png);
  if ((png_get_color_type(png, info) & PNG_COLOR_MASK_COLOR) != 0)
    png_set_rgb_to_gray(png, PNG_ERROR_ACTION_NONE, -1, -1);
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
}

constexpr png_uint_32 kMostAlongSide = 16'384;

/// A grey picture to be read, of one byte a pixel or of two.
struct GreyTarget {
  int bytes_per_pixel = 1;
  int width = 0, height = 0;
  std::vector<std::uint8_t> bytes{};  ///< row by row; two of a pixel in the order of this machine
  std::vector<png_bytep> rows{};
  bool other_kind = false;  ///< not of one channel of 16 bits, where two bytes a pixel are wanted
};

/// False for what is no sound PNG, or one of another kind. `target` is the caller's, since a fault leaves by
/// a long jump.
bool decode_grey(Bytes bytes, GreyTarget& target) {
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, give_up, say_nothing);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  if (info == nullptr || setjmp(png_jmpbuf(png)) != 0) {
    png_destroy_read_struct(&png, &info, nullptr);
    return false;
  }
  png_set_user_limits(png, kMostAlongSide, kMostAlongSide);
#ifdef FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION  // fuzzers go past checksums, as an attacker does
  png_set_crc_action(png, PNG_CRC_QUIET_USE, PNG_CRC_QUIET_USE);
  png_set_option(png, PNG_IGNORE_ADLER32, PNG_OPTION_ON);
#endif
  png_set_read_fn(png, &bytes, take);
  png_read_info(png, info);
  if (target.bytes_per_pixel == 1) {
    make_grey8(png, info);
  } else {
    target.other_kind =
        png_get_color_type(png, info) != PNG_COLOR_TYPE_GRAY || png_get_bit_depth(png, info) != 16;
    if (target.other_kind) png_error(png, "no 16-bit grey");
    if (std::endian::native == std::endian::little) png_set_swap(png);
    png_set_interlace_handling(png);
    png_read_update_info(png, info);
  }
  target.width = static_cast<int>(png_get_image_width(png, info));
  target.height = static_cast<int>(png_get_image_height(png, info));
  const std::size_t row_bytes =
      static_cast<std::size_t>(target.width) * static_cast<std::size_t>(target.bytes_per_pixel);
  if (png_get_rowbytes(png, info) != row_bytes) png_error(png, "not grey");
  target.bytes.resize(row_bytes * static_cast<std::size_t>(target.height));
  for (std::size_t y = 0; y < static_cast<std::size_t>(target.height); ++y)
    target.rows.push_back(target.bytes.data() + y * row_bytes);
  png_read_image(png, target.rows.data());
  png_destroy_read_struct(&png, &info, nullptr);
  return true;
}

/// A pixel takes no less than a thousandth of a byte: what promises more is no picture.
bool fits(const std::string& bytes) {
  constexpr std::size_t kWidthAt = 16, kHeader = 33;
  if (bytes.size() < kHeader) return false;
  const auto number = [&](std::size_t at) {
    std::uint64_t out = 0;
    for (std::size_t i = 0; i < 4; ++i) out = (out << 8) | static_cast<std::uint8_t>(bytes[at + i]);
    return out;
  };
  return number(kWidthAt) * number(kWidthAt + 4) <= 1100 * bytes.size();
}

}  // namespace

std::string encode_png(const RgbImage& image) {
  PaletteImage few = with_palette(image);
  const bool all = few.palette.empty();
  std::string bytes = encode({.width = image.width,
                              .height = image.height,
                              .color_type = all ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_PALETTE,
                              .channels = all ? 3 : 1,
                              .bytes = all ? image.rgb.data() : few.numbers.data(),
                              .palette = std::move(few.palette)});
  EVPOSE_CHECK(!bytes.empty());
  return bytes;
}

Status write_png_grey8(const std::string& path, int width, int height,
                       const std::vector<std::uint8_t>& pixels) {
  EVPOSE_CHECK(pixels.size() == static_cast<std::size_t>(width) * height);
  return write_grey(path, {.width = width, .height = height, .bytes = pixels.data()});
}

Status write_png_grey16(const std::string& path, int width, int height,
                        const std::vector<std::uint16_t>& pixels) {
  EVPOSE_CHECK(pixels.size() == static_cast<std::size_t>(width) * height);
  return write_grey(path, {.width = width,
                           .height = height,
                           .bits = 16,
                           .bytes = reinterpret_cast<const std::uint8_t*>(pixels.data())});
}

namespace {

Expected<GreyTarget> read_grey(const std::string& path, int bytes_per_pixel) {
  constexpr std::size_t kMostBytes = 256 << 20;
  const auto bytes = first_bytes(path, kMostBytes);
  if (!bytes) return bytes.error();
  GreyTarget target{.bytes_per_pixel = bytes_per_pixel};
  if (fits(*bytes) && decode_grey({bytes->data(), bytes->size()}, target)) return target;
  if (target.other_kind)
    return Error{path, "is no PNG of one channel of 16 bits", "write depth as 16-bit grey levels"};
  return Error{path, "is no PNG picture, or a damaged one", "convert it to PNG, or copy it again"};
}

}  // namespace

Expected<GreyImage> read_png_grey8(const std::string& path) {
  auto read = read_grey(path, 1);
  if (!read) return read.error();
  return GreyImage{read->width, read->height, std::move(read->bytes)};
}

Expected<Grey16Image> read_png_grey16(const std::string& path) {
  const auto read = read_grey(path, 2);
  if (!read) return read.error();
  Grey16Image image{read->width, read->height, std::vector<std::uint16_t>(read->bytes.size() / 2)};
  std::memcpy(image.pixels.data(), read->bytes.data(), read->bytes.size());
  return image;
}

}  // namespace evpose
