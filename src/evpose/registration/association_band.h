// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/event/event_preprocessor.h"
#include "evpose/event/interest_map.h"

namespace evpose {

/// The part of the image that one contour sample answers for: a rectangle across the contour that moves with
/// it. An event at e of age a has the signed distance n.(e - x) + speed a - curvature a^2 from the contour.
struct alignas(32) AssociationBand {
  float x, y;              ///< centre at the time of the update, px
  float nx, ny;            ///< unit normal of the contour
  float speed, curvature;  ///< px/us, px/us^2
  float reach;             ///< largest distance, px
};

/// Finds the band that an event belongs to, at the event's own time. Among bands of one line that is the
/// nearest along it; among those of several lines the nearest across, or none when two are similarly near.
/// Built anew for each update, as bands move; the cost goes with bands and events, not with the image.
class AssociationIndex {
 public:
  /// `half_length_px`: of a band, along the contour.
  AssociationIndex(ImageSize size, double half_length_px, double ambiguity_px);

  /// Forgets all earlier bands. `span_us`: age of the oldest event that will be asked for.
  void build(std::span<const AssociationBand> bands, float span_us);

  struct Owner {
    std::int32_t band = -1;  ///< -1: none
    float distance = 0;      ///< signed, px
  };
  /// Position inside the image.
  Owner find(float x, float y, float age_us) const;

  struct Found {
    std::uint32_t event;
    Owner owner;
  };
  /// Appends the events from number `first` on that a band owns, in their order; `now_us`: of the bands, on
  /// the events' clock. As find() for each, eight side by side, which differs by rounding; the same for any
  /// `first`.
  void find_all(std::span<const FilteredEvent> events, std::size_t first, std::uint32_t now_us,
                std::vector<Found>* found);

  /// Marks where the bands that `asked` names come by during the span, and `margin_px` around it; `aside_px`
  /// more across them.
  void mark(std::span<const std::uint8_t> asked, float margin_px, float aside_px,
            InterestMap* interest) const;

 private:
  static constexpr int kCell_px = 8, kMostHits = 16;  // more than so many bands at one place are a tangle
  struct Hit {
    std::int32_t band;
    float distance, along;
  };
  struct Entry {
    std::int32_t band, next;
  };
  void find_eight(std::span<const FilteredEvent> events, std::span<const std::uint32_t> which,
                  std::uint32_t now_us, std::vector<Found>* found) const;
  Owner resolve(const Owner& nearest, std::span<const Hit> hits) const;
  std::size_t cell_of(float x, float y) const {
    return static_cast<std::size_t>(static_cast<int>(y) / kCell_px * columns_ +
                                    static_cast<int>(x) / kCell_px);
  }
  void enter(std::int32_t number);

  int columns_, rows_;
  float half_length_, ambiguity_;
  float span_us_ = 0;
  std::vector<AssociationBand> bands_;  ///< and one more, which nothing is near
  std::vector<Entry> entries_;        ///< the first is every list's end: it is of that band and its own next
  std::vector<std::int32_t> heads_;   ///< of each cell's list of entries
  std::vector<std::uint32_t> close_;  ///< events in cells with bands
};

}  // namespace evpose
