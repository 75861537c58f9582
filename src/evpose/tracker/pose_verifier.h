// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/event/event_preprocessor.h"
#include "evpose/registration/block_thinning.h"
#include "evpose/registration/contour_view.h"
#include "evpose/tracker/event_bursts.h"
#include "evpose/tracker/pose_evidence.h"

namespace evpose {

enum class PoseVerdict : std::uint8_t {
  open,       ///< too little has been seen, or it could be either
  confirmed,  ///< the events gather at the contours far beyond chance
  contested,  ///< they do, but for the contours of one direction in the image
  refuted,    ///< hardly more than chance and fitting put there
};

/// Tells a pose that the events confirm from one that only looks so: compares the events on the contours with
/// those on the same contours moved aside in the image, piece by piece. A wrong pose that has been fitted to
/// the events has some contours on edges of the image; most are where there is none. A map that is right but
/// for what runs in one direction holds the pose in the others only, so each direction is judged by itself.
/// Pieces that flights have told are known to make events: where they are enough, in all or in one direction,
/// they alone are asked.
/// Of lamps that flicker the bursts of events are left out.
class PoseVerifier {
 public:
  /// `told`: of each of the map's contrast segments, whether flights have told it; `map_hides`: the map has
  /// surfaces that hide contours.
  PoseVerifier(ImageSize size, std::vector<bool> told, bool map_hides);

  /// The pose comes from elsewhere: what was seen does not count any more.
  void restart();
  /// The pieces are those of another part of the map from now on; see rearranged().
  void rearrange(std::span<const std::uint32_t> before, std::vector<bool> told);
  /// One update of several: all events of its span, and the contours at its time; `elapsed_s`: since the
  /// last one that was looked at. `thinning`: where there are all events, out to kAside_px beside contours.
  void add(std::span<const FilteredEvent> events, std::span<const ContourSample> contours, double span_s,
           double elapsed_s, const BlockThinning& thinning = {});
  static constexpr double kAside_px = 14;

  const PoseEvidence& evidence() const { return evidence_; }
  PoseVerdict verdict() const { return verdict_; }
  /// The same of a pose that was chosen among many because contours agree: a few do wherever it is.
  PoseVerdict verdict_of_found() const;

 private:
  static constexpr std::size_t kDecoys = 4;
  struct Piece {
    float way_px = 0;  ///< of the contour across itself
    float on = 0;      ///< events
    std::array<float, kDecoys> beside{};
    std::uint8_t direction = 0;  ///< of the contour in the image, of kDirections
  };
  /// Of some of the pieces.
  struct Counts {
    double pieces = 0, on = 0, beside = 0;
    double explained = 0, by_chance = 0;  ///< pieces
    Counts& operator+=(const Counts& other);
    double ratio() const;
    double share() const { return (explained - by_chance) / pieces; }
  };
  static constexpr std::size_t kDirections = 8;
  static Counts count(const Piece& piece);
  static bool is_enough(const Counts& one);
  void decay(double elapsed_s);
  struct Look {
    float events = 0;
    bool crossed = false;  ///< by a contour
  };
  std::optional<Look> look(const ContourSample& contour, double aside_px, double span_s);
  void look_at(const ContourSample& contour, double span_s);
  bool find_patch(const ContourSample& contour, double aside_px, double span_s);
  PoseEvidence gather() const;
  void judge();
  PoseVerdict weigh(const PoseEvidence& e) const;

  static constexpr std::uint8_t kOnContour = 0x80, kMostEvents = 0x7F;

  ImageSize size_;
  EventBursts bursts_;
  double confirmed_ratio_;            ///< of events on contours to those beside
  double direction_ratio_;            ///< the same of each direction
  std::vector<std::uint8_t> pixels_;  ///< number of this update's events, kOnContour
  std::vector<std::uint32_t> patch_;  ///< pixels where a contour was, had it been moved aside
  std::vector<std::uint32_t> marked_;
  std::vector<bool> told_;           ///< of each piece, by flights
  std::vector<Piece> pieces_;        ///< with exponential forgetting
  std::vector<std::uint32_t> seen_;  ///< pieces that something was seen of
  PoseEvidence evidence_;            ///< of seen_
  PoseVerdict verdict_ = PoseVerdict::open;
};

}  // namespace evpose
