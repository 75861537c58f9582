// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_build/edge_profile_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "evpose/map_build/normal_table.h"

namespace evpose::map_build {
namespace {

constexpr int kGeometry = 4;  // place, slope, height, depth
constexpr int kSurfaces = 5;  // plane, face, under, beyond, rest
constexpr int kFirstRounds = 10, kMostRounds = 40;
constexpr double kFirstGain = 0.1, kNoGain = 1e-3;  // of log likelihood: rounds that gain less are the last
constexpr std::size_t kFewestPoints = 20;           // in a window
constexpr std::size_t kFirstPoints = 400, kMostPoints = 1200;  // first: to choose a start and a blur
constexpr double kLeastDepthNoise = 0.6;                       // shallower faces are none

using Densities = std::array<double, kSurfaces>;
using Vector = Eigen::Matrix<double, kGeometry, 1>;
using Matrix = Eigen::Matrix<double, kGeometry, kGeometry>;

/// Of points: across the edge within the plane, over it, and how the two go together. Ranges err along the
/// ray, so that seen askew a point is lifted and shifted at once.
struct Blur {
  double across_m = 0, up_m = 0, correlation = 0;
  double shear() const { return correlation * across_m / up_m; }  ///< metres across per metre up
  double lean() const { return correlation * up_m / across_m; }
  double end_across_m() const { return across_m * std::sqrt(1 - correlation * correlation); }
  double end_up_m() const { return up_m * std::sqrt(1 - correlation * correlation); }
};

struct State {
  Blur blur;
  int side = 0;
  bool ends = false;
  Vector geometry = Vector::Zero();
  Densities density{};
};

class EdgeProfile {
 public:
  EdgeProfile(std::span<const Eigen::Vector3d> points, const EdgeProfileWindow& window)
      : points_(points), window_(window) {}

  State initial_state(int side, bool ends, double depth, const Blur& blur) const;
  double log_likelihood(const State& s) const;
  double improve(State& s, int rounds, double no_gain) const;
  Matrix information(const State& s, Vector* gradient, Densities* shares) const;

 private:
  struct Shapes {
    std::array<double, kSurfaces> value;
    std::array<std::array<double, 3>, kSurfaces> slope;  ///< by place, height, depth
  };
  void shapes(const State& s, const Eigen::Vector3d& p, Shapes& out, bool with_slopes) const;
  /// Integrals of the shapes over the window, and their slopes.
  Shapes integrals(const State& s) const;

  std::span<const Eigen::Vector3d> points_;
  EdgeProfileWindow window_;
};

void EdgeProfile::shapes(const State& s, const Eigen::Vector3d& p, Shapes& out, bool with_slopes) const {
  const Normal& n = normal();
  const Blur& blur = s.blur;
  const double edge = s.geometry[0] + s.geometry[1] * p.x(), height = s.geometry[2];
  // Of a plane at some height: its density across it, and how far it reaches where noise has lifted a point.
  struct Half {
    double on, up, within, at_end;
  };
  const auto half = [&](double at) {
    const double up = (p.z() - at) / blur.up_m;
    const double across = (edge + blur.shear() * (p.z() - at) - p.y()) / blur.end_across_m();
    return Half{n.density(up) / blur.up_m, up / blur.up_m, n.below(across),
                n.density(across) / blur.end_across_m()};
  };
  const Half plane = half(height);
  out.value = {plane.within * plane.on, 0, 0, 0, 1};
  if (with_slopes) {
    out.slope = {};
    out.slope[0] = {plane.at_end * plane.on,
                    plane.on * (plane.within * plane.up - blur.shear() * plane.at_end), 0};
  }
  if (s.side == 0) return;
  const double off = (p.y() - edge) / blur.across_m, on_face = n.density(off) / blur.across_m;
  const double lift = blur.lean() * (p.y() - edge), far = height + s.side * s.geometry[3];
  const double near_at = (p.z() - height - lift) / blur.end_up_m(),
               far_at = (p.z() - far - lift) / blur.end_up_m();
  const double between = n.below(s.side * near_at) - (s.ends ? n.below(s.side * far_at) : 0);
  out.value[1] = on_face * between;
  const Half end = s.ends ? half(far) : Half{};
  out.value[2] = end.within * end.on;
  out.value[3] = (1 - end.within) * end.on;
  if (!with_slopes) return;
  const double near_end = n.density(near_at) / blur.end_up_m();
  const double far_end = s.ends ? n.density(far_at) / blur.end_up_m() : 0;
  out.slope[1] = {on_face * (off / blur.across_m * between + s.side * blur.lean() * (near_end - far_end)),
                  s.side * on_face * (far_end - near_end), on_face * far_end};
  const double by_height = end.on * (end.within * end.up - blur.shear() * end.at_end);
  out.slope[2] = {end.at_end * end.on, by_height, s.side * by_height};
  const double beyond = end.on * ((1 - end.within) * end.up + blur.shear() * end.at_end);
  out.slope[3] = {-end.at_end * end.on, beyond, s.side * beyond};
}

EdgeProfile::Shapes EdgeProfile::integrals(const State& s) const {
  const Normal& n = normal();
  const double across = s.blur.across_m, up = s.blur.up_m, length = 2 * window_.half_length;
  const double edge = s.geometry[0], width = window_.half_width, high = window_.half_height;
  const double filled = across * (n.ramp((edge + width) / across) - n.ramp((edge - width) / across));
  const double filled_slope = n.below((edge + width) / across) - n.below((edge - width) / across);
  Shapes out{};
  out.value[0] = length * filled;
  out.slope[0] = {length * filled_slope, 0, 0};
  out.value[4] = length * 4 * width * high;
  if (s.side == 0) return out;
  // In coordinates that count the face's side upwards.
  const double foot = s.side * s.geometry[2], far = s.ends ? foot + s.geometry[3] : high;
  const auto above = [&](double from) {  // of the window's height, blurred
    return up * (n.ramp((high - from) / up) - n.ramp((-high - from) / up));
  };
  out.value[1] = length * (above(foot) - (s.ends ? above(far) : 0));
  out.slope[1] = {0, s.ends ? 0.0 : -s.side * length, s.ends ? length : 0.0};
  if (!s.ends) return out;
  const double seen = n.below((high - far) / up) - n.below((-high - far) / up);
  out.value[2] = length * filled * seen;
  out.slope[2] = {length * filled_slope * seen, 0, 0};
  out.value[3] = length * (2 * width - filled) * seen;
  out.slope[3] = {-length * filled_slope * seen, 0, 0};
  return out;
}

State EdgeProfile::initial_state(int side, bool ends, double depth, const Blur& blur) const {
  State s;
  s.blur = blur;
  s.side = side;
  s.ends = ends;
  s.geometry[3] = depth;
  const Shapes whole = integrals(s);
  const auto all = static_cast<double>(points_.size());
  for (std::size_t k = 0; k < kSurfaces; ++k)
    s.density[k] = whole.value[k] > 0 ? (k == 4 ? 0.1 : 0.3) * all / whole.value[k] : 0;
  return s;
}

double EdgeProfile::log_likelihood(const State& s) const {
  const Shapes whole = integrals(s);
  double sum = -0.5 * std::pow(s.geometry[2] / window_.sigma_height_m, 2);
  for (std::size_t k = 0; k < kSurfaces; ++k) sum -= s.density[k] * whole.value[k];
  Shapes at;
  for (const auto& p : points_) {
    shapes(s, p, at, false);
    double density = 0;
    for (std::size_t k = 0; k < kSurfaces; ++k) density += s.density[k] * at.value[k];
    sum += std::log(std::max(density, 1e-300));
  }
  return sum;
}

Matrix EdgeProfile::information(const State& s, Vector* gradient, Densities* shares) const {
  const Shapes whole = integrals(s);
  Matrix out = Matrix::Zero();
  Vector uphill = Vector::Zero();
  shares->fill(0);
  for (std::size_t k = 0; k < kSurfaces; ++k) {
    uphill[0] -= s.density[k] * whole.slope[k][0];
    uphill[2] -= s.density[k] * whole.slope[k][1];
    uphill[3] -= s.density[k] * whole.slope[k][2];
  }
  Shapes at;
  for (const auto& p : points_) {
    shapes(s, p, at, true);
    double density = 1e-300;
    Vector j = Vector::Zero();
    for (std::size_t k = 0; k < kSurfaces; ++k) {
      density += s.density[k] * at.value[k];
      j[0] += s.density[k] * at.slope[k][0];
      j[2] += s.density[k] * at.slope[k][1];
      j[3] += s.density[k] * at.slope[k][2];
    }
    j /= density;
    j[1] = j[0] * p.x();
    uphill += j;
    out += j * j.transpose();
    for (std::size_t k = 0; k < kSurfaces; ++k) (*shares)[k] += s.density[k] * at.value[k] / density;
  }
  const double prior = 1 / (window_.sigma_height_m * window_.sigma_height_m);
  out(2, 2) += prior;
  uphill[2] -= prior * s.geometry[2];
  if (s.side == 0 || !s.ends) out(3, 3) += 1, uphill[3] = 0;
  *gradient = uphill;
  return out;
}

/// Rounds of expectation (densities) and Fisher scoring (geometry), only uphill.
double EdgeProfile::improve(State& s, int rounds, double no_gain) const {
  double likelihood = log_likelihood(s);
  const double noise = window_.noise_m;
  for (int round = 0; round < rounds; ++round) {
    Vector gradient;
    Densities shares;
    Matrix squares = information(s, &gradient, &shares);
    squares.diagonal().array() *= 1.05;
    squares.diagonal().array() += 1e-6;
    const Vector move = squares.ldlt().solve(gradient);
    State next = s;
    const Shapes whole = integrals(s);
    for (std::size_t k = 0; k < kSurfaces; ++k)
      next.density[k] = whole.value[k] > 0 ? std::max(shares[k], 1e-3) / whole.value[k] : 0;
    double gain = log_likelihood(next) - likelihood;
    if (gain >= 0) s = next, likelihood += gain;
    const double longest = std::max(
        {std::abs(move[0]), std::abs(move[1]) * window_.half_length, std::abs(move[2]), std::abs(move[3])});
    if (!(longest < 1)) break;
    double gained = std::max(gain, 0.0);
    for (double share = std::min(1.0, noise / std::max(longest, 1e-9)); share > 1e-2; share *= 0.4) {
      State moved = s;
      moved.geometry += share * move;
      if (std::abs(moved.geometry[0]) > 0.8 * window_.half_width || std::abs(moved.geometry[1]) > 0.3 ||
          std::abs(moved.geometry[2]) > 3 * noise)
        continue;
      if (s.ends &&
          (moved.geometry[3] < kLeastDepthNoise * noise || moved.geometry[3] > window_.half_height - noise))
        continue;
      gain = log_likelihood(moved) - likelihood;
      if (gain <= 0) continue;
      s = moved, likelihood += gain, gained += gain;
      break;
    }
    if (gained < no_gain) break;
  }
  return likelihood;
}

/// Every n-th point, so that there are no more than `most`.
std::vector<Eigen::Vector3d> thinned(const std::vector<Eigen::Vector3d>& points, std::size_t most) {
  if (points.size() <= most) return points;
  std::vector<Eigen::Vector3d> out;
  for (std::size_t k = 0, step = points.size() / most + 1; k < points.size(); k += step)
    out.push_back(points[k]);
  return out;
}

struct Tried {
  State state;
  double log_likelihood;
};

/// Fits to some of the points, to choose a start and a blur.
class Starts {
 public:
  Starts(std::span<const Eigen::Vector3d> some, const EdgeProfileWindow& window)
      : window_(window), profile_(some, window), even_{window.noise_m, window.height_noise_m, 0} {}

  Tried without_face() const { return improved(profile_.initial_state(0, false, 0, even_)); }
  Tried likeliest_face() const;
  /// Tries blurs of other widths, and such that lean with the height.
  void refine_blur(Tried& best) const;

 private:
  Tried improved(State state) const {
    const double likelihood = profile_.improve(state, kFirstRounds, kFirstGain);
    return {state, likelihood};
  }
  void try_blur(Tried& best, double across_m, double correlation) const;

  EdgeProfileWindow window_;
  EdgeProfile profile_;
  Blur even_;
};

Tried Starts::likeliest_face() const {
  std::vector<Tried> faces;
  for (const int side : {-1, 1}) {
    faces.push_back(improved(profile_.initial_state(side, false, window_.half_height, even_)));
    faces.push_back(improved(profile_.initial_state(side, true, 1.5 * window_.noise_m, even_)));
    faces.push_back(improved(profile_.initial_state(side, true, 0.55 * window_.half_height, even_)));
  }
  return *std::max_element(faces.begin(), faces.end(), [](const Tried& a, const Tried& b) {
    return a.log_likelihood < b.log_likelihood;
  });
}

void Starts::try_blur(Tried& best, double across_m, double correlation) const {
  State state = best.state;
  state.blur = {across_m, window_.height_noise_m, correlation};
  const Tried now = improved(state);
  if (now.log_likelihood > best.log_likelihood) best = now;
}

void Starts::refine_blur(Tried& best) const {
  for (const double across : {0.35, 0.7, 1.4}) try_blur(best, across * window_.noise_m, 0);
  for (const double correlation : {-0.6, 0.6}) try_blur(best, best.state.blur.across_m, correlation);
  const Blur rough = best.state.blur;
  const auto try_width = [&](double share, double correlation) {
    try_blur(best, std::min(share * rough.across_m, 1.4 * window_.noise_m), correlation);
  };
  for (const double share : {0.7, 1.4}) try_width(share, rough.correlation);
  // Of one ray they go together but for rounding, of rays from all sides not at all.
  if (rough.correlation != 0)
    for (const double share : {0.7, 0.85, 1.0, 1.2, 1.4})
      try_width(share, std::copysign(0.97, rough.correlation));
}

/// `gain`: of log likelihood over a plane without a second face.
EdgeProfileFit as_fit(const EdgeProfile& profile, const Tried& best, double gain, std::size_t points,
                      const EdgeProfileWindow& window) {
  const State& s = best.state;
  Vector gradient;
  Densities shares;
  const Matrix covariance = profile.information(s, &gradient, &shares).inverse();
  EdgeProfileFit out;
  if (!covariance.allFinite()) return out;  // of what these points tell nothing about
  out.place = s.geometry[0];
  out.slope = s.geometry[1];
  out.height = s.geometry[2];
  out.side = s.side;
  out.ends = s.ends;
  out.depth = s.ends ? s.geometry[3] : window.half_height;
  out.plane = s.density[0];
  out.face = s.density[1];
  out.under = s.density[2];
  out.beyond = s.density[3];
  out.rest = s.density[4];
  out.sigma_place = std::sqrt(std::max(covariance(0, 0), 0.0));
  out.sigma_height = std::sqrt(std::max(covariance(2, 2), 0.0));
  out.sigma_depth = std::sqrt(std::max(covariance(3, 3), 0.0));
  out.log_likelihood = best.log_likelihood;
  out.gain = std::max(gain, 0.0);
  out.across_m = s.blur.across_m;
  out.correlation = s.blur.correlation;
  out.rest_share = shares[4] / static_cast<double>(points);
  return out;
}

}  // namespace

EdgeProfileWindow edge_profile_window(double half_length, double noise_m, double rms_m, double spacing_m) {
  constexpr double kReach = 3;         // noise
  constexpr double kBand_m = 0.03;     // beyond that, for faces to be seen in, at least
  constexpr double kBandSpacings = 2;  // spacings: the same, where that is more
  constexpr double kOffPlane = 0.4;    // noise: so far a plane may lie off its surface at an edge
  EdgeProfileWindow out{};
  out.half_length = half_length;
  out.half_width = kReach * noise_m + kBand_m;
  out.half_height = kReach * noise_m + std::max(kBand_m, kBandSpacings * spacing_m);
  out.noise_m = noise_m;
  out.height_noise_m = std::clamp(rms_m, 0.3 * noise_m, 1.5 * noise_m);
  out.sigma_height_m = kOffPlane * noise_m;
  return out;
}

EdgeProfileFit fit_edge_profile(std::span<const Eigen::Vector3d> all, const EdgeProfileWindow& window) {
  std::vector<Eigen::Vector3d> points;
  for (const auto& p : all)
    if (std::abs(p.y()) <= window.half_width && std::abs(p.z()) <= window.half_height) points.push_back(p);
  points = thinned(points, kMostPoints);
  if (points.size() < kFewestPoints) return {};
  const std::vector<Eigen::Vector3d> some = thinned(points, kFirstPoints);
  const EdgeProfile profile(points, window);
  const Starts starts(some, window);
  std::array<Tried, 2> tried = {starts.without_face(), starts.likeliest_face()};
  for (Tried& best : tried) {
    starts.refine_blur(best);
    for (double& density : best.state.density)
      density *= static_cast<double>(points.size()) / static_cast<double>(some.size());
    best.log_likelihood = profile.improve(best.state, kMostRounds, kNoGain);
  }
  const double gain = tried[1].log_likelihood - tried[0].log_likelihood;
  return as_fit(profile, tried[gain > 0 ? 1 : 0], gain, points.size(), window);
}

}  // namespace evpose::map_build
