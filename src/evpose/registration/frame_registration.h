// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "evpose/camera/frame.h"
#include "evpose/core/pose.h"
#include "evpose/registration/contour_view.h"
#include "evpose/registration/linear_image.h"
#include "evpose/registration/registration.h"

namespace evpose {

/// What one frame is measured with.
struct FrameProblem {
  const Frame& frame;
  double age_s;         ///< from the middle of its exposure to the time of the samples
  double since_last_s;  ///< from the frame before to this one
  std::span<const ContourSample> samples;
  const Matrix6d& pose_covariance;  ///< of the prediction
  ForecastError forecast = {};      ///< that the samples were made with
};

/// Registration of a frame: across each contour, where it is expected at the middle of the exposure, the edge
/// of the picture is searched along the normal, to a fraction of a pixel. Motion within the exposure spreads
/// an edge evenly to both sides of where it is in the middle, in luminance; so grey values are made luminance
/// first, and the window of the edge filter is as wide as the blur. What a wide blur still leaves (a gamma
/// that is not quite the camera's, other edges in the window) grows with it.
///
/// Edges of a cell and direction share errors, which last while the view does: their information is capped
/// accordingly, as that of events.
class FrameRegistration {
 public:
  /// `segments`: number of the map's contrast segments; `map_contrast`: what the map says of each, -1, 0 or
  /// +1 as ContourPoint::contrast.
  FrameRegistration(ImageSize size, const FrameCamera& camera, std::span<const int> map_contrast);

  RegistrationResult measure(const FrameProblem& problem);
  /// Of the last measurement, sample by sample.
  std::span<const SampleOffset> offsets() const { return offsets_; }
  /// Most contours of the last frame had an edge, and those lay at the contours rather than evenly in the
  /// gates.
  bool agrees() const { return agrees_; }

  /// By how often an error that lasts is told again: the information of one frame is less by so much.
  static double repeats(double since_last_s);

  /// What the map or frames have told of the sign of a segment's contrast, as ContourPoint::contrast.
  int contrast(std::uint32_t segment) const;
  /// See Registration.
  void rearrange_segments(std::span<const std::uint32_t> before, std::span<const int> map_contrast);

 private:
  /// An edge of the picture, on the line across a contour.
  struct Edge {
    std::size_t sample;
    double offset_px;  ///< d: from where the contour is expected, along its normal
    double gate_px;
    double variance;         ///< of all its errors but the map's, px^2
    double shared_variance;  ///< of what it shares with its neighbours, px^2
    double weight = 0;       ///< of being the contour's, 0..1
    std::uint32_t cell = 0;
    bool brighter_ahead;  ///< it is brighter towards the normal
    double slope = 0;     ///< derivative of weight times offset by an offset of the pose
  };
  struct Cluster {
    double information = 0, map_variance = 0, shared_variance = 0;
  };
  double expected_offset_px(const FrameProblem& problem, const ContourSample& sample) const;
  std::optional<Edge> find_edge(const FrameProblem& problem, std::size_t sample);
  bool sum_profile(const ContourSample& sample, double offset_px, int half);
  void weigh(const FrameProblem& problem, Edge& edge) const;
  void learn_contrast(const FrameProblem& problem);
  void sum_clusters(const FrameProblem& problem);
  void sum_information(const FrameProblem& problem, RegistrationResult& result);
  void judge(RegistrationResult& result);
  std::uint32_t cell_of(const ContourSample& sample) const;

  ImageSize size_;
  FrameCamera camera_;
  LinearImage image_;
  std::vector<float> signs_;  ///< of the segments: sum over edges, with forgetting
  std::vector<Edge> edges_;
  std::vector<Cluster> clusters_;
  std::vector<SampleOffset> offsets_;
  std::vector<double> profile_, response_;
  double follows_ = 1;  ///< share by which the weighted mean of the edges follows an offset of the pose:
                        ///< texture in the gates stays where it is
  bool agrees_ = false;
};

}  // namespace evpose
