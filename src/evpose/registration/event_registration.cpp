// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/event_registration.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "evpose/core/config.h"

namespace evpose {
namespace {

constexpr double kContourPrior = 0.5;  // an event in the gate is of the contour; where polarity does not tell
// Samples stand at least 4 px apart along a contour: each answers for half of that to either side, and more
// where samples are left out.
constexpr double kHalfLength_px = 4;
// Events as near to two contours as this are left out. On most recordings the pose is a little better with
// them, but where the calibration is wrong they hold a wrong pose together (a focal length off by 5 % is then
// called tracking).
constexpr double kAmbiguity_px = 1;
constexpr double kFullDelay_px_s =
    20;  // below this flow the edge delay fades out: noise, not the edge, triggers
constexpr double kLargestDelay_px = 0.5;  // by so much events may come after a contour and still be found
// So far beside the expected bands events matter: the prediction may differ from the forecast by 1.5 px, and
// neighbours support each other in the noise filter.
constexpr float kInterestMargin_px = 2.5F;

constexpr std::uint32_t kProbeEvery = 8;  // calls after which a sample's owned area is probed again
constexpr int kDirections = 4;

/// Of the image, whose events of one direction share an error: a cluster.
struct Cells {
  explicit Cells(ImageSize size)
      : edge_px(BlockThinning::block_px(size)),
        columns(size.width / edge_px + 1),
        rows(size.height / edge_px + 1) {}
  std::size_t clusters() const { return static_cast<std::size_t>(columns * rows * kDirections); }

  int edge_px, columns, rows;
};

}  // namespace

void describe(ConfigTable& table, EventRegistrationConfig& c) {
  table.add("gate_px", c.gate_px, "px",
            "events within this, joined with two sigma of the map, belong to a contour", {0.1, 50});
  table.add("event_sigma_px", c.event_sigma_px, "px", "scatter of a contour's events", {0.05, 10});
  table.add("correlated_sigma_px", c.correlated_sigma_px, "px", "error that neighbouring events share",
            {0, 10});
  table.add("correlation_time_s", c.correlation_time_s, "s", "how long such an error lasts", {0, 100});
  table.add("map_sigma_m", c.map_sigma_m, "m", "error across the contour of map points that state none",
            {0, 1});
  table.add("edge_delay", c.edge_delay, "take off that events come after the contour");
  table.add("polarity", c.polarity, "leave out events whose polarity contrast and flow exclude");
  table.add("buffer_sigma", c.buffer_sigma, "",
            "both polarities count where the normal flow is less sigma from zero (adaptive buffer zone)",
            {0, 100});
  table.add("ego_motion_test", c.ego_motion_test,
            "mistrust cells whose events do not move as the ego-motion says");
  table.add("contrast_threshold", c.contrast_threshold, "",
            "of the camera: log luminance step that makes an event", {0.01, 2});
}

EventRegistration::EventRegistration(ImageSize size, const EventRegistrationConfig& config,
                                     std::uint32_t segments)
    : size_(size),
      config_(config),
      index_(size, kHalfLength_px, kAmbiguity_px),
      contrast_(segments, config.contrast_threshold, config.trail_filter),
      trust_(config.judge_contours ? segments : 0),
      lasting_(config.judge_contours ? 0 : segments),
      sums_(config.contrast_band_px, config.polarity),
      clusters_(Cells(size).clusters()) {}

bool EventRegistration::polarity_is_wrong(const ContourSample& s, int sign) const {
  const double steps = s.normal_side * contrast_.steps(s.segment);
  return sign * steps < 0 && std::abs(steps) >= ContrastMemory::kSureSteps && contrast_.known(s.segment) &&
         std::abs(s.speed_px_s) >= config_.buffer_sigma * s.speed_sigma_px_s;
}

/// Speeds of a contour across itself and of the image there, as they may be where the velocity is unsure: a
/// contour that is thought to stand still by mistake has to be able to say so.
struct Speeds {
  double across_px_s, flow_px_s;
};
Speeds possible_speeds(const ContourSample& s) {
  const double unsure = s.speed_sigma_px_s * s.speed_sigma_px_s;
  return {std::sqrt(s.speed_px_s * s.speed_px_s + unsure), std::sqrt(s.flow_px_s * s.flow_px_s + unsure)};
}

/// Share of the contour's among the events in its gate whose polarity is not excluded.
double EventRegistration::contour_share(const ContourSample& s) const {
  if (!config_.polarity_tells_clutter) return kContourPrior;
  const Speeds speeds = possible_speeds(s);
  return contrast_.contour_share(s.segment, speeds.across_px_s, speeds.flow_px_s);
}

FilteredEdgeDelay::Value EventRegistration::edge_delay(const ContourSample& s) const {
  if (!config_.edge_delay) return {};
  const double speed = std::abs(s.speed_px_s), fade = std::min(1.0, speed / kFullDelay_px_s);
  const auto [full, sigma_px] = contrast_.edge_delay(s.segment, speed);
  return {{fade * full.on_px, fade * full.off_px}, sigma_px};
}

/// Half width of the gate, px.
double EventRegistration::gate_of(const ContourSample& s) const {
  return std::sqrt(config_.gate_px * config_.gate_px + 4 * s.map_sigma_px * s.map_sigma_px);
}

/// Gate, edge delay, weight and excluded polarities of one sample.
EventRule EventRegistration::rule_of(const ContourSample& s, double share, const EdgeDelay& delay) const {
  const double gate = gate_of(s);
  const double pose_variance = std::max(0.0, s.jacobian.dot(pose_covariance_ * s.jacobian));
  const double variance =
      config_.event_sigma_px * config_.event_sigma_px + pose_variance + s.map_sigma_px * s.map_sigma_px;
  const double odds = share / std::sqrt(2 * M_PI * variance) * (2 * gate) / (1 - share);
  const int forward = s.speed_px_s > 0 ? 1 : -1;
  return {static_cast<float>(forward * delay.on_px),
          static_cast<float>(forward * delay.off_px),
          static_cast<float>(gate),
          static_cast<float>(-0.5 / variance),
          static_cast<float>(odds),
          static_cast<std::int8_t>(polarity_is_wrong(s, forward)),
          static_cast<std::int8_t>(polarity_is_wrong(s, -forward)),
          static_cast<std::int8_t>(forward)};
}

/// What pixels the samples answer for.
void EventRegistration::begin(std::span<const ContourSample> samples, double span_s,
                              const BlockThinning& thinning, const Matrix6d& pose_covariance) {
  samples_ = samples;
  pose_covariance_ = pose_covariance;
  bands_.resize(samples.size());
  asked_.assign(samples.size(), 1);
  all_asked_ = thinning.takes_all();
  for (std::size_t i = 0; !all_asked_ && i < samples.size(); ++i)
    asked_[i] = thinning.takes(samples[i].pixel);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const ContourSample& s = samples[i];
    const Eigen::Vector2f pixel = s.pixel.cast<float>(), normal = s.normal_px.cast<float>();
    bands_[i] = {pixel.x(),
                 pixel.y(),
                 normal.x(),
                 normal.y(),
                 static_cast<float>(1e-6 * s.speed_px_s),
                 static_cast<float>(1e-12 * s.curvature_px_s2),
                 static_cast<float>(std::max(gate_of(s), config_.contrast_band_px) + kLargestDelay_px)};
  }
  index_.build(bands_, static_cast<float>(1e6 * span_s));
  found_.clear();
  looked_at_ = 0;
  sums_.begin(samples.size());
  members_.resize(samples.size());
}

bool EventRegistration::expect(const RegistrationForecast& forecast, InterestMap* interest) {
  begin(forecast.samples, forecast.span_s, forecast.thinning, forecast.pose_covariance);
  index_.mark(asked_, kInterestMargin_px, static_cast<float>(forecast.aside_px), interest);
  return true;
}

/// Of each event that a band owns, what it says is summed up at once.
void EventRegistration::look_at(std::span<const FilteredEvent> events, std::uint32_t now_us) {
  const std::size_t before = found_.size();
  index_.find_all(events, looked_at_, now_us, &found_);
  looked_at_ = events.size();
  if (!all_asked_) forget_unasked(before);
  for (std::size_t k = before; k < found_.size(); ++k) {
    const auto& [number, owner] = found_[k];
    const auto sample = static_cast<std::size_t>(owner.band);
    if (!sums_.has_rule(sample)) make_rule(sample);
    sums_.add(owner, static_cast<float>(now_us - events[number].stamp_us), events[number].on != 0);
  }
}

/// Of the events found from number `first` on, those of contours whose other events were not looked at: they
/// would tell of a step that is too small.
void EventRegistration::forget_unasked(std::size_t first) {
  const auto unasked = [this](const AssociationIndex::Found& f) {
    return asked_[static_cast<std::size_t>(f.owner.band)] == 0;
  };
  found_.erase(std::remove_if(found_.begin() + static_cast<std::ptrdiff_t>(first), found_.end(), unasked),
               found_.end());
}

/// Of a sample that has got its first event.
void EventRegistration::make_rule(std::size_t sample) {
  const ContourSample& s = samples_[sample];
  const double share = contour_share(s), clutter = config_.polarity_tells_clutter ? (1 - share) / share : 0;
  const FilteredEdgeDelay::Value delay = edge_delay(s);
  sums_.set_rule(sample, rule_of(s, share, delay.delay));
  members_[sample] = {cluster_of(s), s.map_sigma_px * s.map_sigma_px, delay.sigma_px * delay.sigma_px,
                      clutter * clutter};
}

/// The samples stand where the prediction has them, not where the forecast had them.
void EventRegistration::shift_sums(const RegistrationProblem& p) {
  if (p.forecast)
    for (const std::uint32_t i : sums_.ruled()) {
      const Vector6d& J = p.samples[i].jacobian;
      sums_.set_shift(i, {static_cast<float>(J.dot(p.forecast->pose)),
                          static_cast<float>(-1e-6 * J.head<3>().dot(p.forecast->velocity))});
    }
  if (sums_.follow(static_cast<float>(1e6 * p.span_s))) return;
  sums_.forget_events();
  for (const auto& [k, owner] : found_) {
    const FilteredEvent& e = p.events[k];
    sums_.add_shifted(owner, static_cast<float>(p.now_us - e.stamp_us), e.on != 0);
  }
}

EventVerdict EventRegistration::verdict(const EventRule& rule, float distance, bool on) const {
  if (std::abs(distance) > rule.gate) return EventVerdict::beside;
  if (config_.polarity && rule.excludes(on)) return EventVerdict::wrong_polarity;
  return rule.wrong_on || rule.wrong_off ? EventVerdict::predicted : EventVerdict::contour;
}

/// At each event, for what is asked of it beside the sums.
void EventRegistration::look_again(const RegistrationProblem& p) {
  if (p.verdicts) p.verdicts->assign(p.events.size(), EventVerdict::elsewhere);
  for (const auto& [k, owner] : found_) {
    const FilteredEvent& e = p.events[k];
    const auto sample = static_cast<std::size_t>(owner.band);
    const float d = sums_.distance(owner, static_cast<float>(p.now_us - e.stamp_us), e.on != 0);
    const EventVerdict v = verdict(sums_.rule(sample), d, e.on != 0);
    if (p.verdicts) (*p.verdicts)[k] = v;
    if (!config_.ego_motion_test || (v != EventVerdict::contour && v != EventVerdict::predicted)) continue;
    const AssociationBand& band = bands_[sample];
    const FlowMonitor::Answer answer = flow_.compare(*p.surface, e, band.nx, band.ny, 1e6F * band.speed);
    Cluster& cluster = clusters_[members_[sample].cluster];
    cluster.agree += answer == FlowMonitor::Answer::agrees;
    cluster.differ += answer == FlowMonitor::Answer::differs;
  }
}

/// What the events say of the contours one by one.
void EventRegistration::judge_contours(const RegistrationProblem& p) {
  trust_.advance(p.span_s);
  for (const std::uint32_t i : sums_.ruled())
    if (sums_.sum(i).events > 0) trust_.add(p.samples[i].segment, sums_.sum(i).gate());
}

/// Whether the sample's band owns one probe position in it, a different one at every call.
bool EventRegistration::owns_probe(std::size_t sample, float half_span_us) const {
  const auto in_unit_interval = [](float step, std::uint64_t k) {  // -1..1, evenly: the R2 sequence
    const float v = step * static_cast<float>(k % 4096);
    return 2 * (v - std::floor(v)) - 1;
  };
  const std::uint64_t k = 17 * sample + call_ / kProbeEvery;
  const AssociationBand& s = bands_[sample];
  const float along = in_unit_interval(0.7548777F, k) * static_cast<float>(kHalfLength_px);
  const float across = in_unit_interval(0.5698403F, k) * static_cast<float>(config_.contrast_band_px) -
                       (s.speed - s.curvature * half_span_us) * half_span_us;
  const float x = s.x + across * s.nx - along * s.ny, y = s.y + across * s.ny + along * s.nx;
  if (!(x >= 0 && y >= 0 && x <= static_cast<float>(size_.width - 1) &&
        y <= static_cast<float>(size_.height - 1)))
    return false;
  return index_.find(x, y, half_span_us).band == static_cast<std::int32_t>(sample);
}

/// By what each sample asked for.
void EventRegistration::learn_lasting_offsets(std::span<const ContourSample> samples, double span_s) {
  if (config_.judge_contours) return;
  asking_.clear();
  for (const SampleOffset& o : offsets_) {
    const ContourSample& s = samples[o.sample];
    const double weight = sums_.sum(o.sample).weight;
    asking_.push_back({s.segment, s.normal_side, weight, weight * o.offset_px, s.map_sigma_px, &s.jacobian});
  }
  lasting_.judge(span_s, asking_);
}

/// Tells the contrast memory what area each segment has swept, owned length times way, and what events fell
/// there.
void EventRegistration::learn(std::span<const ContourSample> samples, double span_s) {
  if (!std::exchange(learns_, false)) return;
  ++call_;
  learn_lasting_offsets(samples, span_s);
  const auto half_span_us = static_cast<float>(0.5e6 * span_s);
  const double swept_s = kProbeEvery * span_s;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (asked_[i] == 0) continue;
    const ContourSample& s = samples[i];
    // Probes tell on average what share of its area a band owns; a part of the bands is probed in each call.
    if ((i + call_) % kProbeEvery == 0 && owns_probe(i, half_span_us))
      contrast_.sweep(s.segment, 2 * kHalfLength_px * std::abs(s.speed_px_s) * swept_s);
    const EventSum& sum = sums_.sum(i);
    const Speeds speeds = possible_speeds(s);
    contrast_.count_in_gate(s.segment, s.normal_side * sum.gate_net, sum.gate_all,
                            speeds.across_px_s * span_s, speeds.flow_px_s * span_s);
    if (sum.net != 0) contrast_.count(s.segment, s.normal_side * sum.net);
  }
}

/// Cell and 45 deg bin of the contour's direction.
std::uint32_t EventRegistration::cluster_of(const ContourSample& s) const {
  const Cells cells(size_);
  const int cx = std::clamp(static_cast<int>(s.pixel.x()) / cells.edge_px, 0, cells.columns - 1);
  const int cy = std::clamp(static_cast<int>(s.pixel.y()) / cells.edge_px, 0, cells.rows - 1);
  const Eigen::Vector2d n = s.normal_px.y() < 0 ? Eigen::Vector2d(-s.normal_px) : s.normal_px;
  const int bin = n.x() >= 0 ? (n.y() < n.x() ? 0 : 1) : (n.y() > -n.x() ? 2 : 3);
  return static_cast<std::uint32_t>((cy * cells.columns + cx) * kDirections + bin);
}

/// Finds the clusters that hold events which do not move as the ego-motion says (EV-Pose 5.3).
void EventRegistration::test_ego_motion(const RegistrationProblem& p) {
  flow_.advance(p.span_s);
  for (std::uint32_t number = 0; number < clusters_.size(); ++number) {
    Cluster& c = clusters_[number];
    if (c.weight == 0) continue;
    flow_.add(number, c.agree, c.differ);
    c.trust = flow_.trust(number);
  }
}

void EventRegistration::sum_clusters() {
  for (const std::uint32_t i : sums_.ruled()) {
    const Membership& m = members_[i];
    const double weight = sums_.sum(i).weight;
    Cluster& c = clusters_[m.cluster];
    c.weight += weight;
    c.clutter += weight * m.clutter;
    c.map_variance += weight * m.map_variance;
    c.delay_variance += weight * m.delay_variance;
  }
}

/// Normal equations of the samples. Events of one cluster share errors: its information is capped.
void EventRegistration::sum_information(const RegistrationProblem& p, RegistrationResult* result) {
  const double event_variance = config_.event_sigma_px * config_.event_sigma_px;
  // Of a cell that is looked at now and then, an error that lasts is seen as often less.
  const double repeats =
      std::max(1.0, p.thinning.share() * config_.correlation_time_s / std::max(p.span_s, 1e-6));
  const bool corrected = config_.gate_truncation_correction;
  const double correction = corrected ? concentration_.value() : 1;
  const double gathered = corrected ? concentration_.share_of_information() : 1;
  double weight = 0, square = 0;
  offsets_.clear();
  for (const std::uint32_t i : sums_.ruled()) {
    const EventSum& sum = sums_.sum(i);
    if (sum.events == 0) continue;
    ++result->inliers;
    result->events += sum.events;
    weight += sum.weight;
    square += sum.square;
    const Cluster& c = clusters_[members_[i].cluster];
    const double own = event_variance / c.weight;
    // Texture beside a contour moves along with it and draws the mean of its events.
    const double by_clutter = 1 + c.clutter / c.weight;
    const double shared = repeats * (config_.correlated_sigma_px * config_.correlated_sigma_px * by_clutter +
                                     (c.map_variance + c.delay_variance) / c.weight);
    const ContourSample& s = p.samples[i];
    const double borne_out =
        config_.judge_contours ? trust_.trust(s.segment, concentration_.value()) : lasting_.trust(s.segment);
    const double scale = gathered * borne_out * c.trust * own / (own + shared) / event_variance;
    if (c.trust < 0.5) result->other_motion += sum.events;
    result->information.noalias() += (scale * correction * sum.weight) * s.jacobian * s.jacobian.transpose();
    result->vector -= scale * sum.offset * s.jacobian;
    if (sum.weight > 0)
      offsets_.push_back({i, -sum.offset / (correction * sum.weight), scale * correction * sum.weight});
  }
  result->residual = weight > 0 ? std::sqrt(std::max(0.0, square) / weight) : 0;
}

void EventRegistration::mark_other_motion(const RegistrationProblem& p) {
  for (const auto& [k, owner] : found_) {
    EventVerdict& verdict = (*p.verdicts)[k];
    if (verdict != EventVerdict::contour && verdict != EventVerdict::predicted) continue;
    if (clusters_[members_[static_cast<std::size_t>(owner.band)].cluster].trust < 0.5)
      verdict = EventVerdict::other_motion;
  }
}

RegistrationResult EventRegistration::measure(const RegistrationProblem& p) {
  EVPOSE_CHECK(!config_.ego_motion_test || p.surface != nullptr);
  RegistrationResult result;
  if (!p.forecast) begin(p.samples, p.span_s, p.thinning, p.pose_covariance);
  look_at(p.events, p.now_us);
  shift_sums(p);
  concentration_.decay(p.span_s);
  for (const std::uint32_t i : sums_.ruled()) concentration_.add(sums_.sum(i).gate());
  if (config_.judge_contours) judge_contours(p);
  sum_clusters();
  if (p.verdicts || config_.ego_motion_test) look_again(p);
  if (config_.ego_motion_test) test_ego_motion(p);
  sum_information(p, &result);
  if (p.verdicts) mark_other_motion(p);
  for (const std::uint32_t i : sums_.ruled()) clusters_[members_[i].cluster] = {};
  result.wrong_polarity = sums_.wrong_polarity();
  result.points = static_cast<int>(p.samples.size());
  result.gate_concentration = concentration_.known() ? concentration_.value() : 0;
  result.consistent = concentration_.consistent() && lasting_.agree();
  learns_ = true;
  if (!p.forecast) learn(p.samples, p.span_s);
  return result;
}

}  // namespace evpose
