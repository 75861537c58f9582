// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/relocalization/wide_search.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/keep_different.h"
#include "evpose/registration/coarse_ranking.h"
#include "evpose/relocalization/place_search.h"

namespace evpose {
namespace {

constexpr std::size_t kAttitudes = 16;
constexpr std::size_t kPlaces = 400;  // of all attitudes together
constexpr std::size_t kRefined = 48;  // of the different ones among these
constexpr std::size_t kKept = 16;
constexpr double kSigmas = 2.5;          // of the prior that are searched
constexpr double kPlaceKnown_m = 30;     // with a larger sigma the prior's place tells nothing
constexpr double kBeforeContours_m = 1;  // around the prior's place, outside of the contours' box
constexpr double kDifferent_m = 0.15, kDifferent_rad = 0.1;  // before refinement
constexpr double kSame_m = 0.03, kSame_rad = 0.015;          // after it
constexpr double kAttitudeSigma_rad = 0.02;                  // of an attitude by lines
constexpr double kPlaceSigma = 0.15;                         // of a position among places, in edges of these
constexpr double kLastReach_px = 3;
constexpr double kAbove_rad = 0.35;                   // in the image, 1 sigma
constexpr double kBeside_m = 0.5, kBesideSigmas = 1;  // of the first prior, places are known, too
constexpr double kReach = 0.03;                       // of the first refinement, tangent units
constexpr std::size_t kComparedPoints = 500;          // at most, in the first refinement
constexpr double kNearest_m = 0.2;                    // from the camera

VisibleSetConfig points_to_refine(VisibleSetConfig config) {
  config.stride_px = 8;
  config.margin_px = 40;
  config.budget = 700;
  config.refresh_px = 0;  // chosen anew for each pose
  return config;
}

/// Poses nearer than these are one.
auto nearer_than(double apart_m, double apart_rad) {
  return [=](const PoseGuess& a, const PoseGuess& b) {
    return (b.T_map_body.p - a.T_map_body.p).norm() < apart_m &&
           b.T_map_body.q.angularDistance(a.T_map_body.q) < apart_rad;
  };
}

}  // namespace

bool WideSearch::suits(const Matrix6d& covariance) {
  const Eigen::Vector3d p = covariance.diagonal().head<3>(), r = covariance.diagonal().tail<3>();
  return std::sqrt(p.maxCoeff()) / kTypicalDepth_m + std::sqrt(r.maxCoeff()) > kAbove_rad;
}

WideSearch::WideSearch(const ContourIndex& index, const Camera& camera, const VisibleSetConfig& visible,
                       PlaceCache& places)
    : index_(index),
      camera_(camera),
      visible_config_(visible),
      space_(space_around(index.map())),
      directions_(main_directions(index.map())),
      line_finder_(camera.size()),
      visible_(index, camera, points_to_refine(visible)),
      cache_(places) {}

/// Where the camera may be: among the contours, or before them if the prior has it there.
Eigen::AlignedBox3d WideSearch::box(const WidePrior& prior) const {
  const Eigen::Vector3d sigma = prior.covariance.diagonal().head<3>().cwiseSqrt();
  const Eigen::Vector3d& p = prior.T_map_body.p;
  Eigen::AlignedBox3d space = space_;
  if (sigma.maxCoeff() < kPlaceKnown_m) {
    const Eigen::Vector3d near = sigma.cwiseMin(kBeforeContours_m);
    space.extend(p - near);
    space.extend(p + near);
  }
  return space.intersection(Eigen::AlignedBox3d(p - kSigmas * sigma, p + kSigmas * sigma));
}

void WideSearch::prepare(const WidePrior& prior) {
  const Eigen::AlignedBox3d wanted = box(prior);
  if (wanted.isEmpty() || (places_ && places_box_.contains(wanted))) return;
  // The prior widens with time.
  const Eigen::Vector3d beside =
      kBesideSigmas * prior.covariance.diagonal().head<3>().cwiseSqrt().array() + kBeside_m;
  Eigen::AlignedBox3d space = space_;
  space.extend(wanted);
  places_box_ = space.intersection(Eigen::AlignedBox3d(wanted.min() - beside, wanted.max() + beside));
  places_ = cache_.over(index_, visible_config_, places_box_);
}

/// What can be seen from the middle of the place that the camera is in: looking at what hides contours from
/// each of many poses takes most of a search's time.
void WideSearch::see_from_nearest_place(const Pose& T_map_cam) {
  const auto distance = [&](const PlaceIndex::Place& p) { return (p.middle - T_map_cam.p).squaredNorm(); };
  const PlaceIndex::Place& place = *std::ranges::min_element(places_->places(), {}, distance);
  const Eigen::Vector2d half = half_view(camera_);
  const Eigen::Matrix3d R_cam_map = T_map_cam.rotation().transpose();
  points_.clear();
  for (const int direction :
       PlaceIndex::directions_around(T_map_cam.q * Eigen::Vector3d::UnitZ(), std::atan(half.norm()))) {
    for (const std::uint32_t number : places_->seen_from(place, direction)) {
      const PlaceIndex::Sample& sample = places_->sample(number);
      const Eigen::Vector3d position = places_->anchor() + sample.position.cast<double>();
      const Eigen::Vector3d x = R_cam_map * (position - T_map_cam.p);
      if (x.z() > kNearest_m && std::abs(x.x()) < half.x() * x.z() && std::abs(x.y()) < half.y() * x.z())
        points_.push_back({position, sample.tangent.cast<double>()});
    }
  }
  const std::size_t step = points_.size() / kComparedPoints + 1;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < points_.size(); i += step) points_[kept++] = points_[i];
  points_.resize(kept);
}

void WideSearch::see_from(const Pose& T_map_cam) {
  const ContourMap& map = index_.map();
  points_.clear();
  for (const std::uint32_t i : visible_.choose(T_map_cam))
    points_.push_back({map.position(i), map.points[i].tangent.cast<double>()});
}

/// By the points in view.
PoseGuess WideSearch::refine(const EdgeField& field, const Pose& T_body_cam, const PoseGuess& guess,
                             double from_px) const {
  if (points_.empty()) return {guess.T_map_body, -1e3};
  const double sigma_m = kPlaceSigma * places_->edge_m(), sigma_rad = kAttitudeSigma_rad;
  Vector6d information;
  information << Eigen::Vector3d::Constant(1 / (sigma_m * sigma_m)),
      Eigen::Vector3d::Constant(1 / (sigma_rad * sigma_rad));
  PoseGuess out =
      refine_pose({field, camera_, T_body_cam, points_}, guess.T_map_body, information.asDiagonal(), from_px);
  out.score *= std::sqrt(static_cast<double>(points_.size()));
  return out;
}

std::vector<PoseGuess> WideSearch::find(std::span<const FilteredEvent> events, const EdgeField& field,
                                        const Pose& T_body_cam, const WidePrior& prior) {
  prepare(prior);
  if (!places_ || places_->places().empty()) return {};
  const std::vector<EdgeLine> lines = line_finder_.find(events);
  AttitudePrior attitude{prior.up_body.normalized(), prior.T_map_body.q};
  attitude.turned_within = kSigmas * std::sqrt(prior.covariance.diagonal().tail<3>().sum());
  // Of the heading about the map's z.
  const Eigen::Matrix3d R = prior.T_map_body.rotation();
  const Eigen::Matrix3d about_map = R * prior.covariance.bottomRightCorner<3, 3>() * R.transpose();
  attitude.heading_within = kSigmas * std::sqrt(about_map(2, 2));
  const std::vector<AttitudeGuess> attitudes =
      search_attitude(lines, camera_, T_body_cam.q, directions_, attitude, kAttitudes);
  std::vector<PoseGuess> guesses =
      search_places(lines, camera_, T_body_cam, *places_, box(prior), attitudes, kPlaces);
  keep_different(guesses, kRefined, nearer_than(kDifferent_m, kDifferent_rad));
  const double reach_px = std::max(refine_reach_px(), kReach * camera_.focal_px());
  for (PoseGuess& g : guesses) {
    see_from_nearest_place(g.T_map_body * T_body_cam);
    g = refine(field, T_body_cam, g, reach_px);
  }
  keep_different(guesses, kKept, nearer_than(kSame_m, kSame_rad));
  for (PoseGuess& g : guesses) {
    see_from(g.T_map_body * T_body_cam);
    g = refine(field, T_body_cam, g, kLastReach_px);
  }
  keep_different(guesses, kKept, nearer_than(kSame_m, kSame_rad));
  return guesses;
}

}  // namespace evpose
