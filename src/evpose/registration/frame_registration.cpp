// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/frame_registration.h"

#include <algorithm>
#include <cmath>

#include "evpose/registration/rearranged.h"

namespace evpose {
namespace {

// Search across a contour.
constexpr double kStep_px = 0.5;  // along the normal
constexpr int kLines = 5;         // beside each other, averaged
constexpr double kSoft_px = 1.5;  // half width of the edge filter for an edge at rest
constexpr double kGate_px = 1.5;  // joined with three sigma of the pose and two of the map
constexpr double kLargestGate_px = 5;
constexpr double kLargestBlur_px = 30;  // a wider one tells nothing
constexpr double kSureNoise = 5;        // sigma of the filtered noise that an edge rises above
constexpr double kLeastContrast = 0.1;  // of the luminance on both sides; less is texture
constexpr double kSaturated = 0.98;     // from here on an edge is moved by what is cut off
constexpr double kRival = 0.6;  // of the strongest: a second edge so strong makes it unclear which it is

// Errors of an edge, 1 sigma; docs/decisions/tracking.md has what they were chosen on.
constexpr double kEdgeSigma_px = 0.1;     // its own: pixels, texture beside it
constexpr double kSharedSigma_px = 0.06;  // that edges of a cell and direction share
// Light and shade beside an edge move it the more the weaker it is: a slope of the luminance, as a share of
// it, over the edge's own step.
constexpr double kShade_px = 0.1;
constexpr double kOfBlur = 0.12;        // of both, by the width of the blur
constexpr double kShared_s = 1;         // how long a shared error lasts
constexpr double kEdgePrior = 0.7;      // an edge in the gate is the contour's rather than texture
constexpr double kFollowsGain = 0.2;    // of one frame
constexpr double kLeastFollows = 0.15;  // keeps corrections finite
constexpr int kCellsPerWidth = 20;

// Signs of contrast.
constexpr float kSignKeeps = 0.9F;  // of what earlier frames told, from frame to frame
constexpr float kSureSign = 2.5F;
constexpr float kSignOfMap = 4;

// Agreement of a frame with the pose.
constexpr int kEnoughEdges = 30;
constexpr double kFoundShare = 0.25;    // of the contours have an edge
constexpr double kConcentration = 0.3;  // 1: all edges at the contours, 0: evenly over the gates

double square(double x) { return x * x; }

}  // namespace

FrameRegistration::FrameRegistration(ImageSize size, const FrameCamera& camera,
                                     std::span<const int> map_contrast)
    : size_(size), camera_(camera), image_(camera.gamma) {
  for (const int sign : map_contrast) signs_.push_back(kSignOfMap * static_cast<float>(sign));
}

int FrameRegistration::contrast(std::uint32_t segment) const {
  const float sum = signs_[segment];
  return std::abs(sum) < kSureSign ? 0 : (sum > 0 ? 1 : -1);
}

void FrameRegistration::rearrange_segments(std::span<const std::uint32_t> before,
                                           std::span<const int> map_contrast) {
  std::vector<float> now(before.size());
  for (std::size_t i = 0; i < before.size(); ++i)
    now[i] = before[i] == kNewSegment ? kSignOfMap * static_cast<float>(map_contrast[i]) : signs_[before[i]];
  signs_ = std::move(now);
}

/// From the sample along its normal to where its contour is expected when its row is exposed.
double FrameRegistration::expected_offset_px(const FrameProblem& p, const ContourSample& s) const {
  const double row = s.pixel.y() - 0.5 * (size_.height - 1);
  const double age_s = p.age_s - row * camera_.row_time_s;
  return -s.speed_px_s * age_s + s.curvature_px_s2 * square(age_s) - s.jacobian.dot(p.forecast.pose) +
         age_s * s.jacobian.head<3>().dot(p.forecast.velocity);
}

/// Luminance along the normal around `offset_px` from the sample, `half` steps to each side, averaged along
/// the contour and summed up; false where that leaves the image.
bool FrameRegistration::sum_profile(const ContourSample& s, double offset_px, int half) {
  const Eigen::Vector2d centre = s.pixel + offset_px * s.normal_px;
  const Eigen::Vector2d along(-s.normal_px.y(), s.normal_px.x());
  for (const double side : {-1.0, 1.0})
    for (const int end : {-half, half})
      if (!image_.contains(centre + end * kStep_px * s.normal_px + side * 0.5 * (kLines - 1) * along))
        return false;

  profile_.assign(static_cast<std::size_t>(2 * half + 1) + 1, 0);  // summed up, with a 0 in front
  for (int k = -half; k <= half; ++k) {
    double sum = 0;
    for (int line = 0; line < kLines; ++line)
      sum += image_.at(centre + k * kStep_px * s.normal_px + (line - 0.5 * (kLines - 1)) * along);
    const auto i = static_cast<std::size_t>(k + half);
    profile_[i + 1] = profile_[i] + sum / kLines;
  }
  return true;
}

/// The one clear edge within the gate, of the sign that the contour is known to have.
std::optional<FrameRegistration::Edge> FrameRegistration::find_edge(const FrameProblem& p,
                                                                    std::size_t sample) {
  const ContourSample& s = p.samples[sample];
  const double blur_px = std::abs(s.speed_px_s) * to_seconds(p.frame.exposure);
  if (blur_px > kLargestBlur_px) return {};
  const double pose_variance = std::max(0.0, s.jacobian.dot(p.pose_covariance * s.jacobian));
  const double gate_px =
      std::min(kLargestGate_px, std::sqrt(square(kGate_px) + 9 * pose_variance + 4 * square(s.map_sigma_px)));
  const int window = static_cast<int>(std::lround((kSoft_px + 0.5 * blur_px) / kStep_px));
  const int reach = static_cast<int>(std::ceil(gate_px / kStep_px)) + 1;
  const int half = reach + window;
  if (!sum_profile(s, expected_offset_px(p, s), half)) return {};
  const auto mean = [&](int from, int to) {  // of the places from..to, both included
    return (profile_[static_cast<std::size_t>(to + half) + 1] -
            profile_[static_cast<std::size_t>(from + half)]) /
           (to - from + 1);
  };
  response_.resize(static_cast<std::size_t>(2 * reach + 1));
  const auto response = [&](int k) -> double& { return response_[static_cast<std::size_t>(k + reach)]; };
  for (int k = -reach; k <= reach; ++k) response(k) = mean(k + 1, k + window) - mean(k - window, k - 1);

  int best = 0, others = 0;
  double most = 0, rival = 0;
  const int known = contrast(s.segment) * s.normal_side;
  for (int k = -reach + 1; k < reach; ++k) {
    const double r = response(k), size = std::abs(r);
    if (size < std::abs(response(k - 1)) || size <= std::abs(response(k + 1))) continue;
    if (known != 0 && r * known < 0) continue;
    ++others;
    if (size > most) {
      rival = most, most = size, best = k;
    } else {
      rival = std::max(rival, size);
    }
  }
  if (others == 0 || rival > kRival * most) return {};
  for (int k = best - window; k <= best + window; ++k)
    if (mean(k, k) > kSaturated) return {};
  const double level = mean(best - window, best + window), noise = image_.noise(level);
  const double averaged = kLines * (window * kStep_px);  // pixels on each side
  if (most < kSureNoise * noise * std::sqrt(2 / averaged) || most < kLeastContrast * level) return {};
  const double before = std::abs(response(best - 1)), after = std::abs(response(best + 1));
  const double bend = before - 2 * most + after;
  const double part = bend < 0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0;
  const double offset_px = (best + part) * kStep_px;
  if (std::abs(offset_px) > gate_px) return {};
  const double shared =
      square(kSharedSigma_px) + square(kOfBlur * blur_px) + square(kShade_px * level / most);
  // Of a step whose slope is as wide as the blur, in white noise.
  const double noise_px = noise / most * std::sqrt((blur_px + 2 * kSoft_px) / kLines);
  return Edge{sample, offset_px, gate_px,    square(kEdgeSigma_px) + square(noise_px) + shared,
              shared, 0,         cell_of(s), response(best) > 0};
}

/// The contour's edge or texture, which lies evenly over the gate.
void FrameRegistration::weigh(const FrameProblem& p, Edge& edge) const {
  const ContourSample& s = p.samples[edge.sample];
  const double variance =
      edge.variance + square(s.map_sigma_px) + std::max(0.0, s.jacobian.dot(p.pose_covariance * s.jacobian));
  const double odds = kEdgePrior / (1 - kEdgePrior) * 2 * edge.gate_px / std::sqrt(2 * M_PI * variance) *
                      std::exp(-0.5 * square(edge.offset_px) / variance);
  edge.weight = odds / (1 + odds);
  edge.slope = edge.weight - edge.weight * (1 - edge.weight) * square(edge.offset_px) / variance;
}

void FrameRegistration::learn_contrast(const FrameProblem& p) {
  for (const Edge& edge : edges_) {
    const ContourSample& s = p.samples[edge.sample];
    float& sum = signs_[s.segment];
    const bool brighter_at_normal = edge.brighter_ahead == (s.normal_side > 0);
    const auto share = static_cast<float>(0.1 * edge.weight);
    sum = std::clamp(sum + (brighter_at_normal ? share : -share), -kSignOfMap, kSignOfMap);
  }
}

std::uint32_t FrameRegistration::cell_of(const ContourSample& s) const {
  const int cell = std::max(8, size_.width / kCellsPerWidth);
  const int columns = size_.width / cell + 1, rows = size_.height / cell + 1;
  const int cx = std::clamp(static_cast<int>(s.pixel.x()) / cell, 0, columns - 1);
  const int cy = std::clamp(static_cast<int>(s.pixel.y()) / cell, 0, rows - 1);
  const double turn = std::atan2(s.normal_px.y(), s.normal_px.x());  // modulo pi, in four parts
  const int bin = static_cast<int>(std::floor(4 * turn / M_PI) + 4) % 4;
  return static_cast<std::uint32_t>((cy * columns + cx) * 4 + bin);
}

void FrameRegistration::sum_clusters(const FrameProblem& p) {
  clusters_.clear();
  for (const Edge& edge : edges_) {
    if (edge.cell >= clusters_.size()) clusters_.resize(edge.cell + 1);
    Cluster& c = clusters_[edge.cell];
    const double information = edge.weight / edge.variance;
    c.information += information;
    c.map_variance += information * square(p.samples[edge.sample].map_sigma_px);
    c.shared_variance += information * edge.shared_variance;
  }
}

/// Normal equations over the edges; the information of a cluster is capped by the error that it shares.
void FrameRegistration::sum_information(const FrameProblem& p, RegistrationResult& result) {
  const double repeats = FrameRegistration::repeats(p.since_last_s);
  double weights = 0, squares = 0, slopes = 0;
  for (const Edge& edge : edges_) weights += edge.weight, slopes += edge.slope;
  const double follows = follows_;
  // For the next frame: at a pose that is off as a whole, one alone would take its edges for texture.
  if (weights > 0) follows_ += kFollowsGain * (std::clamp(slopes / weights, kLeastFollows, 1.0) - follows_);
  offsets_.clear();
  for (const Edge& edge : edges_) {
    const Cluster& c = clusters_[edge.cell];
    if (!(c.information > 0) || !(edge.weight > 0)) continue;
    const double shared = repeats * (c.shared_variance + c.map_variance) / c.information;
    const double weight = edge.weight / edge.variance / (1 + shared * c.information);
    const Vector6d& J = p.samples[edge.sample].jacobian;
    result.information.selfadjointView<Eigen::Lower>().rankUpdate(J, follows * weight);
    result.vector -= weight * edge.offset_px * J;
    offsets_.push_back({edge.sample, -edge.offset_px / follows, follows * weight});
    squares += edge.weight * square(edge.offset_px);
  }
  result.information.triangularView<Eigen::StrictlyUpper>() = result.information.transpose();
  result.residual = weights > 0 ? std::sqrt(squares / weights) : 0;
  result.inliers = static_cast<int>(offsets_.size());
}

double FrameRegistration::repeats(double since_last_s) {
  return std::max(1.0, kShared_s / std::max(since_last_s, 1e-3));
}

void FrameRegistration::judge(RegistrationResult& result) {
  double spread = 0;
  for (const Edge& edge : edges_) spread += square(edge.offset_px / edge.gate_px);
  const auto count = static_cast<double>(edges_.size());
  const bool enough = edges_.size() >= kEnoughEdges;
  result.gate_concentration = enough ? std::clamp(1 - 3 * spread / count, 0.0, 1.0) : 0;
  agrees_ = enough && count > kFoundShare * result.points && result.gate_concentration > kConcentration;
}

RegistrationResult FrameRegistration::measure(const FrameProblem& p) {
  EVPOSE_CHECK(p.frame.size == size_);
  image_.set(p.frame);
  RegistrationResult result;
  edges_.clear();
  for (std::size_t i = 0; i < p.samples.size(); ++i) {
    auto edge = find_edge(p, i);
    if (!edge) continue;
    weigh(p, *edge);
    edges_.push_back(*edge);
  }
  for (float& sum : signs_) sum *= std::abs(sum) < kSureSign ? kSignKeeps : 1;
  learn_contrast(p);
  sum_clusters(p);
  result.points = static_cast<int>(p.samples.size());
  sum_information(p, result);
  judge(result);
  return result;
}

}  // namespace evpose
