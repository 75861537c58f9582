// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/core/parallel.h"
#include "evpose/core/pose.h"
#include "evpose/event/time_surface.h"
#include "evpose/registration/contrast_memory.h"
#include "evpose/registration/registration.h"
#include "evpose/registration/temporal_field.h"
#include "evpose/registration/temporal_field_polarity.h"

namespace evpose {

class ConfigTable;

/// Least distance of two points along one contour: closer ones read the same pixels.
inline constexpr double kFieldStride_px = 12;

struct TemporalFieldConfig {
  FieldKernel kernel = FieldKernel::spline;
  double eta_s = 0;            ///< time constant of the field, as in the paper; 0: it follows the flow
  bool learn_contrast = true;  ///< events tell the sign of a contour's contrast; else the map alone does

  // Not for users: tests of the minimum set these.
  double decay_px = 0.5;  ///< time constant as predicted motion of the point across its contour
  double decay_min_s = 3e-3, decay_max_s = 30e-3;  ///< its limits
  double robust_scale = 1.1;                       ///< residual (0..1) beyond which Tukey's loss is flat
  int max_iterations = 6;
  double converged_px = 0.01;      ///< a step that moves the points by less ends the iteration
  double noise = 0.5;              ///< 1 sigma of a residual at the optimum
  double correlated_points = 300;  ///< so many points share one error: the information is divided by it
};
void describe(ConfigTable& table, TemporalFieldConfig& config);

/// A contour point as one measurement needs it.
struct FieldPoint {
  Eigen::Vector3d position_map;                  ///< metres
  double decay_us = 0;                           ///< time constant of the field at this point
  FieldPolarity polarity = FieldPolarity::both;  ///< that its events have
};

struct FieldProblem {
  const TimeSurface& surface;
  const Camera& camera;
  const Pose& T_body_cam;
  const std::vector<FieldPoint>& points;
  std::uint32_t now_us;  ///< on the surface's clock
  const Pose& T_map_body_predicted;
  const Matrix6d& prior_information;  ///< of the predicted pose, perturbed as Pose::plus
};

struct FieldSolution {
  Pose T_map_body;                          ///< minimum of the points' and the prior's cost together
  Matrix6d information = Matrix6d::Zero();  ///< of the points alone, at the minimum
  Vector6d vector =
      Vector6d::Zero();  ///< information * (offset of the points' own minimum from the prediction)
  int iterations = 0;
  bool converged = false;
  int seen = 0;     ///< points inside the image
  int matched = 0;  ///< of these, with a field of at least 1/e
  double cost = 0;  ///< mean of the points' robust loss
};

/// EV-Pose eq. (1) with the prediction as prior (eq. 5 for the newest state):
///   min over d of  sum_i rho(1 - T_p(i)(pi(T_cam_map p_i))) / s^2 + d^T P^-1 d,
/// p(i) the polarity of point i, rho Tukey's biweight, by Gauss-Newton with step control.
FieldSolution minimise(const FieldProblem& problem, const TemporalFieldConfig& config, ThreadPool& pool);

/// Fills information, vector, seen, matched and cost of a result from its pose.
void evaluate_information(const FieldProblem& problem, const TemporalFieldConfig& config, ThreadPool& pool,
                          FieldSolution* result);

/// Residual 1 - T of one point and its derivative by the pose perturbation; false, 1 and zero outside of the
/// image.
bool evaluate_point(const FieldProblem& problem, FieldKernel kernel, const Pose& T_map_body,
                    const FieldPoint& point, double* residual, Vector6d* jacobian);

/// The paper's registration: visible contour points on the temporal distance field of the polarity that their
/// contrast and motion predict (EV-Pose 4.1 to 4.3 and 5.1, Algorithm 1).
class TemporalFieldRegistration final : public Registration {
 public:
  /// `segments`: number of the map's contrast segments.
  TemporalFieldRegistration(const TemporalFieldConfig& config, const PolarityConfig& polarity,
                            std::uint32_t segments, int threads)
      : config_(config), polarity_(polarity), contrast_(segments, kCountedThreshold), pool_(threads) {}

  RegistrationResult measure(const RegistrationProblem& problem) override;
  bool reads_surface() const override { return true; }
  /// What the map says of the contrast of a segment, -1, 0 or +1 as ContourPoint::contrast.
  void seed_contrast(std::uint32_t segment, int map_contrast) { contrast_.seed(segment, -map_contrast); }
  void rearrange_segments(std::span<const std::uint32_t> before, std::span<const int> map_contrast) override {
    contrast_.rearrange(before, map_contrast);
  }
  const ContrastMemory* contrast() const override { return &contrast_; }

 private:
  static constexpr double kCountedThreshold = 0.25;  ///< of the edge delay, which nothing here asks for
  double time_constant_us(const ContourSample& sample) const;
  void count_events(const RegistrationProblem& problem, RegistrationResult* result);

  TemporalFieldConfig config_;
  PolarityConfig polarity_;
  ContrastMemory contrast_;
  ThreadPool pool_;
  std::vector<FieldPoint> points_;  ///< of the last call, one for each sample
};

}  // namespace evpose
