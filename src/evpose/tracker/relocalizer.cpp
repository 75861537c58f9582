// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/relocalizer.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/config.h"

namespace evpose {
namespace {

constexpr double kPositionSigma_m = 0.02, kRotationSigma_rad = 5e-3;  // of a pose that edges alone tell
constexpr double kGates_px[] = {3, 1.5, 0.8, 0.5};
constexpr int kSteps = 3;  // at each gate
constexpr double kPart_s = 0.008;
constexpr std::size_t kParts = 5;  // looked at together, once a pose has been followed for so long
constexpr double kSharpenSigma_m = 0.02, kSharpenSigma_rad = 0.01, kSharpenSigma_m_s = 0.3;
constexpr double kStride_px = 8, kMargin_px = 40;
constexpr double kLongestPause_s = 2;
constexpr double kThinShare = 0.25;
constexpr std::size_t kFewestEvents = 500;  // of a slice: nothing moves
constexpr int kPoints = 700;
constexpr double kCloseStride_px = 6;
constexpr int kClosePoints = 1500;
constexpr int kFlowCell_px = 16;
constexpr double kWidening = 1.5;                  // of the prior, from search to search
constexpr int kSameWidth = 3, kMostWidenings = 2;  // searches of the first width, then wider ones
constexpr double kNewest = 0.4;                    // weight of the newest slice in the means
constexpr double kOne_m = 0.005, kOne_rad = 0.002, kOne_m_s = 0.1;
constexpr double kSame_m = 0.02, kSame_rad = 0.007;  // candidates nearer than this are one

}  // namespace

void describe(ConfigTable& table, RelocalizationConfig& c) {
  table.add("on", c.on, "search the pose when it starts or becomes unsure");
  table.add("from_px", c.from_px, "px", "start poses less sure than this are searched", {0, 1e4});
  table.add("slice_events_per_column", c.slice_events_per_column, "",
            "events of a slice over the image's width", {0.1, 1000});
  table.add("short_slice_s", c.short_slice_s, "s", "... or with a quarter of them after this", {1e-3, 1});
  table.add("longest_slice_s", c.longest_slice_s, "s", "a slice ends after this", {1e-3, 1});
  table.add("gap_s", c.gap_s, "s", "between slices", {0, 1});
  table.add("least_slices", c.least_slices, "", "looked at before a pose is believed", {1, 100});
  table.add("most_slices", c.most_slices, "", "... and at most", {1, 1000});
  table.add("sharpened", c.sharpened, "", "poses whose events are looked at one by one", {1, 1000});
  table.add("least_concentration", c.least_concentration, "",
            "how much the events of a pose that is believed gather", {0, 1});
  table.add("least_lead", c.least_lead, "", "... and so many times more than those of the next", {1, 100});
  table.add("low_concentration", c.low_concentration, "", "... or so much, if they are", {0, 1});
  table.add("clear_lead", c.clear_lead, "", "... so many times more than those of the next", {1, 100});
  table.add("velocity_sigma_m_s", c.velocity_sigma_m_s, "m/s", "when a search begins", {0.01, 100});
  table.add("position_sigma_m", c.position_sigma_m, "m", "around the last pose when it was lost", {1e-3, 10});
  table.add("rotation_sigma_rad", c.rotation_sigma_rad, "rad", "around the last pose when it was lost",
            {1e-4, 1});
  table.add("verify_s", c.verify_s, "s", "a pose found is watched for so long before it is called tracking",
            {0, 10});
  table.add("patience_s", c.patience_s, "s",
            "lost, or events that do not gather at the contours, for so long: search", {0, 100});
  table.add("found_position_sigma_m", c.found_position_sigma_m, "m", "of a pose found", {1e-4, 1});
  table.add("found_rotation_sigma_rad", c.found_rotation_sigma_rad, "rad", "of a pose found", {1e-5, 1});
  table.add("found_velocity_sigma_m_s", c.found_velocity_sigma_m_s, "m/s", "of a pose found", {1e-3, 10});
  table.group("search", c.search);
}

Relocalizer::Relocalizer(const RelocalizationConfig& config, const ContourIndex& index,
                         const ContourSegments& pieces, const Camera& camera, const Pose& T_body_cam,
                         const Eigen::Vector3d& gravity_map)
    : config_(config),
      index_(index),
      pieces_(pieces),
      camera_(camera),
      T_body_cam_(T_body_cam),
      gravity_map_(gravity_map),
      has_imu_(!gravity_map.isZero()),
      search_(config.search) {}

void Relocalizer::begin_search(TimeNs t, const NavState& state, const Matrix6d& covariance) {
  if (!field_) {
    field_ = std::make_unique<EdgeField>(camera_.size());
    field_->set_spreads(static_cast<float>(config_.search.coarse_px),
                        static_cast<float>(config_.search.fine_px));
    VisibleSetConfig view;
    view.stride_px = kStride_px;
    view.margin_px = kMargin_px;
    view.budget = kPoints;
    view.refresh_px = 0;
    visible_ = std::make_unique<VisibleSet>(index_, camera_, view);
    VisibleSetConfig close;
    close.stride_px = kCloseStride_px;
    close.budget = kClosePoints;
    all_visible_ = std::make_unique<VisibleSet>(index_, camera_, close);
    for (const double gate_px : kGates_px) {
      EventAlignmentConfig stage;
      stage.gate_px = stage.widest_gate_px = gate_px;
      stage.count_px = 0.1;
      stage.polarity = stage.honest_slope = false;
      stages_.push_back(std::make_unique<EventAlignment>(camera_.size(), stage, pieces_.count));
    }
  }
  searching_ = true;
  prior_ = state;
  prior_covariance_ = covariance;
  hypotheses_.clear();
  slice_.clear();
  intervals_.clear();
  slice_begin_ = t;
  last_slice_ = 0;
  since_ = {};
  elapsed_s_ = 0;
  slices_ = 0;
  searches_ = 0;
}

void Relocalizer::restart_search(TimeNs t) {
  searching_ = true;
  slice_begin_ = t;
  hypotheses_.clear();
  slice_.clear();
  intervals_.clear();
  slices_ = 0;
  ++searches_;
}

void Relocalizer::append_interval(std::uint32_t now_us, std::span<const FrontEvent> events,
                                  const ImuIncrement& motion) {
  if (intervals_.empty() || intervals_.back().motion.dt_s >= kPart_s) {
    if (intervals_.size() == kParts) {
      intervals_.push_back(std::move(intervals_.front()));
      intervals_.pop_front();
      intervals_.back().events.clear();
      intervals_.back().motion = {};
    } else {
      intervals_.emplace_back();
    }
  }
  Interval& interval = intervals_.back();
  interval.events.insert(interval.events.end(), events.begin(), events.end());
  interval.now_us = now_us;
  interval.motion = joined(interval.motion, motion);
  interval.rate = rate_;
}

/// The state at the begin of `motion` from that at its end.
NavState Relocalizer::propagate_back(const Hypothesis& c, const NavState& nav, const ImuIncrement& m) const {
  const double dt = m.dt_s;
  NavState out;
  out.T_map_body.q = (nav.T_map_body.q * (has_imu_ ? m.dq.conjugate() : so3::exp(-dt * c.rate))).normalized();
  out.velocity = nav.velocity - dt * gravity_map_ - out.T_map_body.q * m.dv;
  out.T_map_body.p =
      nav.T_map_body.p - dt * out.velocity - 0.5 * dt * dt * gravity_map_ - out.T_map_body.q * m.dp;
  return out;
}

void Relocalizer::propagate(Hypothesis& c, const ImuIncrement& m) const {
  const double dt = m.dt_s;
  NavState& nav = c.nav;
  nav.T_map_body.p += nav.velocity * dt + 0.5 * dt * dt * gravity_map_ + nav.T_map_body.q * m.dp;
  nav.velocity += dt * gravity_map_ + nav.T_map_body.q * m.dv;
  nav.T_map_body.q = (nav.T_map_body.q * (has_imu_ ? m.dq : so3::exp(dt * c.rate))).normalized();
  c.position_variance += 2 * dt * c.covariance + dt * dt * c.velocity_variance;
  c.covariance += dt * c.velocity_variance;
  if (has_imu_) return;
  c.velocity_variance += 10 * dt;  // a vehicle that nobody measures
  c.rotation_variance += slices_ == 1 ? 1.0 * dt * dt : 0.1 * dt * dt;
}

void Relocalizer::select_search_points(const Pose& T_map_body) {
  points_.clear();
  const ContourMap& map = index_.map();
  for (const std::uint32_t i : visible_->choose(T_map_body * T_body_cam_))
    points_.push_back({map.position(i), map.points[i].tangent.cast<double>()});
}

/// Moves the slice's events to where they would be had the body not turned from one instant, age_s ago.
void Relocalizer::compensate_rotation(double age_s, std::uint32_t now_us) {
  compensated_ = slice_;
  if (!has_imu_) return;
  const Eigen::Vector3d rate_cam = T_body_cam_.q.conjugate() * rate_;
  const ImageSize size = camera_.size();
  const int columns = size.width / kFlowCell_px + 1, rows = size.height / kFlowCell_px + 1;
  std::vector<Eigen::Vector2d> flow(static_cast<std::size_t>(columns * rows), Eigen::Vector2d::Zero());
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      const auto ray = camera_.unproject({(column + 0.5) * kFlowCell_px, (row + 0.5) * kFlowCell_px});
      Matrix23d J;
      if (ray && camera_.project(*ray, &J))
        flow[static_cast<std::size_t>(row * columns + column)] = -J * rate_cam.cross(*ray);
    }
  std::size_t kept = 0;
  for (FrontEvent e : slice_) {
    const double later_s = 1e-6 * (now_us - e.stamp_us) - age_s;  // by so much the instant is after the event
    const Eigen::Vector2d& f =
        flow[static_cast<std::size_t>(e.y / kFlowCell_px * columns + e.x / kFlowCell_px)];
    const double x = std::round(e.x + f.x() * later_s), y = std::round(e.y + f.y() * later_s);
    if (!(x >= 0 && y >= 0 && x < size.width && y < size.height)) continue;
    e.x = static_cast<std::uint16_t>(x);
    e.y = static_cast<std::uint16_t>(y) & 0x7FFF;
    compensated_[kept++] = e;
  }
  compensated_.resize(kept);
}

/// Before a search: the first follow at once, later ones ever more slowly, since each costs a second of
/// processor time.
double Relocalizer::pause_s() const {
  return searches_ <= kSameWidth ? config_.gap_s : std::min(kLongestPause_s, 0.1 * (searches_ - kSameWidth));
}

std::optional<Relocalizer::Found> Relocalizer::process(TimeNs t, std::uint32_t now_us,
                                                       std::span<const FrontEvent> events,
                                                       const ImuIncrement& motion,
                                                       const Eigen::Vector3d& angular_rate) {
  since_ = joined(since_, motion);
  rate_ = angular_rate;
  append_interval(now_us, events, motion);
  if (to_seconds(t - last_slice_) < (slices_ == 0 ? pause_s() : config_.gap_s)) {
    slice_begin_ = t;
    return {};
  }
  slice_.insert(slice_.end(), events.begin(), events.end());
  const double filled =
      static_cast<double>(slice_.size()) / (config_.slice_events_per_column * camera_.size().width);
  const double span_s = to_seconds(t - slice_begin_);
  if (!(filled >= 1 || (filled >= kThinShare && span_s >= config_.short_slice_s) ||
        span_s >= config_.longest_slice_s))
    return {};
  if (slice_.size() < kFewestEvents) {
    slice_.clear();
    slice_begin_ = t;
    return {};
  }
  double age_s = 0;
  for (const FrontEvent& e : slice_) age_s += 1e-6 * (now_us - e.stamp_us);
  age_s /= static_cast<double>(std::max<std::size_t>(1, slice_.size()));
  compensate_rotation(age_s, now_us);
  field_->build(compensated_);
  Hypothesis prior{prior_};
  propagate(prior, since_);
  prior_ = prior.nav;
  elapsed_s_ += since_.dt_s;
  if (slices_ == 0)
    search_around_prior(age_s);
  else
    update_hypotheses(age_s);
  since_ = {};
  ++slices_;
  auto found = accept_best();
  slice_.clear();
  slice_begin_ = last_slice_ = t;
  return found;
}

void Relocalizer::search_around_prior(double age_s) {
  const double widening = std::pow(kWidening, std::clamp(searches_ - kSameWidth, 0, kMostWidenings));
  Matrix6d covariance = widening * widening * prior_covariance_;
  covariance.topLeftCorner<3, 3>().diagonal().array() += std::pow(config_.velocity_sigma_m_s * elapsed_s_, 2);
  select_search_points(prior_.T_map_body);
  hypotheses_.clear();
  if (points_.empty()) return;
  const SearchView view{*field_, camera_, T_body_cam_, points_};
  for (const PoseGuess& guess :
       search_.search(view, prior_.T_map_body, covariance, static_cast<unsigned>(1 + searches_))) {
    Hypothesis c{prior_};
    // The slice shows where the body was age_s ago.
    c.nav.T_map_body = {guess.T_map_body.q * so3::exp(age_s * rate_),
                        guess.T_map_body.p + age_s * prior_.velocity};
    if (hypotheses_.size() < static_cast<std::size_t>(config_.sharpened)) refine(c);
    c.mean_concentration = c.concentration;
    c.mean_support = c.support;
    c.position_variance = std::pow(kPositionSigma_m, 2);
    c.rotation_variance = std::pow(kRotationSigma_rad, 2);
    c.velocity_variance = config_.velocity_sigma_m_s * config_.velocity_sigma_m_s;
    hypotheses_.push_back(c);
  }
}

void Relocalizer::update_hypotheses(double age_s) {
  for (Hypothesis& c : hypotheses_) propagate(c, since_);
  if (hypotheses_.empty()) return;
  select_search_points(hypotheses_.front().nav.T_map_body);
  if (points_.empty()) return;
  const SearchView view{*field_, camera_, T_body_cam_, points_};
  for (std::size_t i = 0; i < hypotheses_.size(); ++i) {
    Hypothesis& c = hypotheses_[i];
    const Hypothesis predicted = c;
    const bool one_by_one = i < static_cast<std::size_t>(config_.sharpened);
    if (one_by_one) refine(c);
    if (!one_by_one || c.concentration < config_.least_concentration) {
      // Perhaps the prediction was too far off: from where the slice's edges are.
      Hypothesis other = predicted;
      other.concentration = other.support = 0;
      const Eigen::Vector3d rate = has_imu_ ? rate_ : predicted.rate;
      const Pose& now = predicted.nav.T_map_body;
      const Pose then{now.q * so3::exp(-age_s * rate), now.p - age_s * predicted.nav.velocity};
      Vector6d information;
      information.head<3>().setConstant(1 / predicted.position_variance);
      information.tail<3>().setConstant(1 / (predicted.rotation_variance + std::pow(kRotationSigma_rad, 2)));
      const PoseGuess guess =
          search_.refine(view, then, information.asDiagonal(), 2 * config_.search.coarse_px);
      correct_by_displacement(other, guess.T_map_body.minus(then));
      if (one_by_one) refine(other);
      if (!one_by_one || other.support > c.support) c = other;
    }
    const Eigen::Quaterniond dq = predicted.nav.T_map_body.q.conjugate() * c.nav.T_map_body.q;
    if (!has_imu_) c.rate += (slices_ == 1 ? 1 : 0.5) / std::max(since_.dt_s, 1e-3) * so3::log(dq);
  }
  for (Hypothesis& c : hypotheses_) {
    c.mean_concentration += kNewest * (c.concentration - c.mean_concentration);
    c.mean_support += kNewest * (c.support - c.mean_support);
  }
  std::stable_sort(hypotheses_.begin(), hypotheses_.end(),
                   [](const Hypothesis& a, const Hypothesis& b) { return a.mean_support > b.mean_support; });
  merge_duplicates();
}

/// Position and velocity by a Kalman filter of two states an axis, rotation likewise by one.
void Relocalizer::correct_by_displacement(Hypothesis& c, const Vector6d& moved) const {
  const double measured = std::pow(kPositionSigma_m, 2), turned = std::pow(kRotationSigma_rad, 2);
  const double gain = 1 / (c.position_variance + measured);
  c.nav.T_map_body.p += gain * c.position_variance * moved.head<3>();
  c.nav.velocity += gain * c.covariance * moved.head<3>();
  c.velocity_variance -= gain * c.covariance * c.covariance;
  c.covariance *= gain * measured;
  c.position_variance *= gain * measured;
  const double turn = c.rotation_variance / (c.rotation_variance + turned);
  c.nav.T_map_body.q = (c.nav.T_map_body.q * so3::exp(turn * moved.tail<3>())).normalized();
  c.rotation_variance *= turned / (c.rotation_variance + turned);
}

/// Candidates that have come together go on as one. Sorted, best first.
void Relocalizer::merge_duplicates() {
  std::vector<Hypothesis> different;
  for (const Hypothesis& c : hypotheses_)
    if (std::none_of(different.begin(), different.end(), [&](const Hypothesis& other) {
          const Vector6d d = c.nav.T_map_body.minus(other.nav.T_map_body);
          return d.head<3>().norm() < kOne_m && d.tail<3>().norm() < kOne_rad &&
                 (c.nav.velocity - other.nav.velocity).norm() < kOne_m_s;
        }))
      different.push_back(c);
  hypotheses_ = std::move(different);
}

/// Each event at its own time against the contours, under gates that close; pose and velocity are those that
/// the last parts agree upon.
void Relocalizer::refine(Hypothesis& c) {
  using Vector9d = Eigen::Matrix<double, 9, 1>;
  using Matrix9d = Eigen::Matrix<double, 9, 9>;
  const ContourView view{index_.map(), pieces_, camera_, T_body_cam_, EventAlignmentConfig{}.map_sigma_m};
  const auto& chosen = all_visible_->choose(c.nav.T_map_body * T_body_cam_);
  const NavState from = c.nav;
  const std::size_t n = std::min(intervals_.size(), static_cast<std::size_t>(1 + 2 * slices_));
  Vector9d sure;
  sure.segment<3>(0).setConstant(1 / (kSharpenSigma_m * kSharpenSigma_m));
  sure.segment<3>(3).setConstant(1 / (kSharpenSigma_rad * kSharpenSigma_rad));
  sure.segment<3>(6).setConstant(std::pow(slices_ < 3 ? config_.velocity_sigma_m_s : kSharpenSigma_m_s, -2));
  const Matrix6d known = Matrix6d::Zero();
  for (const auto& stage : stages_)
    for (int step = 0; step < kSteps; ++step) {
      Vector9d off;
      off << c.nav.T_map_body.minus(from.T_map_body), c.nav.velocity - from.velocity;
      Matrix9d H = sure.asDiagonal();
      Vector9d b = -sure.cwiseProduct(off);
      stage->forget();
      NavState nav = c.nav;
      double age_s = 0, matched = 0, asked = 0;
      for (std::size_t k = 0; k < n; ++k) {
        const Interval& interval = intervals_[intervals_.size() - 1 - k];
        const double span_s = interval.motion.dt_s;
        project_contours(view, chosen, {nav.T_map_body, nav.velocity, has_imu_ ? interval.rate : c.rate},
                         span_s, samples_);
        const EventAlignmentResult r =
            stage->align({interval.events, interval.now_us, span_s, samples_, known});
        c.concentration = r.slope;
        matched += r.matched_events;
        asked += static_cast<double>(samples_.size());
        Eigen::Matrix<double, 6, 9> J = Eigen::Matrix<double, 6, 9>::Zero();
        J.block<3, 3>(0, 0).setIdentity();
        J.block<3, 3>(0, 6) = -age_s * Eigen::Matrix3d::Identity();
        J.block<3, 3>(3, 3) = (nav.T_map_body.q.conjugate() * c.nav.T_map_body.q).toRotationMatrix();
        H += J.transpose() * r.information * J;
        b += J.transpose() * r.vector;
        age_s += span_s;
        nav = propagate_back(c, nav, interval.motion);
      }
      c.support = c.concentration * matched / std::max(1.0, asked);
      const Vector9d d = H.ldlt().solve(b);
      if (!d.allFinite() || (stage == stages_.back() && step + 1 == kSteps)) continue;
      c.nav.T_map_body = c.nav.T_map_body.plus(d.head<6>());
      c.nav.velocity += d.tail<3>();
    }
}

std::optional<Relocalizer::Found> Relocalizer::accept_best() {
  if (slices_ < config_.least_slices) return {};
  if (!hypotheses_.empty()) {
    const Hypothesis& best = hypotheses_.front();
    const auto rival = std::find_if(hypotheses_.begin(), hypotheses_.end(), [&](const Hypothesis& c) {
      const Vector6d d = c.nav.T_map_body.minus(best.nav.T_map_body);
      return d.head<3>().norm() >= kSame_m || d.tail<3>().norm() >= kSame_rad;
    });
    const double others = rival == hypotheses_.end() ? 0 : rival->mean_support;
    const bool gathers = best.mean_concentration >= config_.least_concentration &&
                         best.mean_support >= config_.least_lead * others;
    const bool alone = best.mean_concentration >= config_.low_concentration &&
                       best.mean_support >= config_.clear_lead * others;
    if (gathers || alone) {
      searching_ = false;
      return Found{best.nav, has_imu_ ? rate_ : best.rate};
    }
    if (slices_ < (best.mean_concentration >= config_.low_concentration ? config_.most_slices
                                                                        : config_.least_slices + 1))
      return {};
  }
  // Anew, from where the prior has come to, and wider.
  slices_ = 0;
  ++searches_;
  return {};
}

}  // namespace evpose
