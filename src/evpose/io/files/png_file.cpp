// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/files/png_file.h"

#include <png.h>

#include <csetjmp>

#include "evpose/io/files/atomic_file.h"

namespace evpose {
namespace {

void append(png_structp png, png_bytep data, png_size_t size) {
  static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<const char*>(data), size);
}

// The rows are bytes; 16-bit ones in the order of this machine.
Status write_grey(const std::string& path, int width, int height, int bits, const std::uint8_t* rows) {
  EVPOSE_CHECK(width > 0 && height > 0);
  std::string bytes;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
  if (info == nullptr || setjmp(png_jmpbuf(png)) != 0) {
    png_destroy_write_struct(&png, &info);
    return Error{path, "the picture cannot be encoded", "free some memory"};
  }
  png_set_write_fn(png, &bytes, append, nullptr);
  png_set_IHDR(png, info, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height), bits,
               PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  png_set_compression_level(png, 3);
  png_write_info(png, info);
  if (bits == 16) png_set_swap(png);
  const std::size_t row_bytes = static_cast<std::size_t>(width) * (bits / 8);
  for (int y = 0; y < height; ++y) png_write_row(png, rows + y * row_bytes);
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  return write_text_file(path, bytes);
}

}  // namespace

Status write_png_grey8(const std::string& path, int width, int height,
                       const std::vector<std::uint8_t>& pixels) {
  EVPOSE_CHECK(pixels.size() == static_cast<std::size_t>(width) * height);
  return write_grey(path, width, height, 8, pixels.data());
}

Status write_png_grey16(const std::string& path, int width, int height,
                        const std::vector<std::uint16_t>& pixels) {
  EVPOSE_CHECK(pixels.size() == static_cast<std::size_t>(width) * height);
  return write_grey(path, width, height, 16, reinterpret_cast<const std::uint8_t*>(pixels.data()));
}

}  // namespace evpose
