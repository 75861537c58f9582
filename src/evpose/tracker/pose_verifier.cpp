// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/pose_verifier.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "evpose/registration/rearranged.h"

namespace evpose {
namespace {

// Where it is looked. Patches reach over the way of the contour since the last update.
constexpr std::array<double, 4> kDecoys_px{-12, -7, 7, 12};
constexpr std::array<double, 2> kAlong_px{-1.5, 1.5};  // of a sample
constexpr double kReach_px = 1;                        // events lie so near to their contour
constexpr int kFewestFree = 2;                         // of places beside: no other contour crosses them

// For how long it counts.
constexpr double kMemory_s = 0.1, kLongestMemory_s = 1;  // the longer one while little moves
constexpr float kEnoughWay_px = 2;
constexpr float kForgotten_px = 1e-2F;

constexpr double kSigma = 2;  // by so much, and by chance, pieces have more events on them than beside

// How much has to be seen, and of it.
constexpr float kLeastWay_px = 0.25F;  // in the looks: by a pixel in all
constexpr double kFewestPieces = 20, kFewestEvents = 100;
constexpr double kConfirmedRatio = 2.3;
constexpr double kConfirmedRatioUnhidden = 1.9;         // contours behind surfaces have no events, but count
constexpr double kLeastShare = 0.04, kEnoughRatio = 4;  // a few contours that happen to fit do not confirm
constexpr double kFewestExplained = 10;                 // pieces, whatever their share
constexpr double kManyPieces = 30, kRatioOfMany = 2.5;  // whatever their share
constexpr double kConfirmedShare = 0.2, kRatioOfShare = 1.4;     // where texture has events beside them
constexpr double kDirectionRatio = 1.7, kDirectionShare = 0.05;  // one of the two, of each direction
constexpr double kDirectionRatioUnhidden = 1.4;
constexpr double kFewestPiecesOfOne = 15, kFewestEventsOfOne = 60;  // of a direction that counts
constexpr double kRefutedRatio = 1.7, kRefutedShare = 0.1;
// Of many pieces, when hardly one has clearly more events than beside it: a few long contours make the ratio.
constexpr double kManyToRefute = 300, kRefutedRatioOfMany = 2.5, kRefutedShareOfMany = 0.015;

/// Which of `count` equal sectors of the half circle the line lies in that has this normal.
std::uint8_t sector_of(const Eigen::Vector2d& normal, std::size_t count) {
  const double turns = std::atan2(normal.y(), normal.x()) / M_PI;  // of the half circle
  const double sector = std::floor((turns - std::floor(turns)) * static_cast<double>(count));
  return static_cast<std::uint8_t>(std::min(static_cast<std::size_t>(sector), count - 1));
}

}  // namespace

PoseVerifier::PoseVerifier(ImageSize size, std::vector<bool> told, bool map_hides)
    : size_(size),
      confirmed_ratio_(map_hides ? kConfirmedRatio : kConfirmedRatioUnhidden),
      direction_ratio_(map_hides ? kDirectionRatio : kDirectionRatioUnhidden),
      pixels_(static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height)),
      told_(std::move(told)),
      pieces_(told_.size()) {}

void PoseVerifier::restart() {
  for (const std::uint32_t i : seen_) pieces_[i] = {};
  seen_.clear();
  evidence_ = {};
  verdict_ = PoseVerdict::open;
}

void PoseVerifier::rearrange(std::span<const std::uint32_t> before, std::vector<bool> told) {
  told_ = std::move(told);
  std::vector<std::uint32_t> now(pieces_.size(), kNewSegment);
  for (std::uint32_t i = 0; i < before.size(); ++i)
    if (before[i] != kNewSegment) now[before[i]] = i;
  pieces_ = rearranged(pieces_, before);
  for (std::uint32_t& piece : seen_) piece = now[piece];
  std::erase(seen_, kNewSegment);
  judge();
}

/// The pixels where the contour was since the last update, had it been moved aside, into patch_. False: it
/// leaves the image, and those until there are in it.
bool PoseVerifier::find_patch(const ContourSample& contour, double aside_px, double span_s) {
  const double back_px = -contour.speed_px_s * span_s;
  const double from = std::min(0.0, back_px) - kReach_px, to = std::max(0.0, back_px) + kReach_px;
  const int steps = static_cast<int>(std::ceil(to - from)), places = steps + 1;
  const double nx = contour.normal_px.x(), ny = contour.normal_px.y();
  const auto at = [&, px = contour.pixel.x(), py = contour.pixel.y()](int i, double along) {
    const double across = aside_px + from + (to - from) * i / steps;
    return Eigen::Vector2d(px + across * nx + along * -ny, py + across * ny + along * nx);
  };
  constexpr double kHalf = 0.5;  // to the nearest: positions are not negative
  const auto pixel = [width = size_.width](const Eigen::Vector2d& v) {
    return static_cast<std::uint32_t>(static_cast<int>(v.y() + kHalf) * width +
                                      static_cast<int>(v.x() + kHalf));
  };
  patch_.resize(kAlong_px.size() * static_cast<std::size_t>(places));
  std::uint32_t* out = patch_.data();
  for (const double along : kAlong_px) {
    if (!size_.contains(at(0, along), 1) || !size_.contains(at(steps, along), 1)) {
      for (int i = 0; size_.contains(at(i, along), 1); ++i) *out++ = pixel(at(i, along));
      patch_.resize(static_cast<std::size_t>(out - patch_.data()));
      return false;
    }
    for (int i = 0; i < places; ++i) out[i] = pixel(at(i, along));
    out += places;
  }
  return true;
}

/// Events where the contour was, had it been moved aside; nothing if it leaves the image.
std::optional<PoseVerifier::Look> PoseVerifier::look(const ContourSample& contour, double aside_px,
                                                     double span_s) {
  if (!find_patch(contour, aside_px, span_s)) return std::nullopt;
  unsigned events = 0, marks = 0;
  for (const std::uint32_t i : patch_) events += pixels_[i] & kMostEvents, marks |= pixels_[i];
  return Look{static_cast<float>(events), (marks & kOnContour) != 0};
}

void PoseVerifier::look_at(const ContourSample& contour, double span_s) {
  const auto on = look(contour, 0, span_s);
  if (!on) return;
  std::array<Look, kDecoys> beside;
  float sum = 0;
  int free = 0;
  for (std::size_t k = 0; k < kDecoys; ++k) {
    const auto there = look(contour, kDecoys_px[k], span_s);
    if (!there) return;
    beside[k] = *there;
    if (!there->crossed) sum += there->events, ++free;
  }
  if (free < kFewestFree) return;
  Piece& piece = pieces_[contour.segment];
  if (piece.way_px == 0) seen_.push_back(contour.segment);
  piece.way_px += static_cast<float>(std::abs(contour.speed_px_s) * span_s) + 1e-6F;
  piece.on += on->events;
  piece.direction = sector_of(contour.normal_px, kDirections);
  for (std::size_t k = 0; k < kDecoys; ++k)  // another contour's events say nothing of this one
    piece.beside[k] += beside[k].crossed ? sum / static_cast<float>(free) : beside[k].events;
}

void PoseVerifier::decay(double elapsed_s) {
  const auto keep = static_cast<float>(std::exp(-elapsed_s / kMemory_s)),
             keep_slow = static_cast<float>(std::exp(-elapsed_s / kLongestMemory_s));
  std::erase_if(seen_, [&](std::uint32_t i) {
    Piece& piece = pieces_[i];
    const float share = piece.way_px > kEnoughWay_px ? keep : keep_slow;
    piece.way_px *= share, piece.on *= share;
    for (float& b : piece.beside) b *= share;
    const bool forgotten = piece.way_px < kForgotten_px && piece.on < kForgotten_px;
    if (forgotten) piece = {};
    return forgotten;
  });
}

void PoseVerifier::add(std::span<const FilteredEvent> events, std::span<const ContourSample> contours,
                       double span_s, double elapsed_s, const BlockThinning& thinning) {
  decay(elapsed_s);
  const std::span<const FilteredEvent> quiet = bursts_.quiet(events);
  if (quiet.empty() && !events.empty()) {
    judge();
    return;
  }
  const auto pixel_of = [this](const FilteredEvent& e) -> std::uint8_t& {
    return pixels_[static_cast<std::size_t>(e.y) * static_cast<std::size_t>(size_.width) + e.x];
  };
  for (const FilteredEvent& e : quiet)
    if (pixel_of(e) < kMostEvents) ++pixel_of(e);
  marked_.clear();
  for (const ContourSample& contour : contours) {
    find_patch(contour, 0, span_s);
    marked_.insert(marked_.end(), patch_.begin(), patch_.end());
  }
  for (const std::uint32_t i : marked_) pixels_[i] |= kOnContour;
  for (const ContourSample& contour : contours)
    if (thinning.takes(contour.pixel)) look_at(contour, span_s);
  for (const std::uint32_t i : marked_) pixels_[i] = 0;
  for (const FilteredEvent& e : quiet) pixel_of(e) = 0;
  judge();
}

PoseVerifier::Counts& PoseVerifier::Counts::operator+=(const Counts& other) {
  pieces += other.pieces, on += other.on, beside += other.beside;
  explained += other.explained, by_chance += other.by_chance;
  return *this;
}

double PoseVerifier::Counts::ratio() const { return on / std::max(beside, 1.0); }

PoseVerifier::Counts PoseVerifier::count(const Piece& piece) {
  // Clearly more events here than `there`, which is known from so many places.
  const auto exceeds = [](double here, double there, double places) {
    return here - there > kSigma * std::sqrt(here + there / places + 1) ? 1.0 : 0.0;
  };
  const double sum = std::accumulate(piece.beside.begin(), piece.beside.end(), 0.0);
  Counts out{1, piece.on, sum / kDecoys, exceeds(piece.on, sum / kDecoys, kDecoys), 0};
  for (const double b : piece.beside) out.by_chance += exceeds(b, (sum - b) / (kDecoys - 1), kDecoys - 1);
  out.by_chance /= kDecoys;
  return out;
}

/// Of a direction that counts.
bool PoseVerifier::is_enough(const Counts& one) {
  return one.pieces >= kFewestPiecesOfOne && one.on + one.beside >= kFewestEventsOfOne;
}

PoseEvidence PoseVerifier::gather() const {
  Counts all, all_told;
  std::array<Counts, kDirections> sectors, told;
  for (const std::uint32_t i : seen_) {
    const Piece& piece = pieces_[i];
    if (piece.way_px < kLeastWay_px) continue;
    const Counts counts = count(piece);
    all += counts, sectors[piece.direction] += counts;
    if (told_[i]) all_told += counts, told[piece.direction] += counts;
  }
  const auto tells = [](const Counts& c) {
    return c.pieces >= kFewestPieces && c.on + c.beside >= kFewestEvents;
  };
  if (tells(all_told)) all = all_told;
  if (!tells(all)) return {};
  PoseEvidence out{all.pieces, all.share(), all.ratio()};
  std::optional<double> worst;
  for (std::size_t i = 0; i < kDirections; ++i) {
    const std::size_t next = (i + 1) % kDirections;  // with it: no direction lies at the border of all
    Counts one = sectors[i], one_told = told[i];
    one += sectors[next], one_told += told[next];
    if (is_enough(one_told)) one = one_told;
    if (!is_enough(one)) continue;
    worst = std::min(worst.value_or(one.ratio()), one.ratio());
    out.contested |= one.ratio() < direction_ratio_ && one.share() < kDirectionShare;
  }
  out.worst_ratio = worst.value_or(out.ratio);
  return out;
}

void PoseVerifier::judge() {
  evidence_ = gather();
  verdict_ = weigh(evidence_);
}

PoseVerdict PoseVerifier::weigh(const PoseEvidence& e) const {
  if (e.pieces == 0) return PoseVerdict::open;
  const double explained = e.explained * e.pieces;
  const bool agrees =
      (e.ratio > confirmed_ratio_ && e.explained > kLeastShare && explained > kFewestExplained) ||
      e.ratio > kEnoughRatio || (e.ratio > kRatioOfMany && explained > kManyPieces) ||
      (e.ratio > kRatioOfShare && e.explained > kConfirmedShare && explained > kFewestExplained);
  if (agrees) return e.contested ? PoseVerdict::contested : PoseVerdict::confirmed;
  const bool refuted =
      (e.ratio < kRefutedRatio && e.explained < kRefutedShare) ||
      (e.pieces > kManyToRefute && e.ratio < kRefutedRatioOfMany && e.explained < kRefutedShareOfMany);
  return refuted ? PoseVerdict::refuted : PoseVerdict::open;
}

PoseVerdict PoseVerifier::verdict_of_found() const {
  if (verdict_ != PoseVerdict::confirmed) return verdict_;
  return evidence_.explained * evidence_.pieces < kFewestExplained ? PoseVerdict::open : verdict_;
}

}  // namespace evpose
