// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/camera/trail_filter.h"
#include "evpose/core/pose.h"
#include "evpose/event/event_preprocessor.h"
#include "evpose/registration/association_band.h"
#include "evpose/registration/contour_trust.h"
#include "evpose/registration/contrast_memory.h"
#include "evpose/registration/event_sums.h"
#include "evpose/registration/flow_monitor.h"
#include "evpose/registration/gate_concentration.h"
#include "evpose/registration/lasting_offsets.h"
#include "evpose/registration/registration.h"

namespace evpose {

class ConfigTable;

struct EventRegistrationConfig {
  double gate_px = 0.5;               ///< an event belongs to a contour within this and two sigma of the map
  double event_sigma_px = 0.7;        ///< scatter of a contour's events about it
  double correlated_sigma_px = 0.35;  ///< error that the events of a cell and direction share
  double correlation_time_s = 0.025;  ///< how long such an error lasts
  double map_sigma_m = 0.5e-3;        ///< of map points that state no sigma
  bool edge_delay = true;             ///< events come after the contour, by contrast and polarity
  bool polarity = true;               ///< leave out events of the polarity that contrast and flow exclude
  double buffer_sigma = 3;           ///< both polarities count where the flow is nearer to zero (EV-Pose 5.1)
  bool ego_motion_test = false;      ///< mistrust cells whose events move otherwise (EV-Pose 5.3)
  double contrast_threshold = 0.25;  ///< of the camera, in log luminance

  // Not for users: the relocalizer's stages, or trackers without an IMU, differ in these.
  double contrast_band_px = 1.5;           ///< events so near teach the contrast
  bool gate_truncation_correction = true;  ///< take off the information that the gate hides
  bool polarity_tells_clutter = false;     ///< needs the direction of motion from an IMU
  TrailFilterSetting trail_filter = {};    ///< of the sensor, as its calibration states it
  bool judge_contours = false;  ///< some may be wrong: those that events do not gather at lose weight
};
void describe(ConfigTable& table, EventRegistrationConfig& config);

/// Registration of each event once, at its own time, against the moving contours: the distance field of
/// EV-Pose 4.2 turned round. An event at x of age a has the signed distance
///   d = n.(x - u) + s1 a - s2 a^2 + delay sign(s1)
/// from the contour sample that claims its pixel; d is zero-mean Gaussian for events of the contour and
/// uniform over the gate for clutter (soft assignment). The gate is tight: a wide one was measured to hand
/// the pose to texture beside the contours. It follows the map's sigma. A gate truncates: events that an
/// offset moves out of it no longer tell of the offset. How much is lost follows from the density of events
/// at the gate and is taken off the information (gate truncation correction). Events of a cell and direction
/// share errors that last; their information is capped accordingly.
class EventRegistration final : public Registration {
 public:
  /// `segments`: number of the map's contrast segments.
  EventRegistration(ImageSize size, const EventRegistrationConfig& config, std::uint32_t segments = 1);

  RegistrationResult measure(const RegistrationProblem& problem) override;
  bool expect(const RegistrationForecast& forecast, InterestMap* interest) override;
  void look_at(std::span<const FilteredEvent> events, std::uint32_t now_us) override;
  void learn(std::span<const ContourSample> samples, double span_s) override;
  void restart() override {
    concentration_ = {};
    lasting_.forget();
  }
  bool reads_surface() const override { return config_.ego_motion_test; }
  std::span<const SampleOffset> offsets() const override { return offsets_; }
  /// Hands on what the map says of the contrast of a segment, -1, 0 or +1 as ContourPoint::contrast.
  void seed_contrast(std::uint32_t segment, int map_contrast) { contrast_.seed(segment, -map_contrast); }
  const ContrastMemory* contrast() const override { return &contrast_; }
  void rearrange_segments(std::span<const std::uint32_t> before, std::span<const int> map_contrast) override {
    contrast_.rearrange(before, map_contrast);
    config_.judge_contours ? trust_.rearrange(before) : lasting_.rearrange(before);
  }
  /// How far behind this contour its events are expected, px along its motion.
  FilteredEdgeDelay::Value edge_delay(const ContourSample& sample) const;

 private:
  /// What a sample that has events brings to its cluster: of cell and direction.
  struct Membership {
    std::uint32_t cluster;
    double map_variance, delay_variance;  ///< px^2
    double clutter;                       ///< squared ratio of clutter to the contour's own
  };
  struct Cluster {
    double weight = 0, map_variance = 0, delay_variance = 0, clutter = 0, trust = 1;
    int agree = 0, differ = 0;  ///< events in the gates that move as predicted, or not
  };
  double gate_of(const ContourSample& sample) const;
  double contour_share(const ContourSample& sample) const;
  void begin(std::span<const ContourSample> samples, double span_s, const BlockThinning& thinning,
             const Matrix6d& pose_covariance);
  void forget_unasked(std::size_t first);
  void make_rule(std::size_t sample);
  EventRule rule_of(const ContourSample& sample, double share, const EdgeDelay& delay) const;
  void shift_sums(const RegistrationProblem& problem);
  void look_again(const RegistrationProblem& problem);
  EventVerdict verdict(const EventRule& rule, float distance, bool on) const;
  void judge_contours(const RegistrationProblem& problem);
  void learn_lasting_offsets(std::span<const ContourSample> samples, double span_s);
  void test_ego_motion(const RegistrationProblem& problem);
  void sum_clusters();
  void sum_information(const RegistrationProblem& problem, RegistrationResult* result);
  void mark_other_motion(const RegistrationProblem& problem);
  std::uint32_t cluster_of(const ContourSample& sample) const;
  bool polarity_is_wrong(const ContourSample& sample, int sign) const;
  bool owns_probe(std::size_t sample, float half_span_us) const;

  ImageSize size_;
  EventRegistrationConfig config_;
  AssociationIndex index_;
  ContrastMemory contrast_;
  FlowMonitor flow_;
  ContourTrust trust_;      ///< if contours may be wrong
  LastingOffsets lasting_;  ///< else
  GateConcentration concentration_;
  // Of the interval, one for each sample; kept so that steady state allocates nothing.
  std::span<const ContourSample> samples_;  ///< from begin() to measure()
  Matrix6d pose_covariance_;                ///< that rules are made for
  std::vector<AssociationBand> bands_;
  std::vector<std::uint8_t> asked_;  ///< 1: events on the sample's block are looked at
  bool all_asked_ = true;
  std::vector<AssociationIndex::Found> found_;
  std::size_t looked_at_ = 0;  ///< events, since begin()
  EventSums sums_;
  std::vector<Membership> members_;  ///< of the samples with rules
  std::vector<SampleOffset> offsets_;
  std::vector<LastingOffsets::Sample> asking_;
  std::vector<Cluster> clusters_;
  std::uint32_t call_ = 0;
  bool learns_ = false;  ///< what was measured last is still to be learnt from
};

}  // namespace evpose
