// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "evpose/fusion/state.h"

namespace evpose {

/// Normal equations of parameters that do not change in time, S z = s.
struct ParameterInformation {
  Eigen::MatrixXd S = Eigen::MatrixXd(0, 0);
  Eigen::VectorXd s = Eigen::VectorXd(0);

  /// Room for n parameters; those added are not known at all.
  void grow(Eigen::Index n);
  void add(const ParameterInformation& other);
};

/// A quadratic cost y^T information y / 2 - vector^T y of y = (pose error, parameters), the parameters by
/// their numbers.
struct ChainMeasurement {
  Eigen::MatrixXd information;
  Eigen::VectorXd vector;
  std::vector<int> parameters;
};

/// Linear fixed-interval smoother of a chain of errors of the state, d_0, d_1, ..., with parameters z that do
/// not change. Forward it holds d = mean + by_parameters z +- covariance, so that no inverse of a process
/// noise is needed, and gathers what the innovations say of z. Backward it is the smoother of Rauch, Tung and
/// Striebel for any z.
class ChainSmoother {
 public:
  /// Forward, in order: start, then measure and move. The parameters are not known to it beforehand.
  void start(const Vector15d& mean, const Matrix15d& covariance);
  void measure(const ChainMeasurement& measurement);
  /// d_next = transition d + by_parameters z (its first columns) - offset, and noise.
  void move(const Matrix15d& transition, const Vector15d& offset, const Matrix15d& noise,
            const Eigen::Ref<const Eigen::MatrixXd>& by_parameters);

  std::size_t size() const { return knots_.size(); }
  /// What all measurements say of the parameters.
  const ParameterInformation& parameters();

  struct Smoothed {
    Vector15d mean;
    Matrix15d covariance;
  };
  /// The errors given all measurements, where the parameters are z with their covariance, or exactly z where
  /// that is empty.
  std::vector<Smoothed> smooth(const Eigen::VectorXd& z, const Eigen::MatrixXd& z_covariance) const;

 private:
  using ByParameters = Eigen::Matrix<double, 15, Eigen::Dynamic>;
  /// What is known of one state from all before it and itself, and how the next follows from it.
  struct Knot {
    Vector15d mean = Vector15d::Zero();
    Matrix15d covariance = Matrix15d::Zero();
    Eigen::Matrix<float, 15, Eigen::Dynamic> by_parameters{15, 0};
    // To the next.
    Matrix15d transition = Matrix15d::Zero(), predicted_covariance = Matrix15d::Zero();
    Vector15d offset = Vector15d::Zero();
    Eigen::MatrixXd moved_by_parameters{15, 0};
  };

  void grow(Eigen::Index n);
  void add_gathered();

  Vector15d mean_ = Vector15d::Zero();
  Matrix15d covariance_ = Matrix15d::Zero();
  ByParameters by_parameters_ = ByParameters(15, 0);
  ParameterInformation parameters_;
  // To be added to it: the product of the first rows of both.
  static constexpr Eigen::Index kGathered = 18 * 16;
  Eigen::MatrixXd left_ = Eigen::MatrixXd(kGathered, 0), right_ = left_;
  Eigen::Index gathered_ = 0;
  std::vector<Knot> knots_;
};

}  // namespace evpose
