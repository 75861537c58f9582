// SPDX-License-Identifier: BSD-3-Clause
#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "evpose/calibrate/board_finder.h"

namespace evpose {
namespace {

constexpr std::size_t kFewestTags = 4;
constexpr float kBlur_px = 0.8F;

struct FreeFamily {
  void operator()(apriltag_family_t* family) const { tag36h11_destroy(family); }
};
struct FreeDetector {
  void operator()(apriltag_detector_t* detector) const { apriltag_detector_destroy(detector); }
};
struct FreeDetections {
  void operator()(zarray_t* detections) const { apriltag_detections_destroy(detections); }
};

class TagFinder final : public BoardFinder {
 public:
  explicit TagFinder(const AprilGrid& board)
      : tags_(board.columns * board.rows), family_(tag36h11_create()), detector_(apriltag_detector_create()) {
    apriltag_detector_add_family(detector_.get(), family_.get());
    detector_->quad_decimate = 1;
    detector_->quad_sigma = kBlur_px;
  }

  std::optional<LatticePixels> find(std::span<const float> picture, ImageSize size,
                                    const LatticePixels&) const override {
    const float scale = 100 / std::max(full_value(picture), 1e-9F);
    std::vector<std::uint8_t> grey;
    std::ranges::transform(picture, std::back_inserter(grey), [&](float v) {
      return static_cast<std::uint8_t>(std::clamp(127 + scale * v, 0.0F, 255.0F));
    });
    image_u8_t image{size.width, size.height, size.width, grey.data()};
    const std::unique_ptr<zarray_t, FreeDetections> found(apriltag_detector_detect(detector_.get(), &image));
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    LatticePixels out(4 * static_cast<std::size_t>(tags_), Eigen::Vector2d::Constant(kNone));
    std::size_t seen = 0;
    for (int i = 0; i < zarray_size(found.get()); ++i) {
      apriltag_detection_t* tag = nullptr;
      zarray_get(found.get(), i, static_cast<void*>(&tag));
      if (tag->id < 0 || tag->id >= tags_ || tag->hamming > 0) continue;
      // The library counts from the edge of a pixel, we from its middle.
      for (std::size_t corner = 0; corner < 4; ++corner)
        out[4 * static_cast<std::size_t>(tag->id) + corner] = {tag->p[corner][0] - 0.5,
                                                               tag->p[corner][1] - 0.5};
      ++seen;
    }
    return seen >= kFewestTags ? std::optional(std::move(out)) : std::nullopt;
  }

 private:
  int tags_;
  std::unique_ptr<apriltag_family_t, FreeFamily> family_;
  std::unique_ptr<apriltag_detector_t, FreeDetector> detector_;
};

}  // namespace

std::unique_ptr<BoardFinder> make_tag_finder(const AprilGrid& board) {
  return std::make_unique<TagFinder>(board);
}

}  // namespace evpose
