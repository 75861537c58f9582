// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/eval/measures.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace evpose {
namespace {

constexpr double kDegPerRad = 180 / std::numbers::pi;

std::size_t first_not_before(std::span<const ErrorSample> samples, TimeNs t) {
  return static_cast<std::size_t>(
      std::lower_bound(samples.begin(), samples.end(), t,
                       [](const ErrorSample& s, TimeNs time) { return s.t < time; }) -
      samples.begin());
}

/// Mean over pairs of samples (i, j) of how the motion from i to j differs from the true one.
class RelativeMean {
 public:
  void add(const ErrorSample& i, const ErrorSample& j) {
    const Pose estimated = i.estimate.inverse() * j.estimate;
    const Pose truth = i.truth.inverse() * j.truth;
    translation_m_ += (estimated.p - truth.p).norm();
    rotation_rad_ += so3::log(truth.q.conjugate() * estimated.q).norm();
    ++count_;
  }
  std::optional<RelativeError> mean() const {
    if (count_ == 0) return std::nullopt;
    return RelativeError{1e3 * translation_m_ / count_, kDegPerRad * rotation_rad_ / count_};
  }

 private:
  double translation_m_ = 0, rotation_rad_ = 0;
  int count_ = 0;
};

}  // namespace

Coverage coverage_of(std::span<const ErrorSample> samples, TimeNs from, TimeNs to) {
  constexpr TimeNs kStep = 10 * kNsPerMs, kReach = 20 * kNsPerMs;
  Coverage out;
  const std::int64_t instants = from < to ? (to - from - 1) / kStep + 1 : 0;
  std::int64_t lost = 0;
  const auto lose = [&](std::int64_t first, std::int64_t end) {
    end = std::min(end, instants);
    if (first >= end) return;
    lost += end - first;
    out.lost.push_back({from + first * kStep, std::min(from + end * kStep, to)});
  };
  // From sample to sample, so that the work does not follow the length of the span.
  std::int64_t next = 0;  // first instant not yet judged
  for (const ErrorSample& s : samples) {
    if (s.t + kReach < from) continue;
    lose(next, (s.t - kReach - from + kStep - 1) / kStep);
    next = std::max(next, (s.t + kReach - from) / kStep + 1);
  }
  lose(next, instants);
  if (instants > 0) out.share = 1 - static_cast<double>(lost) / static_cast<double>(instants);
  return out;
}

std::optional<RelativeError> relative_over_time(std::span<const ErrorSample> samples, TimeNs span) {
  RelativeMean mean;
  for (std::size_t i = 0; i + 1 < samples.size(); ++i) {
    const TimeNs target = samples[i].t + span;
    std::size_t j = std::clamp<std::size_t>(first_not_before(samples, target), 1, samples.size() - 1);
    if (std::abs(samples[j - 1].t - target) < std::abs(samples[j].t - target)) --j;
    const auto off_by = static_cast<double>(std::abs(samples[j].t - target));
    if (j > i && off_by < 0.3 * static_cast<double>(span)) mean.add(samples[i], samples[j]);
  }
  return mean.mean();
}

std::optional<RelativeError> relative_over_path(std::span<const ErrorSample> samples, double length_m) {
  std::vector<double> path_m(samples.size(), 0.0);
  for (std::size_t i = 1; i < samples.size(); ++i)
    path_m[i] = path_m[i - 1] + (samples[i].truth.p - samples[i - 1].truth.p).norm();
  RelativeMean mean;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto end = std::lower_bound(path_m.begin(), path_m.end(), path_m[i] + length_m);
    if (end == path_m.end()) break;
    mean.add(samples[i], samples[static_cast<std::size_t>(end - path_m.begin())]);
  }
  return mean.mean();
}

std::optional<Lag> lag_of(std::span<const ErrorSample> samples) {
  constexpr TimeNs kBlock = kNsPerS / 2;
  double velocity_error = 0, velocity_velocity = 0;
  for (const ErrorSample& s : samples) {
    velocity_error += s.position_error.dot(s.true_velocity);
    velocity_velocity += s.true_velocity.squaredNorm();
  }
  if (samples.empty() || velocity_velocity < 1e-12) return std::nullopt;
  const double lag_s = -velocity_error / velocity_velocity;

  double sum_of_squares = 0, block_sum = 0;
  int blocks = 0;
  TimeNs block_end = samples.front().t + kBlock;
  const auto close_block = [&] {
    sum_of_squares += block_sum * block_sum;
    block_sum = 0;
    ++blocks;
  };
  for (const ErrorSample& s : samples) {
    if (s.t >= block_end) {
      close_block();
      block_end = s.t + kBlock;
    }
    block_sum += s.true_velocity.dot(s.position_error + lag_s * s.true_velocity);
  }
  close_block();
  Lag lag{1e3 * lag_s, std::nullopt};
  if (blocks > 1)
    lag.standard_error_ms = 1e3 * std::sqrt(sum_of_squares * blocks / (blocks - 1)) / velocity_velocity;
  return lag;
}

std::optional<double> jitter(std::span<const ErrorSample> samples) {
  double sum = 0;
  int count = 0;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    if (samples[i].index != samples[i - 1].index + 1) continue;
    sum += (samples[i].position_error - samples[i - 1].position_error).squaredNorm();
    ++count;
  }
  if (count == 0) return std::nullopt;
  return 1e3 * std::sqrt(sum / count);
}

std::optional<double> along_motion(std::span<const ErrorSample> samples,
                                   std::span<const double> pixels_per_metre) {
  constexpr double kSlowest_m_s = 0.02;  // below, the direction of motion is noise
  double sum_px = 0;
  int count = 0;
  for (const ErrorSample& s : samples) {
    const double speed = s.true_velocity.norm();
    if (speed < kSlowest_m_s) continue;
    sum_px += pixels_per_metre[s.index] * s.position_error.dot(s.true_velocity) / speed;
    ++count;
  }
  if (count == 0) return std::nullopt;
  return sum_px / count;
}

namespace {

/// Squared error over its variance in the direction of the largest variance.
double weakest(const Eigen::Matrix3d& covariance, const Eigen::Vector3d& error) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(covariance);
  return std::pow(error.dot(eigen.eigenvectors().col(2)), 2) / eigen.eigenvalues()(2);
}

/// Adds what one pose says; position errors are turned into the body's axes.
void add_directions(const Matrix6d& covariance, const Vector6d& error, const Eigen::Matrix3d& R_map_body,
                    DirectionNees* sum) {
  const Eigen::Matrix3d P = R_map_body.transpose() * covariance.topLeftCorner<3, 3>() * R_map_body,
                        Q = covariance.bottomRightCorner<3, 3>();
  const Eigen::Vector3d p = R_map_body.transpose() * error.head<3>(), phi = error.tail<3>();
  sum->position += p.cwiseAbs2().cwiseQuotient(P.diagonal());
  sum->rotation += phi.cwiseAbs2().cwiseQuotient(Q.diagonal());
  sum->weakest_position += weakest(P, p);
  sum->weakest_rotation += weakest(Q, phi);
}

DirectionNees divided(DirectionNees sum, double count) {
  sum.position /= count, sum.rotation /= count;
  sum.weakest_position /= count, sum.weakest_rotation /= count;
  return sum;
}

}  // namespace

std::optional<Consistency> consistency(std::span<const ErrorSample> samples,
                                       std::span<const Matrix6d> covariances, const Similarity& alignment) {
  constexpr double kBandLow = 1.237344, kBandHigh = 14.449375;  // 2.5 % and 97.5 % of chi-square, 6 degrees
  double sum = 0;
  DirectionNees directions;
  int count = 0, in_band = 0;
  for (const ErrorSample& s : samples) {
    const Matrix6d P = alignment.covariance(covariances[s.index]);
    const Eigen::LLT<Matrix6d> factor(P);
    if (factor.info() != Eigen::Success) continue;
    const Vector6d d = s.truth.minus(s.estimate);
    const double nees = factor.matrixL().solve(d).squaredNorm();
    sum += nees;
    in_band += nees >= kBandLow && nees <= kBandHigh;
    add_directions(P, d, s.estimate.q.toRotationMatrix(), &directions);
    ++count;
  }
  if (count == 0) return std::nullopt;
  return Consistency{sum / count / 6, static_cast<double>(in_band) / count, divided(directions, count)};
}

}  // namespace evpose
