// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

namespace evpose {

/// Every so many-th of a sequence whose length is not known beforehand. How many are left out between two
/// depends on the length alone, and is the least that keeps at most `most`; it is a power of two.
template <class T>
class Thinned {
 public:
  explicit Thinned(std::size_t most) : most_(most) {}

  void add(const T& value) {
    const std::size_t number = count_++;
    if (number % stride_ != 0) return;
    if (kept_.size() == most_) {
      for (std::size_t k = 0; 2 * k < most_; ++k) kept_[k] = kept_[2 * k];
      kept_.resize((most_ + 1) / 2);
      stride_ *= 2;
      if (number % stride_ != 0) return;
    }
    kept_.push_back(value);
  }

  const std::vector<T>& kept() const { return kept_; }
  std::size_t count() const { return count_; }    ///< of all that were added
  std::size_t stride() const { return stride_; }  ///< from one that is kept to the next

 private:
  std::size_t most_, count_ = 0, stride_ = 1;
  std::vector<T> kept_;
};

}  // namespace evpose
