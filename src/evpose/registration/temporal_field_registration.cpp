// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/temporal_field_registration.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "evpose/core/config.h"

namespace evpose {
namespace {

constexpr std::size_t kChunk = 256;       // points per parallel piece; fixes the order of the sums
constexpr double kMatchedField = 0.3679;  // 1/e: an event at most one time constant ago

/// Sums over points; those of the chunks are added in order.
struct NormalEquations {
  Matrix6d H = Matrix6d::Zero();
  Vector6d b = Vector6d::Zero();
  double cost = 0;
  int seen = 0, matched = 0;

  void add(const NormalEquations& o) {
    H += o.H;
    b += o.b;
    cost += o.cost;
    seen += o.seen;
    matched += o.matched;
  }
};

NormalEquations accumulate(const FieldProblem& problem, const TemporalFieldConfig& config,
                           const Pose& T_map_body, ThreadPool& pool) {
  const std::size_t n = problem.points.size();
  std::vector<NormalEquations> partial(ThreadPool::chunks(n, kChunk));
  const double c2 = config.robust_scale * config.robust_scale;
  pool.for_chunks(n, kChunk, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    NormalEquations& sum = partial[chunk];
    for (std::size_t i = begin; i < end; ++i) {
      double r = 0;
      Vector6d J;
      if (evaluate_point(problem, config.kernel, T_map_body, problem.points[i], &r, &J)) {
        ++sum.seen;
        if (1 - r >= kMatchedField) ++sum.matched;
      }
      // Tukey's biweight: a point without events (r = 1) says nothing, and neither does its cost's slope.
      const double inside = std::max(0.0, 1 - r * r / c2);
      const double weight = inside * inside;
      sum.cost += c2 / 3 * (1 - inside * inside * inside);
      sum.H.selfadjointView<Eigen::Lower>().rankUpdate(J, weight);
      sum.b -= weight * r * J;
    }
  });
  NormalEquations sum;
  for (const auto& p : partial) sum.add(p);
  sum.H.triangularView<Eigen::StrictlyUpper>() = sum.H.transpose();
  return sum;
}

double information_scale(const TemporalFieldConfig& c) {
  return 1 / (c.noise * c.noise * c.correlated_points);
}

void fill(const FieldProblem& problem, double scale, const NormalEquations& normal, FieldSolution* result) {
  result->information = scale * normal.H;
  result->vector =
      scale * normal.b + result->information * result->T_map_body.minus(problem.T_map_body_predicted);
  result->seen = normal.seen;
  result->matched = normal.matched;
  result->cost = problem.points.empty() ? 0 : normal.cost / static_cast<double>(problem.points.size());
}

}  // namespace

void describe(ConfigTable& table, TemporalFieldConfig& c) {
  table.add("kernel", c.kernel, {{"bilinear", FieldKernel::bilinear}, {"spline", FieldKernel::spline}},
            "field between pixels");
  table.add("eta_s", c.eta_s, "s",
            "time constant of the field (EV-Pose 4.1); 0: half a pixel of predicted motion, 3 to 30 ms",
            {0, 10});
  table.add("learn_contrast", c.learn_contrast,
            "events tell which side of a contour is brighter; false: the map alone does");
}

bool evaluate_point(const FieldProblem& problem, FieldKernel kernel, const Pose& T_map_body,
                    const FieldPoint& point, double* residual, Vector6d* jacobian) {
  const Eigen::Matrix3d R_body_map = T_map_body.q.conjugate().toRotationMatrix();
  const Eigen::Vector3d x_body = R_body_map * (point.position_map - T_map_body.p);
  const Pose T_cam_body = problem.T_body_cam.inverse();
  Matrix23d J_pixel;
  const auto pixel = problem.camera.project(T_cam_body * x_body, &J_pixel);
  if (!pixel || !problem.camera.size().contains(*pixel)) {
    // As dear as a point without events: otherwise the cheapest pose is one that looks elsewhere.
    *residual = 1;
    if (jacobian != nullptr) jacobian->setZero();
    return false;
  }
  const FieldSample field =
      sample_field(problem.surface, *pixel, problem.now_us, point.decay_us, kernel, point.polarity);
  *residual = 1 - field.value;
  if (jacobian != nullptr) {
    const Eigen::RowVector3d A = -field.gradient.transpose() * J_pixel * T_cam_body.rotation();
    // x_body = R^T (X - p): d/dp = -R^T; d/dphi = [x_body]x.
    jacobian->head<3>() = (-A * R_body_map).transpose();
    jacobian->tail<3>() = (A * so3::hat(x_body)).transpose();
  }
  return true;
}

FieldSolution minimise(const FieldProblem& problem, const TemporalFieldConfig& config, ThreadPool& pool) {
  FieldSolution result;
  Pose pose = problem.T_map_body_predicted;
  const double scale = information_scale(config);
  const auto total_cost = [&](const NormalEquations& n, const Pose& at) {
    const Vector6d d = at.minus(problem.T_map_body_predicted);
    return scale * n.cost + d.dot(problem.prior_information * d);
  };
  NormalEquations normal = accumulate(problem, config, pose, pool);
  double cost = total_cost(normal, pose);
  double damping = 1e-4;
  const double pixels_per_rad = problem.camera.focal_px();
  for (; result.iterations < config.max_iterations && !result.converged; ++result.iterations) {
    const Vector6d d = pose.minus(problem.T_map_body_predicted);
    Matrix6d H = scale * normal.H + problem.prior_information;
    H.diagonal() *= 1 + damping;
    const Vector6d step = H.ldlt().solve(scale * normal.b - problem.prior_information * d);
    if (!step.allFinite()) break;
    result.converged = step.tail<3>().norm() * pixels_per_rad < config.converged_px &&
                       step.head<3>().norm() * pixels_per_rad < config.converged_px;
    const Pose candidate = pose.plus(step);
    NormalEquations next = accumulate(problem, config, candidate, pool);
    const double next_cost = total_cost(next, candidate);
    if (next_cost <= cost) {
      pose = candidate;
      normal = next;
      cost = next_cost;
      damping = std::max(damping * 0.1, 1e-6);
    } else {
      damping = std::max(damping * 30, 1e-1);
    }
  }
  result.T_map_body = pose;
  fill(problem, scale, normal, &result);
  return result;
}

void evaluate_information(const FieldProblem& problem, const TemporalFieldConfig& config, ThreadPool& pool,
                          FieldSolution* result) {
  fill(problem, information_scale(config), accumulate(problem, config, result->T_map_body, pool), result);
}

double TemporalFieldRegistration::time_constant_us(const ContourSample& s) const {
  if (config_.eta_s > 0) return 1e6 * config_.eta_s;
  return 1e6 * std::clamp(config_.decay_px / std::max(std::abs(s.speed_px_s), 1e-9), config_.decay_min_s,
                          config_.decay_max_s);
}

/// What came to the contours since the last update, of the predicted polarity and of the other; and what it
/// tells of their contrast.
void TemporalFieldRegistration::count_events(const RegistrationProblem& p, RegistrationResult* result) {
  for (std::size_t i = 0; i < p.samples.size(); ++i) {
    const ContourSample& s = p.samples[i];
    const SampleEvents near = events_at(*p.surface, s, p.now_us, p.span_s);
    const FieldPolarity expected = points_[i].polarity;
    result->events +=
        (expected != FieldPolarity::off ? near.on : 0) + (expected != FieldPolarity::on ? near.off : 0);
    result->wrong_polarity += expected == FieldPolarity::on    ? near.off
                              : expected == FieldPolarity::off ? near.on
                                                               : 0;
    if (!config_.learn_contrast) continue;
    contrast_.sweep(s.segment, near.swept_px2);
    const int net = s.normal_side * (s.speed_px_s > 0 ? 1 : -1) * (near.on - near.off);
    if (net != 0) contrast_.count(s.segment, net);
  }
}

RegistrationResult TemporalFieldRegistration::measure(const RegistrationProblem& p) {
  EVPOSE_CHECK(p.surface != nullptr && p.view != nullptr);
  RegistrationResult result;
  points_.clear();
  for (const ContourSample& s : p.samples)  // the visible points (5.3), with their flow by the state's twist
    points_.push_back(
        {p.view->map.position(s.point), time_constant_us(s), predicted_polarity(s, contrast_, polarity_)});
  count_events(p, &result);
  const Matrix6d prior = p.pose_covariance.ldlt().solve(Matrix6d::Identity());
  const FieldProblem problem{*p.surface,   p.view->camera, p.view->T_body_cam, points_, p.now_us,
                             p.T_map_body, prior};
  const FieldSolution solution = minimise(problem, config_, pool_);  // eq. (1)
  result.information = solution.information;
  result.vector = solution.vector;
  result.residual = std::sqrt(solution.cost);
  result.points = solution.seen;
  result.inliers = solution.matched;
  result.converged = solution.converged;
  return result;
}

}  // namespace evpose
