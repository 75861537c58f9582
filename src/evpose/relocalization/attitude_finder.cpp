// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/relocalization/attitude_finder.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>

#include "evpose/core/pose.h"

namespace evpose {
namespace {

constexpr std::size_t kCompared = 16, kKept = 3;  // the right one is among the first three nearly always
constexpr double kSigmas = 2.5;                   // of the prior that are searched

}  // namespace

AttitudeFinder::AttitudeFinder(const ContourMap& map, const Camera& camera)
    : camera_(camera), directions_(main_directions(map)), lines_(camera.size()) {}

bool AttitudeFinder::suits(const Eigen::Matrix3d& covariance) {
  return covariance.diagonal().maxCoeff() > kSigma_rad * kSigma_rad;
}

std::vector<Eigen::Quaterniond> AttitudeFinder::find(std::span<const FilteredEvent> events,
                                                     const Eigen::Quaterniond& q_body_cam,
                                                     const Eigen::Quaterniond& prior_q_map_body,
                                                     const Eigen::Matrix3d& covariance) {
  AttitudePrior prior{prior_q_map_body.conjugate() * Eigen::Vector3d::UnitZ(), prior_q_map_body};
  prior.turned_within = kSigmas * std::sqrt(covariance.trace());
  std::vector<AttitudeGuess> guesses =
      search_attitude(lines_.find(events), camera_, q_body_cam, directions_, prior, kCompared);
  const Eigen::Matrix3d information = covariance.ldlt().solve(Eigen::Matrix3d::Identity());
  for (AttitudeGuess& g : guesses) {
    const Eigen::Vector3d off = so3::log(prior_q_map_body.conjugate() * g.q_map_body);
    g.score -= 0.5 * off.dot(information * off);
  }
  std::ranges::stable_sort(guesses, std::ranges::greater{}, &AttitudeGuess::score);
  std::vector<Eigen::Quaterniond> out;
  for (const AttitudeGuess& g : guesses)
    if (out.size() < kKept) out.push_back(g.q_map_body);
  return out;
}

}  // namespace evpose
