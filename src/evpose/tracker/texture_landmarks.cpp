// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/texture_landmarks.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace evpose {
namespace {

constexpr TimeNs kLife = 100 * kNsPerMs;                 // of landmarks
constexpr double kSlice_px = 2, kLongestSlice_s = 0.03;  // motion in a slice, or its length
constexpr double kCell_px = 3;                           // of the depths
constexpr double kNear_m = 0.1, kWidestTangent = 3;
constexpr double kBesidePiece_px = 3, kAlongPiece_px = 2;  // where the surface has to be the same
constexpr double kSameSurface = 0.03;                      // of the depth
constexpr int kFewestSeen = 10;                            // landmarks with events
constexpr double kGate_px = 0.7;
constexpr double kShared_px = 0.35, kShared_s = 0.1;  // errors of a landmark's place last as long as itself

/// Out to where the camera sees, on the plane at unit depth.
Eigen::Vector2d tangents_of(const Camera& camera) {
  const double right = camera.size().width - 1, bottom = camera.size().height - 1;
  Eigen::Vector2d out(0.1, 0.1);
  for (const double u : {0.0, 0.5, 1.0})
    for (const double v : {0.0, 0.5, 1.0}) {
      const auto ray = camera.unproject({u * right, v * bottom});
      if (ray && ray->z() > 0) out = out.cwiseMax(ray->head<2>().cwiseAbs() / ray->z());
    }
  return out.cwiseMin(kWidestTangent);
}

double cell_of(const Camera& camera) { return kCell_px * 2 * tangents_of(camera).x() / camera.size().width; }

EventRegistrationConfig registration_config() {
  EventRegistrationConfig out;
  out.edge_delay = false;  // they were found where their events are, as late as those that follow
  out.polarity = false;
  out.gate_px = kGate_px;
  out.correlated_sigma_px = kShared_px;
  out.correlation_time_s = kShared_s;
  return out;
}

}  // namespace

TextureLandmarks::TextureLandmarks(const ContourIndex& index, const Camera& camera, const Pose& T_body_cam)
    : index_(index),
      camera_(camera),
      T_body_cam_(T_body_cam),
      depths_(tangents_of(camera), cell_of(camera)),
      finder_(camera.size()),
      near_(camera.size().width, camera.size().height) {}

void TextureLandmarks::restart() {
  points_body_.clear(), tangents_body_.clear(), map_.points.clear();
  slice_.clear(), slice_begin_.reset();
  expected_ = false;
  found_ = 0;
}

void TextureLandmarks::prepare(TimeNs next_update, EventPreprocessor& events) {
  expected_ = false;
  near_.clear();
  collected_.clear();
  events.collect(&collected_, next_update >= found_ + kLife ? nullptr : &near_);
}

void TextureLandmarks::expect(const FusionState& coming, double span_s, const Pose& found_at) {
  if (points_body_.empty()) return;
  project(coming, span_s, found_at);
  expected_ = registration_->expect({samples_, span_s}, &near_);
}

void TextureLandmarks::look_at(std::uint32_t now_us) {
  if (expected_) registration_->look_at(collected_, now_us);
}

/// Where the surface that is seen at a pixel is, camera frame.
std::optional<Eigen::Vector3d> TextureLandmarks::surface_at(const Eigen::Vector2d& pixel) const {
  const auto ray = camera_.unproject(pixel);
  if (!ray || !(ray->z() > 0)) return std::nullopt;
  const Eigen::Vector3d at_unit_depth = *ray / ray->z();
  const auto depth_m = depths_.depth_at(at_unit_depth.head<2>().cast<float>());
  if (!depth_m) return std::nullopt;
  return Eigen::Vector3d(*depth_m * at_unit_depth);
}

/// Pieces at the rim of a surface are left out: it is not known of which surface they are.
void TextureLandmarks::place(const EdgePiece& piece, const Pose& T_body_cam_then) {
  const Eigen::Vector2d &n = piece.normal, t(-n.y(), n.x());
  const auto middle = surface_at(piece.pixel), along = surface_at(piece.pixel + kAlongPiece_px * t);
  if (!middle || !along) return;
  const auto same = [&](const std::optional<Eigen::Vector3d>& other) {
    return other && std::abs(other->z() / middle->z() - 1) < kSameSurface;
  };
  if (!same(along) || !same(surface_at(piece.pixel + kBesidePiece_px * n)) ||
      !same(surface_at(piece.pixel - kBesidePiece_px * n)))
    return;
  Matrix23d by_point;
  if (!camera_.project(*middle, &by_point)) return;
  points_body_.push_back(T_body_cam_then * *middle);
  tangents_body_.push_back((T_body_cam_then.q * (*along - *middle)).normalized());
  ContourPoint point;
  point.position.setZero();  // project() places it
  point.sigma = static_cast<float>(piece.sigma_px / (n.transpose() * by_point).norm());
  map_.points.push_back(point);
}

/// In the events that were collected.
void TextureLandmarks::find(const Input& input, const FusionState& state) {
  const std::vector<EdgePiece> pieces = finder_.find(slice_, input.now_us);
  restart();
  found_ = input.t;
  const Pose& now = state.nav.T_map_body;
  map_.anchor = now.p;
  depths_.render(index_.map(), now * T_body_cam_, kNear_m);
  for (const EdgePiece& piece : pieces) {
    const Pose then{now.q * so3::exp(-piece.age_s * state.angular_rate),
                    now.p - piece.age_s * state.nav.velocity};
    place(piece, now.inverse() * then * T_body_cam_);
  }
  segments_.of_point.resize(points_body_.size());
  std::iota(segments_.of_point.begin(), segments_.of_point.end(), 0u);
  segments_.count = static_cast<std::uint32_t>(points_body_.size());
  registration_.emplace(camera_.size(), registration_config(), std::max(1u, segments_.count));
}

void TextureLandmarks::project(const FusionState& state, double span_s, const Pose& found_at) {
  for (std::size_t i = 0; i < points_body_.size(); ++i) {
    map_.points[i].position = (found_at * points_body_[i] - map_.anchor).cast<float>();
    map_.points[i].tangent = (found_at.q * tangents_body_[i]).cast<float>();
  }
  project_contours({map_, segments_, camera_, T_body_cam_, 0}, segments_.of_point,
                   {state.nav.T_map_body, state.nav.velocity, state.angular_rate}, span_s, samples_);
}

/// What the events say of the pose now and of that when the landmarks were found.
RelativeInformation TextureLandmarks::measure(const Input& input, const BackEnd& fusion) {
  const FusionState& state = fusion.state();
  const Pose found_at = *fusion.kept_pose();
  const Matrix6d covariance = state.pose_covariance();
  if (!expected_ || input.forecast == nullptr) project(state, input.span_s, found_at);
  RegistrationProblem problem{collected_, input.now_us, input.span_s, samples_, covariance};
  if (expected_ && input.forecast != nullptr)
    problem.forecast = {state.nav.T_map_body.minus(input.forecast->T_map_body),
                        state.nav.velocity - input.forecast->velocity};
  RelativeInformation out;
  if (registration_->measure(problem).inliers < kFewestSeen) return out;
  const Eigen::Matrix3d R = found_at.rotation();
  for (const SampleOffset& offset : registration_->offsets()) {
    const ContourSample& s = samples_[offset.sample];
    const Eigen::RowVector3d by_point = -s.jacobian.head<3>().transpose();  // the camera moves, or the point
    RelativeInformation::Vector h;
    h << s.jacobian, by_point.transpose(), -(by_point * R * so3::hat(points_body_[s.point])).transpose();
    out.information.selfadjointView<Eigen::Lower>().rankUpdate(h, offset.weight);
    out.vector += offset.weight * offset.offset_px * h;
  }
  out.information.triangularView<Eigen::StrictlyUpper>() = out.information.transpose();
  return out;
}

void TextureLandmarks::update(const Input& input, BackEnd& fusion) {
  if (!points_body_.empty() && fusion.kept_pose()) fusion.update(measure(input, fusion));
  if (input.t < found_ + kLife) return;
  if (!slice_.empty() && slice_.front().stamp_us > input.now_us)  // the clock's stamps began anew meanwhile
    slice_.clear(), slice_begin_.reset();
  slice_.insert(slice_.end(), collected_.begin(), collected_.end());
  if (!slice_begin_) slice_begin_ = input.t - from_seconds(input.span_s);
  const double span_s = to_seconds(input.t - *slice_begin_);
  if (span_s * input.flow_px_s < kSlice_px && span_s < kLongestSlice_s) return;
  find(input, fusion.state());
  fusion.keep_pose();
}

}  // namespace evpose
