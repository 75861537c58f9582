// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/verdict_history.h"

#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

constexpr double kConfirmed_s = 0.04;  // four looks: a few pieces of contours agree by chance for a moment
constexpr double kFoundConfirmed_s = 0.15;   // of a pose that was chosen among many because it agrees
constexpr double kSuspectConfirmed_s = 0.5;  // near a start that was wrong: in texture looks agree for long
constexpr double kContestedShare = 0.5;      // of time in which one direction of contours does not agree
constexpr double kContradicted_s = 0.05;     // by chance, few contours have events for so long
constexpr double kContested_s = 0.2;  // of a pose that was verified: one direction may pass without events
constexpr double kHopeless_s = 1;     // without a search
// A pose that the events contradict is wrong by no one knows what: as if only GPS and a compass told it.
constexpr double kDoubtPosition_m = 3, kDoubtRotation_rad = 0.35;
constexpr double kFoundFades_s = 0.5;  // while events confirm it, in a map that states none
// A pose that was right slides along the contours that are left.
constexpr double kSlides_m_s = 0.3, kSlides_rad_s = 0.1;

}  // namespace

void VerdictHistory::add(const Look& look) {
  // Without events there is no new evidence: a scene at rest does not confirm a pose that was found.
  const double confirming_s = look.measured || !look.watched ? look.span_s : 0;
  const bool contested = look.verdict == PoseVerdict::contested;
  if (look.verdict == PoseVerdict::confirmed) {
    confirmed_s_ += confirming_s;
    found_doubt_ *= std::exp(-look.span_s / kFoundFades_s);
  }
  // In texture one direction may go without clearly more events for a while, of right poses and of wrong
  // ones.
  const bool waits = contested && look.watched && !map_may_be_wrong_;
  if (waits && look.probable) confirmed_s_ += kContestedShare * confirming_s;
  if (look.verdict != PoseVerdict::confirmed && !waits) confirmed_s_ = 0;
  contested_s_ = contested ? contested_s_ + look.span_s : 0;
  // Some of the contours that are built of a cloud are where nothing is.
  const bool given_agrees = contested && map_may_be_wrong_ && !verified_ && !look.watched;
  if (look.verdict == PoseVerdict::confirmed || given_agrees) contradicted_s_ = 0;
  if (look.verdict == PoseVerdict::refuted) contradicted_s_ += look.span_s;
  // In a map of a cloud right poses are refuted at first, too.
  start_was_wrong_ |= !look.watched && !verified_ && !map_may_be_wrong_ && is_contradicted();
  verified_ |= confirmed_s_ > needed_s(look.watched);
}

/// For how long in a row events have to confirm the pose.
double VerdictHistory::needed_s(bool watched) const {
  if (start_was_wrong_) return kSuspectConfirmed_s;
  return watched ? kFoundConfirmed_s : kConfirmed_s;
}

void VerdictHistory::found(bool start_was_wrong) {
  *this = VerdictHistory(map_may_be_wrong_);
  start_was_wrong_ = start_was_wrong;
  found_doubt_ = map_may_be_wrong_ ? 0 : 1;
}

void VerdictHistory::contradict() { contradicted_s_ = std::max(contradicted_s_, 2 * kContradicted_s); }

bool VerdictHistory::is_contradicted() const { return contradicted_s_ > kContradicted_s; }

bool VerdictHistory::is_hopeless() const { return contradicted_s_ > kHopeless_s; }

/// Contours of each direction have had events at some time once it is verified.
bool VerdictHistory::is_contested() const {
  return contested_s_ > (verified_ ? kContested_s : kContradicted_s);
}

Matrix6d VerdictHistory::doubt(bool watched) const {
  double position_m = 0, rotation_rad = 0;
  if (is_contradicted() || (!verified_ && (is_contested() || watched)))
    position_m = kDoubtPosition_m, rotation_rad = kDoubtRotation_rad;
  else if (is_contested())
    position_m = kSlides_m_s * contested_s_, rotation_rad = kSlides_rad_s * contested_s_;
  position_m = std::hypot(position_m, found_doubt_ * kFoundPosition_m);
  rotation_rad = std::hypot(rotation_rad, found_doubt_ * kFoundRotation_rad);
  Matrix6d out = Matrix6d::Zero();
  out.diagonal().head<3>().setConstant(position_m * position_m);
  out.diagonal().tail<3>().setConstant(rotation_rad * rotation_rad);
  return out;
}

}  // namespace evpose
