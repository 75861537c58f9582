// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/residuals.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>

#include "evpose/bench/experiments/posed_looks.h"
#include "evpose/bench/experiments/residuals_picture.h"

namespace evpose::experiments {
namespace {

using Looks = std::vector<ContourLook>;

struct Class {
  std::string name;
  std::function<bool(const ContourLook&)> holds;
};

/// Classes between limits of a look's value.
template <class Value>
std::vector<Class> between(const std::vector<double>& limits, const char* unit, const Value& value) {
  std::vector<Class> out;
  for (std::size_t k = 0; k + 1 < limits.size(); ++k) {
    const double low = limits[k], high = limits[k + 1];
    const bool last = k + 2 == limits.size();
    out.push_back({last ? text("> ", low, unit) : text(low, " - ", high, unit),
                   [=](const ContourLook& l) { return value(l) >= low && value(l) < high; }});
  }
  return out;
}

/// Offset in the image along a fixed direction across the contour: 0 to the right, 90 deg downwards.
struct Direction {
  double from_deg;
  double sign(const ContourLook& l) const {
    const double middle = (from_deg + 22.5) * M_PI / 180;
    return l.motion.dot(Eigen::Vector2d(std::cos(middle), std::sin(middle))) > 0 ? 1 : -1;
  }
  bool holds(const ContourLook& l) const {
    double angle = std::atan2(l.motion.y(), l.motion.x()) * 180 / M_PI - from_deg;
    while (angle < 0) angle += 180;
    return std::fmod(angle, 180) < 45;
  }
};

std::vector<const ContourLook*> those(const Looks& looks, const std::function<bool(const ContourLook&)>& in) {
  std::vector<const ContourLook*> out;
  for (const ContourLook& l : looks)
    if (in(l)) out.push_back(&l);
  return out;
}

double measured(const ContourLook& l) { return l.measured_px(); }
double left(const ContourLook& l) { return l.left_px(); }

/// By pose: the true one and the tracker's.
struct Measured {
  Looks truth, tracker;
};

void print_row(const std::string& name, const Measured& m, const std::function<bool(const ContourLook&)>& in,
               const std::function<double(const ContourLook&)>& sign) {
  const auto truth = those(m.truth, in), tracker = those(m.tracker, in);
  const auto raw = scatter_of(truth, [&](const ContourLook& l) { return sign(l) * measured(l); });
  const auto rest = scatter_of(truth, [&](const ContourLook& l) { return sign(l) * left(l); });
  const auto found = scatter_of(tracker, [&](const ContourLook& l) { return sign(l) * left(l); });
  std::printf("| %s | %d | %.3f | %.3f | %.3f | %.3f | %.3f |\n", name.c_str(), raw.looks, raw.mean_px,
              rest.mean_px, rest.sigma_px, found.mean_px, found.sigma_px);
}

void print_head(const char* what, const char* sense) {
  std::printf(
      "\n| %s | looks | measured px%s | left over px | scatter px | tracker's pose: left over px | scatter "
      "px "
      "|\n|---|---|---|---|---|---|---|\n",
      what, sense);
}

void print_classes(const char* what, const Measured& m, const std::vector<Class>& classes) {
  print_head(what, ", + early");
  for (const Class& c : classes) print_row(c.name, m, c.holds, [](const ContourLook&) { return 1.0; });
}

/// Events of one polarity in looks of a class of contrast.
void print_contrast_row(const Class& contrast, bool on, const Measured& m) {
  OffsetSum sum;
  double delay = 0, events = 0;
  for (const ContourLook* l : those(m.truth, contrast.holds)) {
    if ((l->steps > 0) != on) continue;
    const OffsetSum& s = on ? l->on : l->off;
    sum += s;
    delay += s.events() * (on ? l->delay_on_px : l->delay_off_px);
    events += s.events();
  }
  const double n = std::max(1.0, events);
  std::printf("| %s | %s | %.0f | %.3f | %.3f | %.3f |\n", contrast.name.c_str(), on ? "on" : "off", events,
              sum.sum_px() / n, -delay / n, (sum.sum_px() + delay) / n);
}

void print_contrast(const Measured& m) {
  std::printf(
      "\n| events per crossing | polarity | events | measured px, + early | law px | left over px |\n");
  std::printf("|---|---|---|---|---|---|\n");
  const auto classes =
      between({0, 0.5, 1, 2, 4, 1e9}, "", [](const ContourLook& l) { return std::abs(l.steps); });
  for (const bool on : {true, false})
    for (const Class& c : classes) print_contrast_row(c, on, m);
}

void print_directions(const Measured& m) {
  const auto all = [](const ContourLook&) { return true; };
  print_head("sense", "");
  print_row("along the motion", m, all, [](const ContourLook&) { return 1.0; });
  print_row("along the map's normal", m, all, [](const ContourLook& l) { return double(l.motion_side); });
  print_row("to the darker side", m, all, [](const ContourLook& l) { return l.steps > 0 ? 1.0 : -1.0; });
  for (const double from : {-22.5, 22.5, 67.5, 112.5}) {
    const Direction d{from};
    print_row(
        text("in the image, at ", from + 22.5, " deg"), m, [d](const ContourLook& l) { return d.holds(l); },
        [d](const ContourLook& l) { return d.sign(l); });
  }
}

void print_correlation(const Measured& m) {
  std::printf(
      "\n| time between looks s | pairs | correlation | with the tracker's pose |\n|---|---|---|---|\n");
  const auto truth = correlation_over_time(m.truth), tracker = correlation_over_time(m.tracker);
  for (std::size_t k = 0; k < truth.size(); ++k)
    std::printf("| %.2f - %.2f | %d | %.2f | %.2f |\n", truth[k].least_s, truth[k].most_s, truth[k].pairs,
                truth[k].correlation, tracker[k].correlation);
}

/// What lasts, across contours of one direction, at the true pose.
void print_lasting(const Measured& m) {
  std::printf(
      "\n| direction across the contour | looks | offset px | sigma px | of it lasts px | memory s |\n"
      "|---|---|---|---|---|---|\n");
  for (const double from : {-22.5, 22.5, 67.5, 112.5}) {
    const Direction d{from};
    Looks looks;
    for (const ContourLook& l : m.truth)
      if (d.holds(l)) looks.push_back(l);
    const LookScatter all = scatter_of(those(looks, [](const ContourLook&) { return true; }),
                                       [d](const ContourLook& l) { return d.sign(l) * left(l); });
    const LookMemory memory = memory_of(correlation_over_time(looks));
    std::printf("| %s | %d | %.3f | %.3f | %.3f | %.2f |\n", text(from + 22.5, " deg").c_str(), all.looks,
                all.mean_px, all.sigma_px, all.sigma_px * std::sqrt(memory.share), memory.time_s);
  }
}

}  // namespace

std::vector<LookCorrelation> correlation_over_time(const std::vector<ContourLook>& looks) {
  std::vector<LookCorrelation> out{{0.05, 0.1}, {0.1, 0.2}, {0.2, 0.4}, {0.4, 0.8}, {0.8, 1.6}};
  const auto offset = [](const ContourLook& l) { return l.motion_side * l.left_px(); };
  std::vector<const ContourLook*> all = those(looks, [](const ContourLook&) { return true; });
  const LookScatter scatter = scatter_of(all, offset);
  const double variance = std::max(1e-9, scatter.sigma_px * scatter.sigma_px);
  std::sort(all.begin(), all.end(), [](const ContourLook* a, const ContourLook* b) {
    return std::tuple(a->segment, a->block, a->motion_side) <
           std::tuple(b->segment, b->block, b->motion_side);
  });
  for (auto a = all.begin(); a != all.end(); ++a)
    for (auto b = a + 1; b != all.end() && (*b)->segment == (*a)->segment; ++b) {
      const double apart_s = LookCounter::kBlock_s * static_cast<double>((*b)->block - (*a)->block);
      for (LookCorrelation& c : out)
        if (apart_s > c.least_s - 1e-6 && apart_s < c.most_s - 1e-6) {
          ++c.pairs;
          c.correlation += (offset(**a) - scatter.mean_px) * (offset(**b) - scatter.mean_px) / variance;
        }
    }
  for (LookCorrelation& c : out) c.correlation /= std::max(1, c.pairs);
  return out;
}

LookMemory memory_of(const std::vector<LookCorrelation>& correlations) {
  constexpr double kLongest_s = 10;
  constexpr int kFewest = 30;
  LookMemory best;
  double least = -1;
  for (double time_s = 0.02; time_s < kLongest_s; time_s *= 1.05) {
    double both = 0, square = 0, rest = 0;
    for (const LookCorrelation& c : correlations) {
      const double fall = std::exp(-0.5 * (c.least_s + c.most_s - LookCounter::kBlock_s) / time_s);
      if (c.pairs < kFewest) continue;
      both += fall * c.correlation, square += fall * fall;
      rest += c.correlation * c.correlation;
    }
    const double share = square > 0 ? std::clamp(both / square, 0.0, 1.0) : 0;
    const double off = rest - 2 * share * both + share * share * square;
    if (least < 0 || off < least) least = off, best = {share, time_s};
  }
  return best.share > 0 ? best : LookMemory{};
}

Status print_residuals(const ResidualsRequest& request) {
  const auto config = configure(request.assignments);
  if (!config) return config.error();
  const auto streams = load_streams(request.recording, *config);
  if (!streams) return streams.error();
  if (streams->job.truth.size() < 2)
    return Error{request.recording.folder, "no ground truth", "give a recording that has one"};
  const auto poses = tracked_poses(*streams);
  if (!poses) return poses.error();
  const Measured m{looks_from(*streams, streams->job.truth), looks_from(*streams, *poses)};
  std::printf("### %s\n", request.recording.name.c_str());
  print_contrast(m);
  print_directions(m);
  print_classes("speed", m,
                between({8, 25, 60, 120, 1e9}, " px/s", [](const ContourLook& l) { return l.speed_px_s; }));
  print_classes("distance", m,
                between({0, 2, 4, 8, 1e9}, " m", [](const ContourLook& l) { return l.depth_m; }));
  print_correlation(m);
  print_lasting(m);
  if (request.picture.empty()) return {};
  return draw_residuals(request.picture, streams->job.setup.camera->size(), m.truth);
}

}  // namespace evpose::experiments
