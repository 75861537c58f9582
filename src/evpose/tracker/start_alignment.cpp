// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/start_alignment.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <utility>

#include "evpose/registration/edge_field.h"
#include "evpose/registration/pose_search.h"
#include "evpose/tracker/event_slice.h"

namespace evpose {
namespace {

// From the errors of an ordinary calibration to the gate of the tracker.
constexpr std::array<double, 7> kGates_px{4, 3, 2, 1.4, 1, 0.7, 0.5};
constexpr int kStepsPerGate = 4;           // of Gauss-Newton, each with a new association
constexpr double kScatterOfGate = 0.7;     // sigma of the events under a gate, but for the tracker's
constexpr double kContrastReach_px = 0.1;  // below every gate, so that no band is wider than its gate
constexpr double kNumbersFirst_px = 10;    // gates below which the camera's numbers are free: all,
constexpr double kPoseFirst_px = 1.7;      // or the narrow ones
constexpr double kHeld = 1e12;             // factor on the prior's information that holds the numbers
// Chance gives no concentration at all, a wrong view some. How much the right one gives depends on the
// texture beside the contours. So much is the right one's, if several starting points or the next events lead
// to it as well:
constexpr double kHighConcentration = 0.42, kFewAgree = 0.4;
// With less, most starting points have to lead to one view, and its contours have to have events.
constexpr double kLeastConcentration = 0.2, kLeastAgreement = 0.6, kLeastSupport = 0.2;
constexpr double kSameView = 2, kConfirmedWithin = 4;  // sigma
constexpr int kDraws = 10;                             // further starting points where these do not agree
constexpr unsigned kSeed = 1;
constexpr double kEdge_m = 0.6;         // an edge whose events share errors
constexpr double kEdgeSigma_px = 0.15;  // of such an error; one degree of freedom

// Points to refine with, and to search with.
constexpr double kPointStride_px = 4, kSearchStride_px = 8, kSearchMargin_px = 40;
constexpr int kPoints = 3000, kSearchPoints = 700;
constexpr std::size_t kSearched = 4;  // poses that are tried beside the prior's
constexpr std::size_t kSearchEvents = 20000;
constexpr double kSearchSpan_s = 0.02;  // contours move little in it

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
  config.polarity = config.gate_truncation_correction = config.ego_motion_test = false;
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

/// The prior's pose, and others that edges of the newest events suggest.
std::vector<Pose> StartAlignment::first_guesses(const SeenPrior& prior, const Pose& T_body_cam) const {
  std::vector<Pose> out{prior.nav.T_map_body};
  std::vector<FilteredEvent> events, compensated;
  double span_s = 0;
  for (std::size_t k = 0; k < intervals_.size() && events.size() < kSearchEvents && span_s < kSearchSpan_s;
       ++k) {
    events.insert(events.begin(), intervals_[k].events.begin(), intervals_[k].events.end());
    span_s += intervals_[k].motion.dt_s;
  }
  const EventInterval& newest = intervals_[0];
  const double age_s = 0.5 * span_s;
  const Eigen::Vector3d rate_cam = T_body_cam.q.conjugate() * newest.angular_rate;
  compensate_rotation(events, camera_, {rate_cam, newest.now_us, age_s}, compensated);
  EdgeField field(camera_.size());
  field.build(compensated);
  const Camera& choosing = adjusted_ != nullptr ? adjusted_->given() : camera_;
  VisibleSet visible(index_, choosing, points_to_search(visible_config_));
  std::vector<SearchPoint> points;
  for (const std::uint32_t i : visible.choose(prior.nav.T_map_body * T_body_cam))
    points.push_back({index_.map().position(i), index_.map().points[i].tangent.cast<double>()});
  if (points.empty()) return out;
  const SearchView view{field, camera_, T_body_cam, points};
  for (const PoseGuess& guess :
       search_pose(view, prior.nav.T_map_body, prior.covariance.topLeftCorner<6, 6>(), 1)) {
    if (out.size() > kSearched) break;
    // The edges show where the body was age_s ago.
    out.push_back({guess.T_map_body.q * so3::exp(age_s * newest.angular_rate),
                   guess.T_map_body.p + age_s * prior.nav.velocity});
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
  }
}

/// Eliminates the error of each edge, and takes its next variance from what it has turned out to be.
void StartAlignment::add_edges(const std::map<std::uint32_t, EdgeSum>& edges, Trial& trial) const {
  constexpr double kVariance = kEdgeSigma_px * kEdgeSigma_px;
  for (const auto& [number, edge] : edges) {
    double& variance = trial.edge_variances.try_emplace(number, kVariance).first->second;
    const double weight = edge.weight + 1 / variance, error = edge.offset / weight;
    trial.H.selfadjointView<Eigen::Lower>().rankUpdate(edge.row, -1 / weight);
    trial.b -= error * edge.row;
    variance = 0.5 * (kVariance + error * error + 1 / weight);
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

/// From a pose, the other states as the prior has them. The camera's numbers are held above a gate.
StartAlignment::Trial StartAlignment::anneal(const SeenPrior& prior, const Begin& begin,
                                             const Pose& T_body_cam, double numbers_below_px) {
  const Eigen::Index n = prior.numbers.size(), all = 9 + n;
  const Eigen::MatrixXd information = information_of(prior.covariance);
  Trial trial;
  trial.nav = prior.nav;
  trial.nav.T_map_body = begin.T_map_body;
  trial.numbers = begin.numbers;
  trial.H.resize(all, all);
  trial.b.resize(all);
  trial.moved.resize(all);
  const Camera& choosing = adjusted_ != nullptr ? adjusted_->given() : camera_;
  VisibleSet visible(index_, choosing, points_to_refine(visible_config_));
  const std::vector<std::uint32_t> points = visible.choose(begin.T_map_body * T_body_cam);
  for (const double gate_px : kGates_px) {
    EventRegistration registration(camera_.size(), under_gate(registration_config_, gate_px),
                                   segments_.count);
    for (int step = 0; step < kStepsPerGate; ++step) {
      look(prior, T_body_cam, points, registration, trial);
      // The last look is at the aligned state: it only measures.
      if (gate_px == kGates_px.back() && step + 1 == kStepsPerGate) return trial;
      Eigen::MatrixXd H = trial.H + information;
      if (gate_px > numbers_below_px) H.diagonal().tail(n) += kHeld * information.diagonal().tail(n);
      const Eigen::VectorXd d = H.ldlt().solve(trial.b - information * trial.moved);
      if (!d.allFinite()) return trial;
      trial.nav.T_map_body = trial.nav.T_map_body.plus(d.head<6>());
      trial.nav.velocity += d.segment<3>(6);
      trial.numbers += d.tail(n);
    }
  }
  return trial;
}

/// About the prior's mean. The velocity is left to the updates that follow.
SeenMeasurement StartAlignment::without_velocity(const SeenPrior& prior, const Trial& trial) const {
  const Eigen::VectorXd vector = trial.b + trial.H * trial.moved;
  const Eigen::MatrixXd information = information_of(prior.covariance);
  const std::array<int, 3> velocity{6, 7, 8};
  std::vector<int> kept{0, 1, 2, 3, 4, 5};
  for (int i = 9; i < vector.size(); ++i) kept.push_back(i);
  const Eigen::Matrix3d of_velocity = trial.H(velocity, velocity) + information(velocity, velocity);
  const Eigen::MatrixXd gain = trial.H(kept, velocity) * of_velocity.inverse();
  return {trial.H(kept, kept) - gain * trial.H(velocity, kept), vector(kept) - gain * vector(velocity)};
}

/// Share of the trials that led to the same view.
double StartAlignment::agreement(std::span<const Trial> trials, const Trial& view) {
  const auto agree = std::ranges::count_if(trials, [&](const Trial& other) {
    const Eigen::VectorXd d = other.moved - view.moved;
    return d.dot(view.H * d) < kSameView * kSameView * static_cast<double>(d.size());
  });
  return static_cast<double>(agree) / static_cast<double>(trials.size());
}

/// From the poses that the edges suggest.
std::vector<StartAlignment::Trial> StartAlignment::try_guesses(const SeenPrior& prior,
                                                               std::span<const Pose> guesses,
                                                               const Pose& T_body_cam) {
  std::vector<Trial> trials;
  for (const Pose& from : guesses)
    for (const double numbers_below_px : {kNumbersFirst_px, kPoseFirst_px}) {
      if (numbers_below_px == kPoseFirst_px && prior.numbers.size() == 0) continue;
      trials.push_back(anneal(prior, {from, prior.numbers}, T_body_cam, numbers_below_px));
    }
  return trials;
}

/// From numbers and poses that are drawn from the prior, and from drawn numbers and the suggested poses.
void StartAlignment::try_drawn(const SeenPrior& prior, std::span<const Pose> guesses, const Pose& T_body_cam,
                               std::vector<Trial>& trials) {
  std::mt19937 random(kSeed);
  std::normal_distribution<double> normal;
  const Eigen::Index n = prior.numbers.size();
  const Eigen::MatrixXd root = information_of(prior.covariance).inverse().llt().matrixL();
  for (std::size_t draw = 0; draw < kDraws; ++draw) {
    const Eigen::VectorXd off =
        root * Eigen::VectorXd::NullaryExpr(root.rows(), [&] { return normal(random); });
    const Pose from =
        draw % 2 == 0 ? prior.nav.T_map_body.plus(off.head<6>()) : guesses[draw % guesses.size()];
    trials.push_back(anneal(prior, {from, prior.numbers + off.tail(n)}, T_body_cam, kNumbersFirst_px));
  }
}

/// Whether this view is the one that the last call found. That began from the same prior, but for what the
/// IMU has added since.
bool StartAlignment::confirms_last(const Trial& view) {
  const Eigen::VectorXd last = std::exchange(last_moved_, view.moved);
  if (last.size() != view.moved.size()) return false;
  Eigen::VectorXd d = view.moved - last;
  d.segment<3>(6).setZero();
  return d.dot(view.H * d) < kConfirmedWithin * kConfirmedWithin * static_cast<double>(d.size());
}

/// `agreeing`: share of the starting points that the prior suggests.
bool StartAlignment::is_right(const Trial& view, double agreeing, bool confirmed) {
  if (view.concentration >= kHighConcentration && (confirmed || agreeing >= kFewAgree)) return true;
  return view.concentration >= kLeastConcentration && view.support >= kLeastSupport &&
         agreeing >= kLeastAgreement;
}

std::optional<SeenMeasurement> StartAlignment::align(const SeenPrior& prior, const Pose& T_body_cam) {
  const std::vector<Pose> guesses = first_guesses(prior, T_body_cam);
  std::vector<Trial> trials = try_guesses(prior, guesses, T_body_cam);
  const std::size_t suggested = trials.size();
  const auto best = [&] { return std::ranges::max_element(trials, {}, &Trial::support); };
  const auto agreeing = [&] { return agreement(std::span(trials).first(suggested), *best()); };
  bool right = agreeing() >= kLeastAgreement && is_right(*best(), agreeing(), false);
  if (!right) {
    try_drawn(prior, guesses, T_body_cam, trials);
    right = is_right(*best(), agreeing(), confirms_last(*best()));
  }
  if (adjusted_ != nullptr) adjusted_->set_correction(prior.numbers);
  intervals_.clear();
  if (!right) return {};
  return without_velocity(prior, *best());
}

}  // namespace evpose
