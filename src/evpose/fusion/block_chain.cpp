// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/block_chain.h"

#include <Eigen/Cholesky>

namespace evpose {
namespace {

/// Cholesky factorisation of a positive definite matrix scaled to unit diagonal: positions and biases differ
/// by many orders of magnitude.
class ScaledCholesky {
 public:
  explicit ScaledCholesky(const Matrix15d& m) {
    scale_ = m.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const Matrix15d scaled = scale_.asDiagonal() * m * scale_.asDiagonal();
    llt_.compute(scaled);
  }
  bool ok() const { return llt_.info() == Eigen::Success; }
  template <class Right>
  auto solve(const Right& right) const {
    return (scale_.asDiagonal() * llt_.solve(scale_.asDiagonal() * right)).eval();
  }

 private:
  Vector15d scale_;
  Eigen::LLT<Matrix15d> llt_;
};

}  // namespace

void BlockChain::resize(std::size_t states) {
  diagonal_.assign(states, Matrix15d::Zero());
  below_.assign(states, Matrix15d::Zero());
  vector_.assign(states, Vector15d::Zero());
}

bool BlockChain::eliminate() {
  marginal_ = diagonal_;
  reduced_ = vector_;
  for (std::size_t i = 1; i < size(); ++i) {
    const ScaledCholesky before(marginal_[i - 1]);
    if (!before.ok()) return false;
    const Matrix15d across = before.solve(below_[i].transpose().eval());
    marginal_[i] -= (below_[i] * across).eval();
    marginal_[i] = (0.5 * (marginal_[i] + marginal_[i].transpose())).eval();
    reduced_[i] -= across.transpose() * reduced_[i - 1];
  }
  return ScaledCholesky(marginal_.back()).ok();
}

void BlockChain::marginal(std::size_t i, Matrix15d* information, Vector15d* vector) const {
  *information = marginal_[i];
  *vector = reduced_[i];
}

std::vector<Vector15d> BlockChain::solve() const {
  std::vector<Vector15d> x(size());
  x.back() = ScaledCholesky(marginal_.back()).solve(reduced_.back());
  for (std::size_t i = size() - 1; i-- > 0;)
    x[i] = ScaledCholesky(marginal_[i]).solve((reduced_[i] - below_[i + 1].transpose() * x[i + 1]).eval());
  return x;
}

Matrix15d BlockChain::newest_covariance() const {
  const Matrix15d P = ScaledCholesky(marginal_.back()).solve(Matrix15d::Identity().eval());
  return 0.5 * (P + P.transpose());
}

}  // namespace evpose
