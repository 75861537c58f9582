// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "evpose/camera/adjusted_camera.h"
#include "evpose/camera/calibration_sigma.h"
#include "evpose/camera/trail_filter.h"
#include "evpose/core/error.h"
#include "evpose/registration/registration.h"
#include "evpose/tracker/contour_selection.h"
#include "evpose/tracker/event_share.h"
#include "evpose/tracker/frame_input.h"
#include "evpose/tracker/imu_gate.h"
#include "evpose/tracker/imu_rate_output.h"
#include "evpose/tracker/input_queue.h"
#include "evpose/tracker/map_pager.h"
#include "evpose/tracker/pose_supervisor.h"
#include "evpose/tracker/snapshot.h"
#include "evpose/tracker/start_alignment.h"
#include "evpose/tracker/texture_landmarks.h"
#include "evpose/tracker/tracker_config.h"
#include "evpose/tracker/update.h"
#include "evpose/tracker/update_reporter.h"

namespace evpose {

/// What the tracker is told once.
struct TrackerSetup {
  std::shared_ptr<const Camera> camera;
  Pose T_body_cam;  ///< body = IMU; identity without an IMU
  MotionModel motion = MotionModel::imu;
  ImuNoise imu_noise;
  std::shared_ptr<const ContourMap> map;
  std::optional<CameraIntrinsics> intrinsics = {};  ///< of the camera; without them they count as known
  /// How wrong `camera` and T_body_cam and the time of the IMU may be; none: they are known. Without an IMU,
  /// so are intrinsics of which it states nothing.
  std::optional<CalibrationSigma> calibration_sigma = {};
  TrailFilterSetting trail_filter = {};  ///< of the sensor
  /// Where the rest of the map is had from; `map` is then the part around `map_middle`, near the start, out
  /// to part_radius_m(). None: `map` is all of it.
  MapParts map_parts = {};
  Eigen::Vector3d map_middle = Eigen::Vector3d::Zero();
  FrameCamera frame_camera = {};  ///< of frames, if there are any
  /// What searches over metres make of the map, shared with other trackers; null: its own.
  std::shared_ptr<PlaceCache> places = {};
};

/// Out to where a part of a map has to reach around the camera.
double part_radius_m(const TrackerConfig& config);

/// Where it starts.
struct StartState {
  TimeNs t = 0;
  Pose T_map_body;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();           ///< map frame, m/s
  Eigen::Vector3d angular_rate_body = Eigen::Vector3d::Zero();  ///< rad/s; used without an IMU
};

/// Makes a fusion framework for settings whose automatic choices are made.
using BackEndMaker = std::function<std::unique_ptr<BackEnd>(const FusionConfig&)>;

/// Events and IMU samples in, poses out. Knows neither files nor wall time; the same data give the same
/// bytes, however they are cut into packets and for any number of threads.
class Tracker {
 public:
  /// Error: a start that is not finite, or further from the map than the map can be seen; settings that
  /// exclude each other. `clock`: for Update::times alone. `fusion`: instead of what the settings name.
  static Expected<std::unique_ptr<Tracker>> create(const TrackerSetup& setup, const TrackerConfig& config,
                                                   const StartState& start, StageClock clock = {},
                                                   const BackEndMaker& fusion = {});

  /// Called at each update, in order of time.
  void on_update(std::function<void(const Update&)> callback) { update_callback_ = std::move(callback); }
  /// Called for each IMU sample, in order of time, with the state at it (ImuRateOutput).
  void on_state(ImuRateOutput::Callback callback) { imu_rate_output_.set_callback(std::move(callback)); }
  /// Called within each update with the events since the last one that passed the filter and what the
  /// registration made of them (registration.kind: events). To be set before any data come.
  using VerdictCallback = std::function<void(std::span<const FilteredEvent>, std::span<const EventVerdict>)>;
  void on_verdicts(VerdictCallback callback) { verdict_callback_ = std::move(callback); }

  /// In order of time. An update is made as soon as both streams have passed its time.
  void add_imu(const ImuSample& sample);
  void add_events(const EventPacket& packet);
  /// Of the size of the camera, in order of time, before the events after its exposure; one that comes later
  /// is measured late. Nothing if frames are not to be used.
  void add_frame(Frame frame);
  /// All events up to t have been added: updates up to t need not wait for a later event.
  void events_complete_until(TimeNs t);

  /// After the next update only every n-th is made: for a driver that cannot keep up. 1: all.
  void set_update_stride(int n) { update_stride_ = n; }
  /// After the next update no more than a share of the contours is looked at, others in each update: for a
  /// driver that falls behind. 1: all.
  void limit_event_share(double share) { event_share_.set_limit(share); }
  /// From now on a time surface is kept for snapshots, or no longer.
  void keep_time_surface(bool on) { preprocessor_.keep_surface(on || registration_->reads_surface()); }

  /// The pose is being searched, and nothing measured meanwhile.
  bool searching() const { return supervisor_.searching(); }
  /// The first view is to be aligned, each try of which takes a fifth of a second of a core.
  bool aligns_start() const { return start_alignment_.has_value(); }
  /// It has to be searched, and is not: relocalization.on is off, or search_no_more() was called.
  bool needs_search() const { return supervisor_.needs_search(); }
  void search_no_more() { supervisor_.search_no_more(); }
  /// The newest state, with its covariance.
  const FusionState& state() const { return fusion_->state(); }
  const EventPreprocessor& events() const { return preprocessor_; }
  /// What the fusion found to be wrong with the given calibration, if it was asked to look.
  Calibration calibration() const { return fusion_->calibration(); }
  /// The map, or the part of it that is held, with the signs of contrast that events have told so far; the
  /// others are the map's.
  ContourMap map_with_learnt_contrast() const;

  /// Events and contours at the last update, for pictures; empty of events unless a time surface is kept.
  Snapshot snapshot(double decay_s) const;
  /// The points of a snapshot alone, which costs no pass over the image.
  std::vector<Snapshot::Point> chosen_points(double decay_s) const;

 private:
  /// `adjusted`: the setup's camera if its numbers are estimated, else null.
  Tracker(const TrackerSetup& setup, const TrackerConfig& config, const StartState& start, StageClock clock,
          std::shared_ptr<AdjustedCamera> adjusted, std::unique_ptr<BackEnd> fusion);

  void make_due_updates();
  bool feed_until(TimeNs t);
  void make_update();
  void prepare_update();
  void look_aside();
  void choose_blocks();
  void page_map();
  FusionState forecast() const;
  void see_contours(double span_s);
  void project_samples(const FusionState& state, double span_s);
  TimeNs imu_time(TimeNs t) const;  ///< of an instant of the camera's clock

  // The stages of an update.
  Update update(TimeNs t);
  void search_pose(TimeNs t, const ImuIncrement& moved);
  bool align_start(TimeNs t, const ImuIncrement& moved);
  void take_calibration();
  RegistrationResult measure(TimeNs t, double span_s);
  int darker_side(std::uint32_t segment) const;
  ContourOffset contour_offset(const SampleOffset& offset, double concentration) const;
  bool fuse_frame(TimeNs t, bool aligning, RegistrationResult& measured);
  bool needs_no_frame() const;
  FrameInput::Seen frame_view() const;
  PoseUncertainty::View typical_view() const {
    return {*setup_.camera, setup_.T_body_cam, contours_.typical_depth_m()};
  }
  void fuse(const RegistrationResult& measurement, std::span<const SampleOffset> offsets, double share = 1);
  bool frames_confirm(TimeNs t) const { return frames_ && frames_->confirms(t); }
  void prepare_landmarks(bool measures);
  void expect_landmarks(const FusionState& coming, double span_s);
  void follow_landmarks(TimeNs t, double span_s, bool measured);
  void judge(TimeNs t, double span_s, const RegistrationResult& measurement, const std::string& refused);
  std::string fault(TimeNs t, const RegistrationResult& measurement) const;

  TrackerSetup setup_;
  std::shared_ptr<AdjustedCamera> adjusted_;  ///< is setup_.camera, or null
  TrackerConfig config_;
  Pose T_body_cam_;  ///< as given, and as the fusion has corrected it
  PreparedMap map_;
  MapPager pager_;
  ContourSelection contours_;
  NavState projected_;                ///< that the contours were projected at
  std::optional<NavState> forecast_;  ///< the same, where events are looked at with it as they come
  InterestMap interest_;
  EventPreprocessor preprocessor_;
  EventShare event_share_;
  BlockThinning thinning_;      ///< where events are looked at
  std::int64_t near_seen_ = 0;  ///< events that mattered, at the last update
  bool near_alone_ = false;     ///< only those near contours matter
  double expected_span_s_ = 0;  ///< from the last update to the next
  InputQueue input_;
  ImuGate imu_;
  std::unique_ptr<Registration> registration_;
  std::optional<FrameInput> frames_;  ///< none: they are not used
  std::unique_ptr<BackEnd> fusion_;
  PoseSupervisor supervisor_;
  std::optional<TextureLandmarks> landmarks_;      ///< none: they are not used
  std::optional<StartAlignment> start_alignment_;  ///< until it is done
  int failed_alignments_ = 0;
  TimeNs align_again_ = 0;  ///< not before
  ImuRateOutput imu_rate_output_;
  UpdateReporter reporter_;

  std::function<void(const Update&)> update_callback_;
  VerdictCallback verdict_callback_;
  std::vector<EventVerdict> verdicts_;
  std::vector<ContourOffset> offsets_;  ///< of the last measurement, for a fusion that takes them

  TimeNs start_t_, last_update_, next_update_;
  TimeNs last_look_aside_;    ///< of the pose supervisor, when it last verified the pose
  bool looks_aside_ = false;  ///< it does at the next update
  std::int64_t update_number_ = 0, update_stride_ = 1;
};

}  // namespace evpose
