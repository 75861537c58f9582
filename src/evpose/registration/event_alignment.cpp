// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/event_alignment.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/config.h"

namespace evpose {
namespace {

constexpr float kNoRival = 1e9F;
constexpr double kEdgePrior = 0.5;  // an event in the gate is of the contour rather than clutter
constexpr double kGateRim = 0.8;    // events beyond this share of the gate tell the density at it
constexpr double kSlope_s = 0.05;   // memory of the slope
constexpr double kLeastSlope = 0.15;
constexpr double kTelling = 50;  // events' weight from which on the slope is believed

}  // namespace

void describe(ConfigTable& table, EventAlignmentConfig& c) {
  table.add("gate_px", c.gate_px, "px",
            "events within this, joined with two sigma of the map, belong to a contour", {0.1, 50});
  table.add("widest_gate_px", c.widest_gate_px, "px",
            "an unsure prediction opens the gate by two sigma, but no further than to this", {0.1, 50});
  table.add("capture_gate_px", c.capture_gate_px, "px",
            "... and to this while the events in it show no contour", {0.1, 50});
  table.add("capture_below", c.capture_below, "", "... that is, while their slope is less than this", {0, 1});
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
  table.add("strip_px", c.strip_px, "px", "half length along the contour that a sample stands for", {1, 64});
  table.add("ambiguity_px", c.ambiguity_px, "px",
            "events between two contours as similarly near as this are left out", {0, 50});
  table.add("cluster_px", c.cluster_px, "px", "cells whose events share an error, at 640 px width",
            {4, 4096});
  table.add("honest_slope", c.honest_slope, "take off the information that the gate hides");
}

EventAlignment::EventAlignment(ImageSize size, const EventAlignmentConfig& config, std::uint32_t pieces)
    : size_(size), config_(config), contrast_(pieces, config.contrast) {
  claims_.resize(static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height),
                 {-1, 0, 0, kNoRival});
}

double EventAlignment::Slope::value() const {
  return weight > 0 ? std::clamp((inside - at_gate) / weight, kLeastSlope, 1.0) : 1;
}

double EventAlignment::lateness(const ContourSample& s, bool on) const {
  if (!config_.lateness) return 0;
  const double fade = std::min(1.0, std::abs(s.speed_px_s) / std::max(config_.lateness_from_px_s, 1e-9));
  return std::copysign(fade, s.speed_px_s) * contrast_.lateness_px(s.piece, on);
}

/// Events spread evenly over the gate do not tell of contours: the pose is not where it is thought to be.
bool EventAlignment::captured() const {
  return slope_.weight < kTelling || slope_.value() >= config_.capture_below;
}

bool EventAlignment::polarity_is_wrong(const ContourSample& s, int sign) const {
  const double steps = contrast_.steps(s.piece);
  return sign * steps < 0 && std::abs(steps) >= config_.sure_steps && contrast_.known(s.piece) &&
         std::abs(s.speed_px_s) >= config_.buffer_sigma * s.speed_sigma_px_s;
}

bool EventAlignment::same_line(const ContourSample& a, const ContourSample& b) const {
  return std::abs(a.normal_px.dot(b.normal_px)) > 0.98 && std::abs(a.normal_px.dot(b.pixel - a.pixel)) < 0.75;
}

void EventAlignment::claim_strips(const EventAlignmentProblem& p) {
  const double half_span_s = 0.5 * p.span_s;
  for (std::size_t i = 0; i < p.samples.size(); ++i) {
    const ContourSample& s = p.samples[i];
    const Eigen::Vector2d& n = s.normal_px;
    // The middle of the way that the contour makes during the span, and half its length.
    const double middle = -s.speed_px_s * half_span_s + s.curvature_px_s2 * half_span_s * half_span_s;
    const double reach = this->reach(i) + std::abs(s.speed_px_s) * half_span_s + 0.5;
    const double ex = std::abs(n.x()) * reach + std::abs(n.y()) * config_.strip_px;
    const double ey = std::abs(n.y()) * reach + std::abs(n.x()) * config_.strip_px;
    const Eigen::Vector2d centre = s.pixel + middle * n;
    const int x0 = std::max(0, static_cast<int>(std::ceil(centre.x() - ex)));
    const int x1 = std::min(size_.width - 1, static_cast<int>(std::floor(centre.x() + ex)));
    const int y0 = std::max(0, static_cast<int>(std::ceil(centre.y() - ey)));
    const int y1 = std::min(size_.height - 1, static_cast<int>(std::floor(centre.y() + ey)));
    for (int y = y0; y <= y1; ++y)
      for (int x = x0; x <= x1; ++x) {
        const Eigen::Vector2d r = Eigen::Vector2d(x, y) - centre;
        const double across = std::abs(n.dot(r)), along = std::abs(n.x() * r.y() - n.y() * r.x());
        if (across > reach || along > config_.strip_px) continue;
        const auto index = static_cast<std::uint32_t>(y * size_.width + x);
        Claim& claim = claims_[index];
        const Claim mine{static_cast<std::int32_t>(i), static_cast<float>(across), static_cast<float>(along),
                         kNoRival};
        if (claim.sample < 0) {
          claim = mine;
          touched_.push_back(index);
        } else if (same_line(p.samples[static_cast<std::size_t>(claim.sample)], s)) {
          if (mine.along < claim.along) claim = {mine.sample, mine.distance, mine.along, claim.rival};
        } else if (mine.distance < claim.distance) {
          claim = {mine.sample, mine.distance, mine.along, claim.distance};
        } else {
          claim.rival = std::min(claim.rival, mine.distance);
        }
      }
  }
}

void EventAlignment::release_strips() {
  for (const std::uint32_t index : touched_) claims_[index] = {-1, 0, 0, kNoRival};
  touched_.clear();
}

void EventAlignment::gates(const EventAlignmentProblem& p) {
  sigma_px_.resize(p.samples.size());
  gate_px_.resize(p.samples.size());
  // Events spread evenly over the gate do not tell of contours: the pose is not where it is thought to be.
  const bool captured = slope_.weight < kTelling || slope_.value() >= config_.capture_below;
  const double widest =
      std::max(config_.gate_px, captured ? config_.widest_gate_px : config_.capture_gate_px);
  for (std::size_t i = 0; i < p.samples.size(); ++i) {
    const ContourSample& s = p.samples[i];
    const double pose_variance = std::max(0.0, s.jacobian.dot(p.pose_covariance * s.jacobian));
    sigma_px_[i] = std::sqrt(pose_variance + s.map_sigma_px * s.map_sigma_px);
    const double own = std::min(config_.gate_px + 2 * std::sqrt(pose_variance), widest);
    gate_px_[i] = std::hypot(own, 2 * s.map_sigma_px);
  }
}

/// Tells the contrast memory what area each piece has swept: claimed length times way.
void EventAlignment::sweep(const EventAlignmentProblem& p) {
  claimed_.assign(p.samples.size(), 0);
  for (const std::uint32_t index : touched_) {
    const Claim& claim = claims_[index];
    if (claim.rival - claim.distance >= config_.ambiguity_px)
      ++claimed_[static_cast<std::size_t>(claim.sample)];
  }
  for (std::size_t i = 0; i < p.samples.size(); ++i) {
    const ContourSample& s = p.samples[i];
    const double way = std::abs(s.speed_px_s) * p.span_s;
    const double length = claimed_[i] / (2 * reach(i) + way + 1);
    contrast_.sweep(s.piece, length * way);
  }
}

void EventAlignment::sum_events(const EventAlignmentProblem& p, EventAlignmentResult* result) {
  const double event_variance = config_.event_sigma_px * config_.event_sigma_px;
  sums_.assign(p.samples.size(), {});
  const double keep = std::exp(-p.span_s / kSlope_s);
  slope_ = {keep * slope_.weight, keep * slope_.inside, keep * slope_.at_gate};
  for (const FrontEvent& e : p.events) {
    const Claim& claim = claims_[static_cast<std::size_t>(e.y) * static_cast<std::size_t>(size_.width) + e.x];
    if (claim.sample < 0 || claim.rival - claim.distance < config_.ambiguity_px) continue;
    const auto i = static_cast<std::size_t>(claim.sample);
    const ContourSample& s = p.samples[i];
    const double age = 1e-6 * (p.now_us - e.stamp_us);
    const double d = s.normal_px.dot(Eigen::Vector2d(e.x, e.y) - s.pixel) + s.speed_px_s * age -
                     s.curvature_px_s2 * age * age + lateness(s, e.on != 0);
    const int sign = (e.on != 0) == (s.speed_px_s > 0) ? 1 : -1;
    const bool wrong = config_.polarity && polarity_is_wrong(s, sign);
    if (std::abs(d) <= config_.count_px) contrast_.count(s.piece, sign);
    if (std::abs(d) > gate_px_[i]) continue;
    if (wrong) {
      ++result->wrong_polarity;
      continue;
    }
    const double variance = event_variance + sigma_px_[i] * sigma_px_[i];
    const double edge = kEdgePrior * std::exp(-0.5 * d * d / variance) / std::sqrt(2 * M_PI * variance);
    const double clutter = (1 - kEdgePrior) / (2 * gate_px_[i]);
    const double w = edge / (edge + clutter);
    Sum& sum = sums_[i];
    sum.weight += w;
    sum.offset += w * d;
    sum.square += w * d * d;
    ++sum.events;
    slope_.weight += w;
    slope_.inside += w - w * (1 - w) * d * d / variance;
    if (std::abs(d) > kGateRim * gate_px_[i])
      slope_.at_gate += w * std::abs(d) / ((1 - kGateRim) * gate_px_[i]);
  }
}

/// Events of one cell and one 45 deg bin of direction are one cluster, whose information is capped.
void EventAlignment::weigh_clusters(const EventAlignmentProblem& p, EventAlignmentResult* result) const {
  const double event_variance = config_.event_sigma_px * config_.event_sigma_px;
  const int cell = std::max(1, config_.cluster_px * size_.width / 640);
  const int columns = size_.width / cell + 1, rows = size_.height / cell + 1;
  struct Cluster {
    double weight = 0, map_variance = 0;
  };
  std::vector<Cluster> clusters(static_cast<std::size_t>(columns * rows * 4));
  const auto cluster_of = [&](const ContourSample& s) {
    const int cx = std::clamp(static_cast<int>(s.pixel.x()) / cell, 0, columns - 1);
    const int cy = std::clamp(static_cast<int>(s.pixel.y()) / cell, 0, rows - 1);
    double angle = std::atan2(s.normal_px.y(), s.normal_px.x());
    if (angle < 0) angle += M_PI;
    const int bin = std::min(3, static_cast<int>(angle * (4 / M_PI)));
    return static_cast<std::size_t>((cy * columns + cx) * 4 + bin);
  };
  for (std::size_t i = 0; i < p.samples.size(); ++i) {
    if (sums_[i].events == 0) continue;
    Cluster& c = clusters[cluster_of(p.samples[i])];
    c.weight += sums_[i].weight;
    c.map_variance += sums_[i].weight * p.samples[i].map_sigma_px * p.samples[i].map_sigma_px;
  }

  const double repeats = std::max(1.0, config_.shared_s / std::max(p.span_s, 1e-6));
  const double slope = config_.honest_slope ? slope_.value() : 1;
  double weight = 0, square = 0;
  for (std::size_t i = 0; i < p.samples.size(); ++i) {
    const Sum& sum = sums_[i];
    if (sum.events == 0) continue;
    ++result->matched_samples;
    result->matched_events += sum.events;
    weight += sum.weight;
    square += sum.square;
    const Cluster& c = clusters[cluster_of(p.samples[i])];
    const double own = event_variance / c.weight;
    const double shared =
        repeats * (config_.shared_sigma_px * config_.shared_sigma_px + c.map_variance / c.weight);
    const double scale = own / (own + shared) / event_variance;
    const Vector6d& J = p.samples[i].jacobian;
    result->information += scale * slope * sum.weight * J * J.transpose();
    result->vector -= scale * sum.offset * J;
  }
  result->mean_square_px2 = weight > 0 ? square / weight : 0;
}

EventAlignmentResult EventAlignment::align(const EventAlignmentProblem& p) {
  EventAlignmentResult result;
  gates(p);
  claim_strips(p);
  sweep(p);
  sum_events(p, &result);
  release_strips();
  weigh_clusters(p, &result);
  result.captured = captured();
  return result;
}

}  // namespace evpose
