// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/texture_landmarks.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace evpose {
namespace {

constexpr TimeNs kLife = 100 * kNsPerMs;                   // of landmarks
constexpr TimeNs kSearch = 10 * kNsPerMs;                  // of this, until they are found
constexpr double kSlice_px = 2, kLongestSlice_s = 0.03;    // motion in a slice, or its length
constexpr double kBesidePiece_px = 3, kAlongPiece_px = 2;  // where the surface has to be the same
constexpr double kSameSurface = 0.03;                      // of the depth
constexpr int kFewestSeen = 10;                            // landmarks with events
constexpr double kGate_px = 0.7;
constexpr double kShared_px = 0.35, kShared_s = 0.1;  // errors of a landmark's place last as long as itself

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

TextureLandmarks::TextureLandmarks(const ContourIndex& index, const Camera& camera, const Pose& T_body_cam,
                                   const AdjustedCamera* adjusted)
    : camera_(camera),
      T_body_cam_(T_body_cam),
      adjusted_(adjusted),
      near_(camera.size().width, camera.size().height),
      search_(index, camera) {}

void TextureLandmarks::restart() {
  landmarks_.clear(), map_.points.clear();
  collected_.clear(), slice_.clear(), slice_begin_.reset();
  seen_from_.reset();
  expected_ = false;
  found_ = 0;
}

void TextureLandmarks::prepare(TimeNs next_update, EventPreprocessor& events) {
  if (finding()) search_.launch();
  if (finding() && next_update >= found_ + kSearch) take_found();
  expected_ = false;
  near_.clear();
  collected_.clear();
  events.collect(&collected_, next_update >= found_ + kLife ? nullptr : &near_);
}

void TextureLandmarks::expect(const FusionState& coming, double span_s, const Pose& found_at) {
  if (landmarks_.empty()) return;
  project(coming, span_s, found_at);
  expected_ = registration_->expect({samples_, span_s, {}, 0, coming.pose_covariance()}, &near_);
}

void TextureLandmarks::look_at(std::uint32_t now_us) {
  if (expected_) registration_->look_at(collected_, now_us);
}

/// Where the surface that is seen at a pixel is, camera frame.
std::optional<Eigen::Vector3d> TextureLandmarks::surface_at(const Eigen::Vector2d& pixel) const {
  const auto ray = camera_.unproject(pixel);
  if (!ray || !(ray->z() > 0)) return std::nullopt;
  const Eigen::Vector3d at_unit_depth = *ray / ray->z();
  const auto depth_m = search_.depths().depth_at(at_unit_depth.head<2>().cast<float>());
  if (!depth_m) return std::nullopt;
  return Eigen::Vector3d(*depth_m * at_unit_depth);
}

/// Pieces at the rim of a surface are left out: it is not known of which surface they are.
void TextureLandmarks::place(const EdgePiece& piece) {
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
  const Pose& now = seen_from_->nav.T_map_body;
  const Pose then{now.q * so3::exp(-piece.age_s * seen_from_->angular_rate),
                  now.p - piece.age_s * seen_from_->nav.velocity};
  landmarks_.push_back({piece.pixel, middle->z(), now.inverse() * then, *middle / middle->z(),
                        (*along - *middle).normalized()});
  ContourPoint point;
  point.position.setZero();  // project() places it
  point.sigma = static_cast<float>(piece.sigma_px / (n.transpose() * by_point).norm());
  map_.points.push_back(point);
}

/// In the events that were collected. None are followed meanwhile.
void TextureLandmarks::find(const Input& input, BackEnd& fusion) {
  const FusionState& state = fusion.state();
  search_.begin(slice_, input.now_us, state.nav.T_map_body * T_body_cam_);
  restart();
  found_ = input.t;
  seen_from_ = state;
  fusion.keep_pose();
}

void TextureLandmarks::take_found() {
  search_.finish();
  map_.anchor = seen_from_->nav.T_map_body.p;
  for (const EdgePiece& piece : search_.pieces()) place(piece);
  seen_from_.reset();
  segments_.of_point.resize(landmarks_.size());
  std::iota(segments_.of_point.begin(), segments_.of_point.end(), 0u);
  segments_.count = static_cast<std::uint32_t>(landmarks_.size());
  registration_.emplace(camera_.size(), registration_config(), std::max(1u, segments_.count));
}

void TextureLandmarks::project(const FusionState& state, double span_s, const Pose& found_at) {
  for (std::size_t i = 0; i < landmarks_.size(); ++i) {
    Landmark& landmark = landmarks_[i];
    if (adjusted_ != nullptr)
      if (const auto ray = camera_.unproject(landmark.pixel); ray && ray->z() > 0)
        landmark.ray = *ray / ray->z();
    const Pose T_map_cam = found_at * landmark.T_kept_then * T_body_cam_;
    const Eigen::Vector3d point_cam = landmark.depth_m * landmark.ray;
    map_.points[i].position = (T_map_cam * point_cam - map_.anchor).cast<float>();
    map_.points[i].tangent = (T_map_cam.q * landmark.tangent_cam).cast<float>();
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
  RelativeInformation out(adjusted_ == nullptr ? 0 : adjusted_->numbers());
  const int seen = registration_->measure(problem).inliers;
  registration_->learn(samples_, input.span_s);
  if (seen < kFewestSeen) return out;
  for (const SampleOffset& offset : registration_->offsets()) {
    const ContourSample& s = samples_[offset.sample];
    const Landmark& landmark = landmarks_[s.point];
    const LandmarkView view{state.nav.T_map_body, found_at, landmark.T_kept_then, T_body_cam_,
                            landmark.depth_m * landmark.ray};
    const auto h = landmark_row(view, s.jacobian, s.normal_px, adjusted_);
    out.information.selfadjointView<Eigen::Lower>().rankUpdate(h, offset.weight);
    out.vector += offset.weight * offset.offset_px * h;
  }
  out.information.triangularView<Eigen::StrictlyUpper>() = out.information.transpose();
  return out;
}

void TextureLandmarks::update(const Input& input, BackEnd& fusion) {
  if (!landmarks_.empty() && fusion.kept_pose()) fusion.update(measure(input, fusion));
  if (finding() || input.t < found_ + kLife) return;
  if (!slice_.empty() && slice_.front().stamp_us > input.now_us)  // the clock's stamps began anew meanwhile
    slice_.clear(), slice_begin_.reset();
  slice_.insert(slice_.end(), collected_.begin(), collected_.end());
  if (!slice_begin_) slice_begin_ = input.t - from_seconds(input.span_s);
  const double span_s = to_seconds(input.t - *slice_begin_);
  if (span_s * input.flow_px_s >= kSlice_px || span_s >= kLongestSlice_s) find(input, fusion);
}

}  // namespace evpose
