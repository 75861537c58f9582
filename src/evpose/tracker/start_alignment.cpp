// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/start_alignment.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>
#include <utility>

#include "evpose/tracker/contour_profiles.h"
#include "evpose/tracker/view_agreement.h"

namespace evpose {
namespace {

// From the errors of an ordinary calibration to the gate of the tracker.
constexpr std::array<double, 5> kGates_px{2, 1.4, 1, 0.7, 0.5};
constexpr int kStepsPerGate = 4;           // of Gauss-Newton, each with a new association
constexpr double kScatterOfGate = 0.7;     // sigma of the events under a gate, but for the tracker's
constexpr double kContrastReach_px = 0.1;  // below every gate, so that no band is wider than its gate
// Chance gives no concentration at all, a wrong view some. How much the right one gives depends on the
// texture beside the contours. So much is the right one's, if several starting points or the next events lead
// to it as well, or every other view has fewer events by a factor:
constexpr double kHighConcentration = 0.42, kFewAgree = 0.4, kAlone = 1.5;
// With less, most starting points have to lead to one view, and its contours have to have events, or the next
// events have to lead to it as well.
constexpr double kLeastConcentration = 0.2, kLeastAgreement = 0.6, kLeastSupport = 0.2;
constexpr double kSameView = 2, kConfirmedWithin = 4;  // sigma
// Of views that confirm the one before them, whatever else is found beside them.
constexpr int kEnoughInARow = 2;
constexpr double kInARowConcentration = 0.25, kInARowSupport = 0.1;
constexpr double kEdge_m = 0.6;         // an edge whose events share errors
constexpr double kEdgeSigma_px = 0.15;  // of such an error, beside the map's; one degree of freedom

// Points to refine with, and to search with.
constexpr double kPointStride_px = 4, kSearchStride_px = 6, kSearchMargin_px = 40;
constexpr int kPoints = 3000, kSearchPoints = 1500;
constexpr std::size_t kBegins = 8;
constexpr double kReach_sigma = 3, kMostReach_px = 32;  // of profiles

VisibleSetConfig points_to_refine(VisibleSetConfig config) {
  config.stride_px = kPointStride_px;
  config.budget = kPoints;
  return config;
}

VisibleSetConfig points_to_search(VisibleSetConfig config) {
  config.stride_px = kSearchStride_px;
  config.margin_px = kSearchMargin_px;
  config.budget = kSearchPoints;
  return config;
}

/// Contrast is not known from a pose that may be wrong, so polarity is not asked.
EventRegistrationConfig under_gate(EventRegistrationConfig config, double gate_px) {
  config.gate_px = gate_px;
  config.event_sigma_px = std::max(config.event_sigma_px, kScatterOfGate * gate_px);
  config.contrast_band_px = kContrastReach_px;
  config.polarity = config.polarity_tells_clutter = config.gate_truncation_correction = false;
  config.ego_motion_test = false;
  return config;
}

/// Of a covariance in which some numbers may be known exactly.
Eigen::MatrixXd information_of(const Eigen::MatrixXd& covariance) {
  constexpr double kExact = 1e-14;  // m^2, rad^2, px^2: far below all that is told
  const Eigen::Index n = covariance.rows();
  return (covariance + kExact * Eigen::MatrixXd::Identity(n, n)).inverse();
}

}  // namespace

StartAlignment::StartAlignment(const RelocalizerScene& scene, AdjustedCamera* camera)
    : motion_(scene.gravity_map),
      index_(scene.index),
      segments_(scene.segments),
      camera_(scene.camera),
      adjusted_(camera),
      visible_config_(scene.visible),
      registration_config_(scene.registration),
      edges_(cut_into_segments(scene.index.map(), kEdge_m)),
      intervals_(1 + static_cast<std::size_t>(kDuration_s / EventIntervals::kInterval_s)) {
  visible_config_.refresh_px = 0;
  const std::vector<ContourPoint>& points = index_.map().points;
  std::vector<const ContourPoint*> first(edges_.count, nullptr);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const ContourPoint*& of_edge = first[edges_.of_point[i]];
    if (of_edge == nullptr) of_edge = &points[i];
    side_.push_back(points[i].tangent.dot(of_edge->tangent) < 0 ? -1 : 1);
  }
}

double StartAlignment::expected_offset_px(const SeenPrior& prior, std::span<const ContourSample> samples,
                                          const Pose& T_body_cam) const {
  const Eigen::Index n = prior.numbers.size();
  const Pose T_cam_map = (prior.nav.T_map_body * T_body_cam).inverse();
  double sum = 0;
  for (const ContourSample& s : samples) {
    sum += s.jacobian.dot(prior.covariance.topLeftCorner<6, 6>() * s.jacobian);
    if (n == 0) continue;
    const auto by_numbers = adjusted_->by_numbers(T_cam_map * index_.map().position(s.point));
    if (!by_numbers) continue;
    const Eigen::RowVectorXd row = s.normal_px.transpose() * *by_numbers;
    sum += row.dot(prior.covariance.bottomRightCorner(n, n) * row.transpose());
  }
  return samples.empty() ? 0 : std::sqrt(sum / static_cast<double>(samples.size()));
}

/// Derivatives of the samples' displacements across them by pose and numbers, a row for each slot.
Eigen::MatrixXd StartAlignment::displacement_rows(const SeenPrior& prior, const Pose& T_body_cam,
                                                  std::span<const std::uint32_t> slots,
                                                  std::size_t count) const {
  const Eigen::Index n = prior.numbers.size();
  const Pose T_cam_map = (prior.nav.T_map_body * T_body_cam).inverse();
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(count), 6 + n);
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const ContourSample& s = samples_[i];
    auto row = rows.row(slots[i]);
    row.head<6>() = -s.jacobian.transpose();
    if (n == 0) continue;
    if (const auto by_numbers = adjusted_->by_numbers(T_cam_map * index_.map().position(s.point)))
      row.tail(n) = s.normal_px.transpose() * *by_numbers;
  }
  return rows;
}

/// Where errors of the prior would put the contours at most events.
std::vector<StartAlignment::Begin> StartAlignment::begins(const SeenPrior& prior, const Pose& T_body_cam) {
  const Eigen::Index n = prior.numbers.size();
  std::vector<Eigen::Index> pose_and_numbers{0, 1, 2, 3, 4, 5};
  for (Eigen::Index i = 0; i < n; ++i) pose_and_numbers.push_back(9 + i);
  const Eigen::MatrixXd P = prior.covariance(pose_and_numbers, pose_and_numbers);
  const Eigen::MatrixXd root = information_of(P).inverse().llt().matrixL();
  const std::vector<std::uint32_t> points =
      visible_from(prior.nav.T_map_body * T_body_cam, points_to_search(visible_config_));
  std::unordered_map<std::uint32_t, std::uint32_t> slot_of;
  for (const std::uint32_t point : points) slot_of.emplace(point, static_cast<std::uint32_t>(slot_of.size()));
  const ContourView view{index_.map(), segments_, camera_, T_body_cam, registration_config_.map_sigma_m};
  const PoseHypothesis newest{prior.nav};
  NavState nav = prior.nav;
  Eigen::MatrixXd rows;
  std::optional<ContourProfiles> profiles;
  for (std::size_t k = 0; k < intervals_.size(); ++k) {
    const EventInterval& interval = intervals_[k];
    const double span_s = interval.motion.dt_s;
    project_contours(view, points, {nav.T_map_body, nav.velocity, interval.angular_rate}, span_s, samples_);
    std::vector<std::uint32_t> slots;
    for (const ContourSample& s : samples_) slots.push_back(slot_of.at(s.point));
    if (!profiles) {
      rows = displacement_rows(prior, T_body_cam, slots, points.size()) * root;
      const double seen = std::max(1.0, static_cast<double>(samples_.size()));
      const double reach_px = kReach_sigma * rows.norm() / std::sqrt(seen);
      profiles.emplace(camera_.size(), points.size(), std::min(reach_px, kMostReach_px));
    }
    profiles->add(interval.events, interval.now_us, span_s, samples_, slots);
    nav = motion_.propagate_back(newest, nav, interval.motion);
  }
  std::vector<Begin> out;
  if (!profiles) return out;
  profiles->finish();
  for (const Eigen::VectorXd& z : most_gathering(*profiles, rows, kBegins)) {
    const Eigen::VectorXd off = root * z;
    out.push_back({prior.nav.T_map_body.plus(off.head<6>()), prior.numbers + off.tail(n)});
  }
  return out;
}

/// Adds what the events of one look say, with the trial's own rows: by_state is the derivative of the pose at
/// the events' time by the newest pose and velocity.
void StartAlignment::add_offsets(const EventRegistration& registration, const Pose& T_cam_map,
                                 const Eigen::Matrix<double, 6, 9>& by_state,
                                 std::map<std::uint32_t, EdgeSum>& edges, Trial& trial) const {
  const Eigen::Index n = trial.numbers.size();
  Eigen::VectorXd row(9 + n);
  for (const SampleOffset& offset : registration.offsets()) {
    const ContourSample& s = samples_[offset.sample];
    row.head<9>() = by_state.transpose() * s.jacobian;
    if (n > 0) {
      const auto by_numbers = adjusted_->by_numbers(T_cam_map * index_.map().position(s.point));
      if (!by_numbers) continue;
      row.tail(n) = -(s.normal_px.transpose() * *by_numbers).transpose();
    }
    trial.H.selfadjointView<Eigen::Lower>().rankUpdate(row, offset.weight);
    trial.b += offset.weight * offset.offset_px * row;
    EdgeSum& edge = edges[edges_.of_point[s.point]];
    if (edge.row.size() == 0) edge.row.setZero(9 + n);
    const double weight = side_[s.point] * offset.weight;
    edge.row += weight * row;
    edge.weight += offset.weight;
    edge.offset += weight * offset.offset_px;
    edge.map_variance += offset.weight * s.map_sigma_px * s.map_sigma_px;
  }
}

/// Eliminates the error of each edge, and takes its next variance from what it has turned out to be.
void StartAlignment::add_edges(const std::map<std::uint32_t, EdgeSum>& edges, Trial& trial) const {
  for (const auto& [number, edge] : edges) {
    if (!(edge.weight > 0)) continue;
    const double ordinary = kEdgeSigma_px * kEdgeSigma_px + edge.map_variance / edge.weight;
    double& variance = trial.edge_variances.try_emplace(number, ordinary).first->second;
    const double weight = edge.weight + 1 / variance, error = edge.offset / weight;
    trial.H.selfadjointView<Eigen::Lower>().rankUpdate(edge.row, -1 / weight);
    trial.b -= error * edge.row;
    variance = 0.5 * (ordinary + error * error + 1 / weight);
  }
  trial.H.triangularView<Eigen::StrictlyUpper>() = trial.H.transpose();
}

/// Looks at all events from the trial's state.
void StartAlignment::look(const SeenPrior& prior, const Pose& T_body_cam,
                          std::span<const std::uint32_t> points, EventRegistration& registration,
                          Trial& trial) {
  const ContourView view{index_.map(), segments_, camera_, T_body_cam, registration_config_.map_sigma_m};
  if (adjusted_ != nullptr) adjusted_->set_correction(trial.numbers);
  trial.moved << trial.nav.T_map_body.minus(prior.nav.T_map_body), trial.nav.velocity - prior.nav.velocity,
      trial.numbers - prior.numbers;
  trial.H.setZero();
  trial.b.setZero();
  registration.restart();
  const PoseHypothesis newest{trial.nav};
  std::map<std::uint32_t, EdgeSum> edges;
  NavState nav = trial.nav;
  double age_s = 0, matched = 0, asked = 0;
  for (std::size_t k = 0; k < intervals_.size(); ++k) {
    const EventInterval& interval = intervals_[k];
    const double span_s = interval.motion.dt_s;
    project_contours(view, points, {nav.T_map_body, nav.velocity, interval.angular_rate}, span_s, samples_);
    const RegistrationResult r =
        registration.measure({interval.events, interval.now_us, span_s, samples_, Matrix6d::Zero()});
    trial.concentration = r.gate_concentration;
    matched += r.events;
    asked += static_cast<double>(samples_.size());
    Eigen::Matrix<double, 6, 9> by_state = Eigen::Matrix<double, 6, 9>::Zero();
    by_state.block<3, 3>(0, 0).setIdentity();
    by_state.block<3, 3>(0, 6) = -age_s * Eigen::Matrix3d::Identity();
    by_state.block<3, 3>(3, 3) = (nav.T_map_body.q.conjugate() * trial.nav.T_map_body.q).toRotationMatrix();
    add_offsets(registration, (nav.T_map_body * T_body_cam).inverse(), by_state, edges, trial);
    age_s += span_s;
    nav = motion_.propagate_back(newest, nav, interval.motion);
  }
  add_edges(edges, trial);
  trial.support = trial.concentration * matched / std::max(1.0, asked);
}

StartAlignment::Trial::Trial(const SeenPrior& prior, const Begin& begin)
    : nav(prior.nav), numbers(begin.numbers) {
  nav.T_map_body = begin.T_map_body;
  const Eigen::Index all = 9 + numbers.size();
  H.resize(all, all);
  b.resize(all);
  moved.resize(all);
}

std::vector<std::uint32_t> StartAlignment::visible_from(const Pose& T_map_cam,
                                                        const VisibleSetConfig& config) const {
  const Camera& choosing = adjusted_ != nullptr ? adjusted_->given() : camera_;
  return VisibleSet(index_, choosing, config).choose(T_map_cam);
}

/// From a pose and numbers, the velocity as the prior has it.
StartAlignment::Trial StartAlignment::anneal(const SeenPrior& prior, const Begin& begin,
                                             const Pose& T_body_cam) {
  const Eigen::MatrixXd information = information_of(prior.covariance);
  Trial trial(prior, begin);
  const std::vector<std::uint32_t> points =
      visible_from(begin.T_map_body * T_body_cam, points_to_refine(visible_config_));
  for (const double gate_px : kGates_px) {
    EventRegistration registration(camera_.size(), under_gate(registration_config_, gate_px),
                                   segments_.count);
    for (int step = 0; step < kStepsPerGate; ++step) {
      look(prior, T_body_cam, points, registration, trial);
      // The last look is at the aligned state: it only measures.
      if (gate_px == kGates_px.back() && step + 1 == kStepsPerGate) return trial;
      Eigen::MatrixXd H = trial.H + information;
      const Eigen::VectorXd d = H.ldlt().solve(trial.b - information * trial.moved);
      if (!d.allFinite()) return trial;
      trial.nav.T_map_body = trial.nav.T_map_body.plus(d.head<6>());
      trial.nav.velocity += d.segment<3>(6);
      trial.numbers += d.tail(trial.numbers.size());
    }
  }
  return trial;
}

bool StartAlignment::is_same(const Trial& a, const Trial& view) {
  const Eigen::VectorXd d = a.moved - view.moved;
  return d.dot(view.H * d) < kSameView * kSameView * static_cast<double>(d.size());
}

/// Share of the trials that led to the same view.
double StartAlignment::agreement(std::span<const Trial> trials, const Trial& view) {
  const auto agree = std::ranges::count_if(trials, [&](const Trial& other) { return is_same(other, view); });
  return static_cast<double>(agree) / static_cast<double>(trials.size());
}

bool StartAlignment::is_alone(std::span<const Trial> trials, const Trial& view) {
  return std::ranges::all_of(trials, [&](const Trial& other) {
    return view.support > kAlone * other.support || is_same(other, view);
  });
}

/// Whether this view is the one that the last call found, from other events. The IMU has carried the prior on
/// since then, with the error of its velocity.
bool StartAlignment::confirms_last(const SeenPrior& prior, const Trial& view) {
  const std::uint32_t now_us = intervals_[0].now_us;
  const double since_s = 1e-6 * static_cast<double>(now_us - std::exchange(last_us_, now_us));
  const Eigen::VectorXd last = std::exchange(last_moved_, view.moved);
  if (last.size() != view.moved.size()) return false;
  const Eigen::MatrixXd of_view = (view.H + information_of(prior.covariance)).inverse();
  return view_distance2(view.moved, last, of_view, prior.covariance.block<3, 3>(6, 6), since_s) <
         kConfirmedWithin * kConfirmedWithin;
}

/// `agreeing`: share of the starting points that lead there; `alone`: no other view gathers nearly as many.
bool StartAlignment::is_right(const Trial& view, double agreeing, bool alone) const {
  const bool confirmed = confirmed_in_a_row_ > 0;
  if (confirmed_in_a_row_ >= kEnoughInARow && view.concentration >= kInARowConcentration &&
      view.support >= kInARowSupport)
    return true;
  if (view.concentration >= kHighConcentration && (confirmed || alone || agreeing >= kFewAgree)) return true;
  return view.concentration >= kLeastConcentration && agreeing >= kLeastAgreement &&
         (confirmed || view.support >= kLeastSupport);
}

std::optional<SeenMeasurement> StartAlignment::align(const SeenPrior& prior, const Pose& T_body_cam) {
  std::vector<Trial> trials;
  for (const Begin& begin : begins(prior, T_body_cam)) trials.push_back(anneal(prior, begin, T_body_cam));
  const auto best = std::ranges::max_element(trials, {}, &Trial::support);
  bool right = false;
  if (best != trials.end()) {
    confirmed_in_a_row_ = confirms_last(prior, *best) ? confirmed_in_a_row_ + 1 : 0;
    right = is_right(*best, agreement(trials, *best), is_alone(trials, *best));
  }
  if (adjusted_ != nullptr) adjusted_->set_correction(prior.numbers);
  intervals_.clear();
  if (!right) return {};
  return SeenMeasurement{best->H, best->b + best->H * best->moved};  // about the prior's mean
}

}  // namespace evpose
