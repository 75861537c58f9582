// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "evpose/camera/frame.h"
#include "evpose/fusion/state.h"
#include "evpose/registration/registration.h"

namespace evpose {

class ConfigTable;
class FrameRegistration;

enum class FrameUse {
  fused,  ///< beside the events
  off,
  alone,  ///< without the events
};

struct FrameUseConfig {
  FrameUse use = FrameUse::fused;
};
void describe(ConfigTable& table, FrameUseConfig& config);

/// Frames on their way to the update that measures them.
class FrameInput {
 public:
  /// See FrameRegistration.
  FrameInput(ImageSize size, const FrameCamera& camera, std::span<const int> map_contrast);
  FrameInput(FrameInput&&) noexcept;
  FrameInput& operator=(FrameInput&&) noexcept;
  ~FrameInput();

  void add(Frame frame) { waiting_.push_back(std::move(frame)); }
  /// Forgets what is waiting and what was seen of the pose: it comes from elsewhere.
  void restart();

  struct Seen {
    std::span<const ContourSample> samples;  ///< at t
    Matrix6d pose_covariance;
    ForecastError forecast;
    const FusionState& state;  ///< at t
  };
  /// Measures the newest frame that is exposed by t, at the state of t; none if there is no new one.
  std::optional<RegistrationResult> measure(TimeNs t, const Seen& seen);
  /// Frames that are exposed by t are not needed.
  void pass_over(TimeNs t) { take_newest(t); }
  /// The motion at the end of an update, on the clock of the events.
  void remember(TimeNs t, const FusionState& state);
  /// Of that measurement.
  std::span<const SampleOffset> offsets() const;
  /// Why it is not used; empty if it is.
  static std::string refusal(const RegistrationResult& result, const Matrix6d& pose_covariance,
                             double innovation_gate);
  /// The last frames have shown the contours where the pose has them.
  bool confirms(TimeNs t) const;
  /// Share of the events' information that is used: less where the pose that they hold contradicts the frames
  /// by more than both state, as in the dark, where events come late.
  double share_of_events() const;

  /// What frames have told of a segment's contrast, as ContourPoint::contrast; 0 before the first one.
  int contrast(std::uint32_t segment) const;
  void rearrange_segments(std::span<const std::uint32_t> before, std::span<const int> map_contrast);

 private:
  std::optional<Frame> take_newest(TimeNs t);
  struct Motion {
    TimeNs t;
    Eigen::Vector3d velocity, angular_rate;  ///< map frame; body frame
  };
  /// By how much the pose at `then` differs from what constant velocity up to t makes of it.
  Vector6d beside_constant_velocity(TimeNs t, TimeNs then, const FusionState& state) const;

  static constexpr int kConfirming = 4;
  FrameCamera camera_;
  std::unique_ptr<FrameRegistration> registration_;
  std::deque<Frame> waiting_;
  double doubt_ = 0;            ///< normalised innovation squared / 6 of frames, with memory
  std::deque<Motion> motions_;  ///< of the last updates
  std::optional<TimeNs> last_;  ///< time of the frame measured last
  int agreed_ = 0;              ///< frames in a row
};

}  // namespace evpose
