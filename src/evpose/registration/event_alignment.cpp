// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/event_alignment.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/config.h"

namespace evpose {
namespace {

constexpr double kEdgePrior = 0.5;  // an event in the gate is of the contour rather than clutter
constexpr double kGateRim = 0.8;    // events beyond this share of the gate tell the density at it
constexpr double kSlope_s = 0.05;   // memory of the slope ...
constexpr double kLongest_s = 1;    // ... and while few events have told it
constexpr double kLeastSlope = 0.15;
constexpr double kLatest_px = 0.5;  // by so much events may come after a contour and still be found
constexpr std::uint32_t kShareOut = 4;
constexpr double kCaptured = 0.3;  // slope of events that gather at the contours
constexpr double kTelling = 50;    // events' weight from which on the slope is believed

}  // namespace

void describe(ConfigTable& table, EventAlignmentConfig& c) {
  table.add("gate_px", c.gate_px, "px",
            "events within this, joined with two sigma of the map, belong to a contour", {0.1, 50});
  table.add("widest_gate_px", c.widest_gate_px, "px",
            "an unsure prediction opens the gate by two sigma, but no further than to this", {0.1, 50});
  table.add("event_sigma_px", c.event_sigma_px, "px", "scatter of a contour's events", {0.05, 10});
  table.add("shared_sigma_px", c.shared_sigma_px, "px", "error that neighbouring events share", {0, 10});
  table.add("shared_s", c.shared_s, "s", "how long a shared error lasts", {0, 100});
  table.add("map_sigma_m", c.map_sigma_m, "m", "error across the contour of map points that state none",
            {0, 1});
  table.add("lateness", c.lateness, "events come after the contour, by contrast and polarity");
  table.add("lateness_from_px_s", c.lateness_from_px_s, "px/s", "lateness fades out below this flow",
            {0, 1e4});
  table.add("polarity", c.polarity, "leave out events whose polarity contrast and flow exclude");
  table.add("sure_steps", c.sure_steps, "", "... where the contrast is at least so many thresholds",
            {0, 100});
  table.add("buffer_sigma", c.buffer_sigma, "", "... and the normal flow so many sigma from zero", {0, 100});
  table.add("count_px", c.count_px, "px", "events so near teach the contrast", {0.1, 10});
  table.group("contrast", c.contrast);
  table.group("flow", c.flow);
  table.add("strip_px", c.strip_px, "px", "half length along the contour that a sample stands for", {1, 64});
  table.add("ambiguity_px", c.ambiguity_px, "px",
            "events between two contours as similarly near as this are left out", {0, 50});
  table.add("cluster_px", c.cluster_px, "px", "cells whose events share an error, at 640 px width",
            {4, 4096});
  table.add("honest_slope", c.honest_slope, "take off the information that the gate hides");
}

EventAlignment::EventAlignment(ImageSize size, const EventAlignmentConfig& config, std::uint32_t pieces)
    : size_(size),
      config_(config),
      index_(size, config.strip_px, config.ambiguity_px),
      contrast_(pieces, config.contrast),
      flow_(config.flow) {}

double EventAlignment::Slope::value() const {
  return weight > 0 ? std::clamp((inside - at_gate) / weight, kLeastSlope, 1.0) : 1;
}

/// Events spread evenly over the gate do not tell of contours: the pose is not where it is thought to be.
bool EventAlignment::captured() const { return slope_.weight < kTelling || slope_.value() >= kCaptured; }

bool EventAlignment::polarity_is_wrong(const ContourSample& s, int sign) const {
  const double steps = contrast_.steps(s.piece);
  return sign * steps < 0 && std::abs(steps) >= config_.sure_steps && contrast_.known(s.piece) &&
         std::abs(s.speed_px_s) >= config_.buffer_sigma * s.speed_sigma_px_s;
}

/// Gates, lateness and excluded polarities of the samples, and what pixels they answer for.
void EventAlignment::prepare(const EventAlignmentProblem& p) {
  const std::size_t n = p.samples.size();
  strips_.resize(n);
  lines_.resize(n);
  const double event_variance = config_.event_sigma_px * config_.event_sigma_px;
  const double widest = std::max(config_.gate_px, config_.widest_gate_px);
  for (std::size_t i = 0; i < n; ++i) {
    const ContourSample& s = p.samples[i];
    const double pose_variance = std::max(0.0, s.jacobian.dot(p.pose_covariance * s.jacobian));
    const double own = std::min(config_.gate_px + 2 * std::sqrt(pose_variance), widest);
    const double gate = std::sqrt(own * own + 4 * s.map_sigma_px * s.map_sigma_px);
    const Eigen::Vector2f pixel = s.pixel.cast<float>(), normal = s.normal_px.cast<float>();
    strips_[i] = {pixel.x(),
                  pixel.y(),
                  normal.x(),
                  normal.y(),
                  static_cast<float>(1e-6 * s.speed_px_s),
                  static_cast<float>(1e-12 * s.curvature_px_s2),
                  static_cast<float>(std::max(gate, config_.count_px) + kLatest_px)};
    const double variance = event_variance + pose_variance + s.map_sigma_px * s.map_sigma_px;
    const double odds = kEdgePrior / std::sqrt(2 * M_PI * variance) * (2 * gate) / (1 - kEdgePrior);
    const int forward = s.speed_px_s > 0 ? 1 : -1;
    const double fade = std::min(1.0, std::abs(s.speed_px_s) / std::max(config_.lateness_from_px_s, 1e-9));
    const ContrastMemory::Lateness late = contrast_.lateness(s.piece);
    const double towards = config_.lateness ? std::copysign(fade, s.speed_px_s) : 0;
    lines_[i] = {static_cast<float>(towards * late.on_px),
                 static_cast<float>(towards * late.off_px),
                 static_cast<float>(gate),
                 static_cast<float>(-0.5 / variance),
                 static_cast<float>(odds),
                 static_cast<std::int8_t>(polarity_is_wrong(s, forward)),
                 static_cast<std::int8_t>(polarity_is_wrong(s, -forward)),
                 static_cast<std::int8_t>(forward)};
  }
  index_.build(strips_, static_cast<float>(1e6 * p.span_s));
}

void EventAlignment::sum_events(const EventAlignmentProblem& p, EventAlignmentResult* result) {
  sums_.assign(p.samples.size(), {});
  const double keep = std::clamp(2 * kTelling / std::max(slope_.weight, 1e-9), std::exp(-p.span_s / kSlope_s),
                                 std::exp(-p.span_s / kLongest_s));
  slope_ = {keep * slope_.weight, keep * slope_.inside, keep * slope_.at_gate};
  const auto count_px = static_cast<float>(config_.count_px);
  if (p.verdicts) p.verdicts->assign(p.events.size(), EventVerdict::elsewhere);
  if (p.verdicts) owners_.assign(p.events.size(), -1);
  index_.find_all(p.events, p.now_us, &found_);
  for (const StripIndex::Found& found : found_) {
    const std::size_t k = found.event;
    const StripIndex::Owner& owner = found.owner;
    const FrontEvent& e = p.events[k];
    const auto verdict = [&](EventVerdict v) {
      if (p.verdicts) (*p.verdicts)[k] = v, owners_[k] = owner.strip;
    };
    const Line& line = lines_[static_cast<std::size_t>(owner.strip)];
    Sum& sum = sums_[static_cast<std::size_t>(owner.strip)];
    const float d = owner.distance + (e.on ? line.late_on : line.late_off);
    if (std::abs(d) <= count_px) sum.net += e.on ? line.forward : -line.forward;
    verdict(EventVerdict::beside);
    if (std::abs(d) > line.gate) continue;
    if (config_.polarity && (e.on ? line.wrong_on : line.wrong_off)) {
      verdict(EventVerdict::wrong_polarity);
      ++result->wrong_polarity;
      continue;
    }
    if (p.surface && config_.flow.on) {
      const Strip& strip = strips_[static_cast<std::size_t>(owner.strip)];
      const FlowMonitor::Answer answer = flow_.ask(*p.surface, e.x, e.y, e.on ? Polarity::on : Polarity::off,
                                                   e.stamp_us, strip.nx, strip.ny, 1e6F * strip.speed);
      sum.agree += answer == FlowMonitor::Answer::agrees;
      sum.differ += answer == FlowMonitor::Answer::differs;
    }
    verdict(line.wrong_on || line.wrong_off ? EventVerdict::predicted : EventVerdict::contour);
    const float odds = line.odds * std::exp(line.exponent * d * d), w = odds / (1 + odds);
    sum.weight += w;
    sum.offset += w * d;
    sum.square += w * d * d;
    ++sum.events;
    slope_.weight += w;
    slope_.inside += w + 2 * w * (1 - w) * d * d * line.exponent;
    if (std::abs(d) > kGateRim * line.gate) slope_.at_gate += w * std::abs(d) / ((1 - kGateRim) * line.gate);
  }
}

/// Whether the strip owns one place in it, another at every call.
bool EventAlignment::owns_a_place(std::size_t sample, float half_span_us) const {
  const auto share = [](float step, std::uint64_t k) {
    const float v = step * static_cast<float>(k % 4096);
    return 2 * (v - std::floor(v)) - 1;
  };
  const std::uint64_t k = 17 * sample + call_ / kShareOut;
  const Strip& s = strips_[sample];
  const float along = share(0.7548777F, k) * static_cast<float>(config_.strip_px);
  const float across = share(0.5698403F, k) * static_cast<float>(config_.count_px) -
                       (s.speed - s.curvature * half_span_us) * half_span_us;
  const float x = s.x + across * s.nx - along * s.ny, y = s.y + across * s.ny + along * s.nx;
  if (!(x >= 0 && y >= 0 && x <= static_cast<float>(size_.width - 1) &&
        y <= static_cast<float>(size_.height - 1)))
    return false;
  return index_.find(x, y, half_span_us).strip == static_cast<std::int32_t>(sample);
}

/// Tells the contrast memory what area each piece has swept, owned length times way, and what events fell
/// there.
void EventAlignment::learn_contrast(const EventAlignmentProblem& p) {
  ++call_;
  const auto half_span_us = static_cast<float>(0.5e6 * p.span_s);
  const double swept_s = kShareOut * p.span_s;
  for (std::size_t i = 0; i < p.samples.size(); ++i) {
    const ContourSample& s = p.samples[i];
    // Places tell on average what share a strip owns; a part of the strips is asked in each call.
    if ((i + call_) % kShareOut == 0 && owns_a_place(i, half_span_us))
      contrast_.sweep(s.piece, 2 * config_.strip_px * std::abs(s.speed_px_s) * swept_s);
    if (sums_[i].net != 0) contrast_.count(s.piece, sums_[i].net);
  }
}

/// Cell and 45 deg bin of the contour's direction.
std::uint32_t EventAlignment::cluster_of(const ContourSample& s) const {
  const int cell = std::max(1, config_.cluster_px * size_.width / 640);
  const int columns = size_.width / cell + 1, rows = size_.height / cell + 1;
  const int cx = std::clamp(static_cast<int>(s.pixel.x()) / cell, 0, columns - 1);
  const int cy = std::clamp(static_cast<int>(s.pixel.y()) / cell, 0, rows - 1);
  const Eigen::Vector2d n = s.normal_px.y() < 0 ? Eigen::Vector2d(-s.normal_px) : s.normal_px;
  const int bin = n.x() >= 0 ? (n.y() < n.x() ? 0 : 1) : (n.y() > -n.x() ? 2 : 3);
  return static_cast<std::uint32_t>((cy * columns + cx) * 4 + bin);
}

/// Numbers the samples' clusters and finds out which of them hold events that move otherwise.
void EventAlignment::watch_flow(const EventAlignmentProblem& p) {
  flow_.advance(p.span_s);
  cluster_numbers_.resize(p.samples.size());
  for (std::size_t i = 0; i < p.samples.size(); ++i) {
    if (sums_[i].events == 0) continue;
    cluster_numbers_[i] = cluster_of(p.samples[i]);
    flow_.add(cluster_numbers_[i], sums_[i].agree, sums_[i].differ);
  }
}

/// Events of one cluster share errors: its information is capped.
void EventAlignment::weigh_clusters(const EventAlignmentProblem& p, EventAlignmentResult* result) {
  const double event_variance = config_.event_sigma_px * config_.event_sigma_px;
  for (std::size_t i = 0; i < p.samples.size(); ++i) {
    if (sums_[i].events == 0) continue;
    const std::uint32_t number = cluster_numbers_[i];
    if (number >= clusters_.size()) clusters_.resize(number + 1);
    Cluster& c = clusters_[number];
    if (c.weight == 0) c.trust = flow_.trust(number);
    c.weight += sums_[i].weight;
    c.map_variance += sums_[i].weight * p.samples[i].map_sigma_px * p.samples[i].map_sigma_px;
  }

  const double repeats = std::max(1.0, config_.shared_s / std::max(p.span_s, 1e-6));
  const double slope = config_.honest_slope ? slope_.value() : 1;
  double weight = 0, square = 0;
  offsets_.clear();
  for (std::size_t i = 0; i < p.samples.size(); ++i) {
    const Sum& sum = sums_[i];
    if (sum.events == 0) continue;
    ++result->matched_samples;
    result->matched_events += sum.events;
    weight += sum.weight;
    square += sum.square;
    const Cluster& c = clusters_[cluster_numbers_[i]];
    const double own = event_variance / c.weight;
    const double shared =
        repeats * (config_.shared_sigma_px * config_.shared_sigma_px + c.map_variance / c.weight);
    const double scale = c.trust * own / (own + shared) / event_variance;
    if (c.trust < 0.5) result->other_motion += sum.events;
    const Vector6d& J = p.samples[i].jacobian;
    result->information.selfadjointView<Eigen::Lower>().rankUpdate(J, scale * slope * sum.weight);
    result->vector -= scale * sum.offset * J;
    if (sum.weight > 0)
      offsets_.push_back({i, -sum.offset / (slope * sum.weight), scale * slope * sum.weight});
  }
  result->information.triangularView<Eigen::StrictlyUpper>() = result->information.transpose();
  if (p.verdicts) tell_other_motion(p);
  for (std::size_t i = 0; i < p.samples.size(); ++i)
    if (sums_[i].events > 0) clusters_[cluster_numbers_[i]] = {};
  result->mean_square_px2 = weight > 0 ? square / weight : 0;
}

void EventAlignment::tell_other_motion(const EventAlignmentProblem& p) {
  for (std::size_t k = 0; k < p.events.size(); ++k) {
    EventVerdict& verdict = (*p.verdicts)[k];
    if (verdict != EventVerdict::contour && verdict != EventVerdict::predicted) continue;
    const auto sample = static_cast<std::size_t>(owners_[k]);
    if (clusters_[cluster_numbers_[sample]].trust < 0.5) verdict = EventVerdict::other_motion;
  }
}

EventAlignmentResult EventAlignment::align(const EventAlignmentProblem& p) {
  EventAlignmentResult result;
  prepare(p);
  sum_events(p, &result);
  learn_contrast(p);
  watch_flow(p);
  weigh_clusters(p, &result);
  result.slope = slope_.weight < kTelling ? 0 : slope_.value();
  result.captured = captured();
  return result;
}

}  // namespace evpose
