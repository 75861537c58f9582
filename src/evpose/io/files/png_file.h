// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "evpose/core/error.h"

namespace evpose {

/// Eight bits a channel, rows from the top, red first.
struct RgbImage {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;  ///< 3 * width * height

  RgbImage(int image_width, int image_height, std::uint8_t value = 255)
      : width(image_width),
        height(image_height),
        rgb(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height), value) {}
  std::uint8_t* pixel(int x, int y) {
    return &rgb[3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                     static_cast<std::size_t>(x))];
  }
};

/// The bytes of a PNG file, with a palette where there are no more than 256 colours. An empty image is a
/// fault of ours.
std::string encode_png(const RgbImage& image);

/// Grey pictures, rows from the top. Faults of ours: an empty picture, a size that does not fit.
Status write_png_grey8(const std::string& path, int width, int height,
                       const std::vector<std::uint8_t>& pixels);
Status write_png_grey16(const std::string& path, int width, int height,
                        const std::vector<std::uint16_t>& pixels);

struct GreyImage {
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;  ///< row by row, from the top
};

/// Any PNG as grey levels: colours by their luma, 16 bits scaled to 8, transparency left out. Errors: as of
/// open_to_read(), no PNG or a damaged one, more than 16,384 pixels along a side.
Expected<GreyImage> read_png_grey8(const std::string& path);

struct Grey16Image {
  int width = 0, height = 0;
  std::vector<std::uint16_t> pixels;  ///< row by row, from the top
};

/// A PNG of one channel of 16 bits, its numbers as they stand, as depth images have them. Errors: any other
/// PNG, which has no such numbers; those of read_png_grey8().
Expected<Grey16Image> read_png_grey16(const std::string& path);

}  // namespace evpose
