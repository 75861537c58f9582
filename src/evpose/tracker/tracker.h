// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/error.h"
#include "evpose/core/parallel.h"
#include "evpose/event/event_front.h"
#include "evpose/fusion/back_end.h"
#include "evpose/map/contour_segments.h"
#include "evpose/map/visible_set.h"
#include "evpose/registration/event_alignment.h"
#include "evpose/registration/registration.h"
#include "evpose/tracker/contour_view.h"
#include "evpose/tracker/health.h"
#include "evpose/tracker/imu_agreement.h"
#include "evpose/tracker/imu_watch.h"
#include "evpose/tracker/relocalizer.h"
#include "evpose/tracker/update.h"

namespace evpose {

struct TrackerConfig {
  double rate_hz = 300;  ///< updates per second of data time
  int threads = 1;       ///< for the alignment; the estimate is the same for any number
  EventFrontConfig events;
  VisibleSetConfig visible;
  FieldKind field = FieldKind::events;
  EventAlignmentConfig alignment;  ///< of field == events
  RegistrationConfig exponential;  ///< of field == exponential
  FusionConfig fusion;
  ImuWatchConfig imu;
  ImuAgreementConfig agreement;
  RelocalizationConfig relocalization;
  HealthConfig health;
};
void describe(ConfigTable& table, TrackerConfig& config);

/// What the tracker is told once.
struct TrackerSetup {
  std::shared_ptr<const Camera> camera;
  Pose T_body_cam;  ///< body = IMU; identity without an IMU
  MotionModel motion = MotionModel::imu;
  ImuNoise imu_noise;
  std::shared_ptr<const ContourMap> map;
};

/// Where it starts.
struct StartState {
  TimeNs t = 0;
  Pose T_map_body;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();           ///< map frame, m/s
  Eigen::Vector3d angular_rate_body = Eigen::Vector3d::Zero();  ///< rad/s; used without an IMU
};

/// Events and IMU samples in, poses out. Knows neither files nor wall time; the same data give the same
/// bytes, however they are cut into packets and for any number of threads.
class Tracker {
 public:
  /// Seconds on any monotone clock; used for Update::times alone.
  using StageClock = std::function<double()>;

  /// Error: a start that is not finite, or further from the map than the map can be seen.
  static Expected<std::unique_ptr<Tracker>> create(const TrackerSetup& setup, const TrackerConfig& config,
                                                   const StartState& start, StageClock clock = {});

  /// Called at each update, in order of time.
  void on_update(std::function<void(const Update&)> callback) { callback_ = std::move(callback); }

  /// Called for each IMU sample, in order of time, with the state at it: that of the newest update not after
  /// it, carried on by the IMU. Which update that is does not depend on when samples and packets arrive.
  void on_state(std::function<void(const FusionState&)> callback) { state_callback_ = std::move(callback); }

  /// Called within each update with the events since the last one that passed the filter and what the
  /// alignment made of them (field: events).
  using VerdictCallback = std::function<void(std::span<const FrontEvent>, std::span<const EventVerdict>)>;
  void on_verdicts(VerdictCallback callback) { verdict_callback_ = std::move(callback); }

  /// In order of time. An update is made as soon as both streams have passed its time.
  void add_imu(const ImuSample& sample);
  void add_events(const EventPacket& packet);
  /// All events up to t have been added: updates up to t need not wait for a later event.
  void events_complete_until(TimeNs t);

  /// After the next update only every n-th is made: for a driver that cannot keep up. 1: all.
  void set_update_stride(int n) { update_stride_ = n; }

  const EventFront& events() const { return front_; }
  /// What the fusion found to be wrong with the given calibration, if it was asked to look.
  Calibration calibration() const { return fusion_->calibration(); }

  /// What the alignment saw at the last update, for pictures.
  struct Snapshot {
    ImageSize size;
    std::vector<float> decay;  ///< row-major; > 0 on, < 0 off, exp(-age / decay_s)
    struct Point {
      float x, y;  ///< px, at the updated pose
      bool matched;
    };
    std::vector<Point> points;
  };
  Snapshot snapshot(double decay_s) const;
  /// The points of a snapshot alone, which costs no pass over the image.
  std::vector<Snapshot::Point> chosen_points(double decay_s) const;

 private:
  Tracker(const TrackerSetup& setup, const TrackerConfig& config, const StartState& start, StageClock clock);

  void pump();
  /// Feeds the front with events of `packet` from `from` on that are not after `until`; the number fed.
  std::size_t feed(const EventPacket& packet, std::size_t from, TimeNs until);
  void consume(const EventPacket& packet, std::size_t* from);
  void make_update();
  TimeNs imu_time(TimeNs t) const;  ///< of an instant of the camera's clock
  bool imu_reaches(TimeNs t) const;
  void tell_states();
  bool bridge_silence(TimeNs until);
  FusionState with_imu_biases() const;
  ImuSample held_reading(TimeNs t, const FusionState& state) const;
  ImuTrust trust_in(const CheckedImu& a, const CheckedImu& b, TimeNs t) const;
  void predict(TimeNs t);
  double sigma_px() const;
  std::string weakest_direction() const;
  void search(TimeNs t);
  struct Registration {
    PoseInformation measurement;
    int points = 0, matched = 0;
    double residual = 0;
    int events = 0, wrong_polarity = 0, other_motion = 0;
    bool captured = true;
    double slope = 1;
  };
  /// Fills points_ or samples_ from the visible set; the median image motion, px/s.
  double plan_points(const Pose& T_map_body, double span_s);
  Registration register_events(TimeNs t, const Pose& predicted, double span_s);
  /// Why a registration is not used; empty if it is.
  std::string refusal(const Registration& registration, double innovation) const;
  Update update(TimeNs t);
  double now() const { return clock_ ? clock_() : 0; }

  TrackerSetup setup_;
  TrackerConfig config_;
  StageClock clock_;
  ThreadPool pool_;
  ContourIndex index_;
  VisibleSet visible_;
  EventFront front_;
  std::unique_ptr<BackEnd> fusion_;
  Relocalizer relocalizer_;
  HealthMonitor health_;
  std::function<void(const Update&)> callback_;
  std::function<void(const FusionState&)> state_callback_;
  VerdictCallback verdict_callback_;
  std::vector<EventVerdict> verdicts_;
  ImuWatch imu_watch_;
  ImuAgreement agreement_;
  FusionState ahead_;  ///< the state at the last sample told
  ImuSample told_;     ///< that sample; its time is ahead_'s
  std::deque<CheckedImu> to_tell_;

  Pose given_T_body_cam_;
  TimeNs start_t_, last_update_;
  std::int64_t update_number_ = 0, update_stride_ = 1;
  TimeNs next_update_ = 0;
  std::deque<CheckedImu> imu_;       ///< from the state's time on; the first is at it once started
  std::deque<EventPacket> waiting_;  ///< events that arrived before their IMU samples
  std::size_t waiting_from_ = 0;     ///< consumed part of the first
  ContourSegments pieces_;
  std::vector<std::uint32_t> offset_pieces_;  ///< of each map point, where the pieces have offsets
  EventAlignment alignment_;
  std::vector<AlignmentPoint> points_;   ///< of the exponential field
  std::vector<ContourSample> samples_;   ///< of the events' alignment
  std::vector<ContourOffset> contours_;  ///< of the last alignment, for a back end that takes them
  std::vector<double> flows_, depths_;   ///< of the points, px/s and m
  double typical_depth_m_ = 3;
  ImuIncrement moved_;  ///< over the last prediction, while the pose is searched
  FusionState before_search_, before_blind_;
  Eigen::Vector3d held_gyro_ = Eigen::Vector3d::Zero();  ///< reading of the last rate that was trusted
  bool blind_ = false;                                   ///< the IMU is silent or not relied on
  TimeNs verify_until_ = 0;  ///< a pose that was found is watched until then; 0: none
  double astray_s_ = 0;      ///< for how long it has been lost, or its events have not gathered at contours
  EventFront::Counts counted_;
  double events_time_s_ = 0;
};

}  // namespace evpose
