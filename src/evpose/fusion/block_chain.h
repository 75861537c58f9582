// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/fusion/state.h"

namespace evpose {

/// Normal equations of a chain of states, H x = b, where each state shares factors with its neighbours only:
/// H is block-tridiagonal. Solved by block elimination from the oldest to the newest.
class BlockChain {
 public:
  void resize(std::size_t states);  ///< and sets all to zero
  std::size_t size() const { return diagonal_.size(); }

  Matrix15d& diagonal(std::size_t i) { return diagonal_[i]; }
  /// H of (i, i - 1), i > 0.
  Matrix15d& below(std::size_t i) { return below_[i]; }
  Vector15d& vector(std::size_t i) { return vector_[i]; }

  /// What is known of state i from all before it and itself; later states are not looked at (Schur
  /// complement). False if H is not positive definite. Needed by the next two.
  bool eliminate();
  void marginal(std::size_t i, Matrix15d* information, Vector15d* vector) const;
  /// The solution, one vector for each state.
  std::vector<Vector15d> solve() const;
  /// Covariance of the newest state.
  Matrix15d newest_covariance() const;

 private:
  std::vector<Matrix15d> diagonal_, below_;
  std::vector<Vector15d> vector_;
  std::vector<Matrix15d> marginal_;  ///< after elimination
  std::vector<Vector15d> reduced_;
};

}  // namespace evpose
