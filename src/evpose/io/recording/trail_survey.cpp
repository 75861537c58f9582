// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/recording/trail_survey.h"

namespace evpose {
namespace {

constexpr std::int64_t kEnoughPairs = 1000;
constexpr double kMissing = 0.01;  // of the pairs of opposite polarity

}  // namespace

TrailSurvey::TrailSurvey(ImageSize size)
    : size_(size), pixels_(static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height)) {}

void TrailSurvey::add(const EventPacket& packet) {
  for (const Event& e : packet.events) {
    if (e.x >= size_.width || e.y >= size_.height) continue;
    Pixel& p = pixels_[static_cast<std::size_t>(e.y) * static_cast<std::size_t>(size_.width) + e.x];
    const TimeNs t = packet.time(e);
    const auto sign = static_cast<std::int8_t>(e.on ? 1 : -1);
    if (p.sign != 0)
      for (std::size_t i = kGaps.size(); i-- > 0 && t - p.last < kGaps[i];)
        ++(sign == p.sign ? same_ : opposite_)[i];
    p = {t, sign};
  }
}

std::optional<double> TrailSurvey::filtered_gap_s() const {
  std::optional<double> out;
  for (std::size_t i = 0; i < kGaps.size(); ++i)
    if (opposite_[i] >= kEnoughPairs &&
        static_cast<double>(same_[i]) < kMissing * static_cast<double>(opposite_[i]))
      out = to_seconds(kGaps[i]);
  return out;
}

}  // namespace evpose
