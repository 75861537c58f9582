// SPDX-License-Identifier: BSD-3-Clause
// Pictures, and lists of frames. A list may name itself as a picture ("fuzz"), so that reading goes on.
#include <algorithm>

#include "evpose/core/error.h"
#include "evpose/io/files/png_file.h"
#include "evpose/io/recording/frame_reader.h"
#include "fuzz.h"

EVPOSE_FUZZ_TARGET(png) {
  const auto picture = evpose::read_png_grey8(evpose::fuzz::as_file(bytes));
  if (!picture) return;
  EVPOSE_CHECK(picture->width > 0 && picture->height > 0);
  EVPOSE_CHECK(picture->pixels.size() ==
               static_cast<std::size_t>(picture->width) * static_cast<std::size_t>(picture->height));
}

EVPOSE_FUZZ_TARGET(frame_list) {
  using Stamp = evpose::FrameReadOptions::Stamp;
  evpose::FrameReadOptions options;
  if (!bytes.empty()) options.stamp = static_cast<Stamp>(bytes[0] % 3);
  options.offset_ns = bytes.size() % 2 == 0 ? 0 : -1'000'000'000;
  auto reader = evpose::FrameReader::open(evpose::fuzz::as_file(bytes), options);
  if (!reader) return;
  const auto& rows = reader->rows();
  EVPOSE_CHECK(!rows.empty());
  EVPOSE_CHECK(
      std::is_sorted(rows.begin(), rows.end(), [](const auto& a, const auto& b) { return a.t < b.t; }));
  for (const auto& row : rows) EVPOSE_CHECK(row.exposure >= 0);
  evpose::Frame frame;
  (void)reader->next(frame);
}
