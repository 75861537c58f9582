// SPDX-License-Identifier: BSD-3-Clause
// The reference twin of the hand-written solver: same residuals, same loss, Ceres's minimiser.
#include <ceres/ceres.h>

#include <cmath>
#include <memory>

#include "evpose/registration/test_temporal_field_ceres.h"

namespace evpose {
namespace {

/// The parameter is the perturbation d of the predicted pose; the derivative by d follows from that by a
/// further small perturbation e: T(d).plus(e) = T(d + (e_p, Jr^-1 e_phi)).
class PointCost final : public ceres::SizedCostFunction<1, 6> {
 public:
  PointCost(const FieldProblem& problem, FieldKernel kernel, const FieldPoint& point, double scale)
      : problem_(problem), kernel_(kernel), point_(point), root_scale_(std::sqrt(scale)) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const Eigen::Map<const Vector6d> d(parameters[0]);
    Vector6d J;
    const bool wanted = jacobians != nullptr && jacobians[0] != nullptr;
    double r = 0;
    evaluate_point(problem_, kernel_, problem_.T_map_body_predicted.plus(d), point_, &r,
                   wanted ? &J : nullptr);
    residuals[0] = root_scale_ * r;
    if (wanted) {
      Eigen::Map<Eigen::Matrix<double, 1, 6>> out(jacobians[0]);
      out.head<3>() = root_scale_ * J.head<3>().transpose();
      out.tail<3>() = root_scale_ * J.tail<3>().transpose() * so3::right_jacobian(d.tail<3>());
    }
    return true;
  }

 private:
  const FieldProblem& problem_;
  FieldKernel kernel_;
  const FieldPoint& point_;
  double root_scale_;
};

class PriorCost final : public ceres::SizedCostFunction<6, 6> {
 public:
  explicit PriorCost(const Matrix6d& information) { root_ = information.llt().matrixU(); }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    Eigen::Map<Vector6d> r(residuals);
    r = root_ * Eigen::Map<const Vector6d>(parameters[0]);
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>> out(jacobians[0]);
      out = root_;
    }
    return true;
  }

 private:
  Matrix6d root_;
};

}  // namespace

FieldSolution minimise_with_ceres(const FieldProblem& problem, const TemporalFieldConfig& config) {
  const double scale = 1 / (config.noise * config.noise * config.correlated_points);
  Vector6d d = Vector6d::Zero();
  ceres::Problem::Options own;
  own.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem reference(own);
  ceres::TukeyLoss loss(config.robust_scale * std::sqrt(scale));
  for (const auto& point : problem.points)
    reference.AddResidualBlock(new PointCost(problem, config.kernel, point, scale), &loss, d.data());
  reference.AddResidualBlock(new PriorCost(problem.prior_information), nullptr, d.data());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = config.max_iterations;
  options.logging_type = ceres::SILENT;
  options.num_threads = 1;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &reference, &summary);

  FieldSolution result;
  result.T_map_body = problem.T_map_body_predicted.plus(d);
  result.iterations = static_cast<int>(summary.iterations.size());
  result.converged = summary.termination_type == ceres::CONVERGENCE;
  ThreadPool one(1);
  evaluate_information(problem, config, one, &result);
  return result;
}

}  // namespace evpose
