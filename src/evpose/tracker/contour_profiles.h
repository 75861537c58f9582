// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/event/event_preprocessor.h"
#include "evpose/registration/contour_view.h"

namespace evpose {

/// How many events lie at each distance across each contour sample, within a reach. Where the samples are off
/// by several pixels, and not all by the same motion, this shows what each displacement would gather without
/// associating anything.
class ContourProfiles {
 public:
  ContourProfiles(ImageSize size, std::size_t samples, double reach_px);

  /// Adds the events of the last `span_s` before `now_us`. `slots`: the profile of each sample; samples as
  /// they are at now_us.
  void add(std::span<const FilteredEvent> events, std::uint32_t now_us, double span_s,
           std::span<const ContourSample> samples, std::span<const std::uint32_t> slots);
  /// After the last add(): what the counts say for each distance, a logarithm of their ratio to the mean.
  void finish();

  /// Sum over the samples that are displaced by `px` each, along their normals.
  double score(const Eigen::Ref<const Eigen::VectorXd>& px) const;
  std::size_t samples() const { return static_cast<std::size_t>(profiles_.cols()); }

 private:
  void add_slice(std::span<const ContourSample> samples, std::span<const std::uint32_t> slots, double age_s);

  ImageSize size_;
  int reach_;  ///< bins to each side
  std::vector<std::uint8_t> image_;
  Eigen::MatrixXf profiles_;  ///< a column for each sample
};

/// Displacements of the samples are rows * z with z of unit normal distribution. Those z, most plausible
/// first, at which samples gather most events, each different from the others by a pixel (root mean square);
/// at most `most`. Deterministic.
std::vector<Eigen::VectorXd> most_gathering(const ContourProfiles& profiles, const Eigen::MatrixXd& rows_px,
                                            std::size_t most);

}  // namespace evpose
