// SPDX-License-Identifier: BSD-3-Clause
#include <limits>
#include <memory>
#include <optional>

#include "evpose/run/packet_queue.h"
#include "evpose/run/track_recording.h"

namespace evpose {
namespace {

constexpr TimeNs kNever = std::numeric_limits<TimeNs>::min();

/// What a recording has beside its events, given to a tracker ahead of them.
class Companions {
 public:
  static Expected<Companions> open(const Recording& recording, FrameUse frame_use, Tracker& tracker) {
    Companions out(recording, tracker);
    if (recording.has_imu) {
      auto imu = open_imu(recording);
      if (!imu) return imu.error();
      out.imu_.emplace(*std::move(imu));
    }
    if (recording.frames_path.empty() || frame_use == FrameUse::off) return out;
    auto frames = open_frames(recording);
    if (!frames) return frames.error();
    out.frames_.emplace(*std::move(frames));
    if (auto status = out.read_frame(); !status) return status.error();
    return out;
  }

  /// All samples and frames that are known by t, and one sample more.
  Status feed_until(TimeNs t) {
    ImuSample sample;
    while (imu_ && imu_until_ <= t) {
      const auto more = imu_->next(sample);
      if (!more) return more.error();
      if (!*more) break;
      tracker_.add_imu(sample);
      imu_until_ = sample.t;
    }
    while (frame_ && frame_->end(camera_) <= t) {
      tracker_.add_frame(*std::move(frame_));
      if (auto status = read_frame(); !status) return status;
    }
    return {};
  }
  /// When the next frame is known; none if there is none.
  std::optional<TimeNs> next_frame() const {
    return frame_ ? std::optional(frame_->end(camera_)) : std::nullopt;
  }

 private:
  Companions(const Recording& recording, Tracker& tracker)
      : camera_(recording.frame_camera), tracker_(tracker) {}
  Status read_frame() {
    frame_.emplace();
    const auto more = frames_->next(*frame_);
    if (!more) return more.error();
    if (!*more) frame_.reset();
    return {};
  }

  FrameCamera camera_;
  Tracker& tracker_;
  std::optional<ImuReader> imu_;
  std::optional<FrameReader> frames_;
  std::optional<Frame> frame_;  ///< the next one
  TimeNs imu_until_ = kNever;
};

/// Whether to go on at t.
class Progress {
 public:
  Progress(const Recording& recording, const std::function<bool(double)>& told)
      : first_(recording.first_ns),
        length_s_(std::max(1e-9, to_seconds(recording.last_ns - recording.first_ns))),
        told_(told) {}
  bool goes_on(TimeNs t) const { return !told_ || told_(to_seconds(t - first_) / length_s_); }

 private:
  TimeNs first_;
  double length_s_;
  const std::function<bool(double)>& told_;
};

/// False if it was ended.
Expected<bool> feed_events(const Recording& recording, const RunConfig& config, Tracker& tracker,
                           Companions& companions, const Progress& progress) {
  auto reader = open_events(recording, 1e-3 * config.packet_ms);
  if (!reader) return reader.error();
  std::unique_ptr<PacketQueue> ahead;
  if (config.tracker.threads > 1) ahead = std::make_unique<PacketQueue>(**reader);
  EventPacket packet;
  while (true) {
    const auto more = ahead ? ahead->next(packet) : (*reader)->next(packet);
    if (!more) return more.error();
    if (!*more) return true;
    const TimeNs end = packet.time(packet.events.back());
    if (auto status = companions.feed_until(end); !status) return status.error();
    tracker.add_events(packet);
    if (!progress.goes_on(end)) return false;
  }
}

}  // namespace

Status feed_recording(const Recording& recording, const RunConfig& config, Tracker& tracker,
                      const std::function<bool(double)>& told) {
  const FrameUse use = config.tracker.frames.use;
  auto companions = Companions::open(recording, use, tracker);
  if (!companions) return companions.error();
  const Progress progress(recording, told);
  if (use != FrameUse::alone && !recording.events_path.empty()) {
    const auto all = feed_events(recording, config, tracker, *companions, progress);
    if (!all) return all.error();
    if (!*all) return {};
  }
  while (const auto t = companions->next_frame()) {
    if (auto status = companions->feed_until(*t); !status) return status;
    tracker.events_complete_until(*t);
    if (!progress.goes_on(*t)) return {};
  }
  return {};
}

}  // namespace evpose
