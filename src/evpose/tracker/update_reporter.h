// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/event/event_preprocessor.h"
#include "evpose/fusion/state.h"
#include "evpose/registration/registration.h"
#include "evpose/tracker/input_queue.h"
#include "evpose/tracker/update.h"

namespace evpose {

/// Makes the report of each update: the time of its stages and what came out.
class UpdateReporter {
 public:
  explicit UpdateReporter(StageClock clock) : clock_(std::move(clock)) {}

  /// Of the clock that the driver handed in; 0 without one.
  double now_s() const { return clock_ ? clock_() : 0; }
  /// Time that was spent before the events of the next update came.
  void add_preparation(double seconds) { prepared_s_ = seconds; }
  /// `events_s`: time spent on the events since the last update.
  void begin(double events_s);
  /// The stage that began with begin() or with the end of the last one is done.
  void end_stage(double StageTimes::*stage);

  /// `share`: of the contours that were looked at.
  void add_registration(const RegistrationResult& registration, double innovation, bool accepted,
                        double share);
  /// The pose's covariance as it was judged.
  void add_judgement(Health health, std::string reason, std::vector<Pose> candidates,
                     const Matrix6d& covariance);
  void add_probability(double probability, const PoseEvidence& look);
  /// The state at the end of the update, and the counts of events until now.
  Update finish(const FusionState& state, const EventPreprocessor::Counts& counts);

  /// Of the events since the last update, most were left out because too many came.
  bool most_events_shed(const EventPreprocessor::Counts& counts) const {
    return 2 * (counts.shed - counted_.shed) > counts.read - counted_.read;
  }

 private:
  StageClock clock_;
  double stage_began_s_ = 0, prepared_s_ = 0;
  EventPreprocessor::Counts counted_;  ///< at the last update
  Update update_;
};

}  // namespace evpose
