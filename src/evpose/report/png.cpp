// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/png.h"

#include <png.h>

#include "evpose/core/error.h"

namespace evpose {

std::string encode_png(const RgbImage& image) {
  EVPOSE_CHECK(image.width > 0 && image.height > 0);
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = PNG_FORMAT_RGB;
  // Written twice, first to learn the size: the largest possible one is that of the raw picture.
  png_alloc_size_t size = 0;
  EVPOSE_CHECK(png_image_write_to_memory(&png, nullptr, &size, 0, image.rgb.data(), 0, nullptr) != 0);
  std::string bytes(size, '\0');
  EVPOSE_CHECK(png_image_write_to_memory(&png, bytes.data(), &size, 0, image.rgb.data(), 0, nullptr) != 0);
  return bytes;
}

}  // namespace evpose
