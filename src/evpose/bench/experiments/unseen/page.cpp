// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/unseen/page.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <sstream>

#include "evpose/bench/experiments/unseen/tables.h"

namespace evpose::experiments::unseen {
namespace {

constexpr double kWidth = 640, kPanel = 130, kLeft = 60, kGap = 34, kTop = 20;

std::string name(const char* kind, int seed, Given given, const char* ending) {
  char out[100];
  std::snprintf(out, sizeof out, "seeds/%04d_%s_%s.%s", seed, kGivenKeys[static_cast<std::size_t>(given)],
                kind, ending);
  return out;
}

/// One diagram of the picture: values over time from zero.
class Panel {
 public:
  Panel(const std::vector<double>& t_s, double top, double most, std::ostringstream& s)
      : t_(t_s), top_(top), most_(std::max(most, 1e-9)), s_(s) {}

  void frame(const char* title) {
    s_ << "<rect x='" << kLeft << "' y='" << top_ << "' width='" << kWidth - kLeft - 10 << "' height='"
       << kPanel << "' fill='none' stroke='#9aa0aa'/><text x='" << kLeft << "' y='" << top_ - 5 << "'>"
       << title << "</text>\n";
    for (const double share : {0.0, 0.5, 1.0})
      s_ << "<text x='" << kLeft - 5 << "' y='" << y(share * most_) + 4 << "' text-anchor='end'>"
         << share * most_ << "</text>\n";
  }
  void shade(const std::vector<bool>& good) {
    for (std::size_t i = 0; i + 1 < t_.size(); ++i)
      if (!good[i])
        s_ << "<rect x='" << x(t_[i]) << "' y='" << top_ << "' width='" << x(t_[i + 1]) - x(t_[i])
           << "' height='" << kPanel << "' fill='#f3d9b1'/>";
    s_ << "\n";
  }
  void curve(const std::vector<double>& values, const char* colour) {
    s_ << "<polyline fill='none' stroke='" << colour << "' stroke-width='1.4' points='";
    for (std::size_t i = 0; i < t_.size(); ++i) s_ << x(t_[i]) << ',' << y(std::min(values[i], most_)) << ' ';
    s_ << "'/>\n";
  }
  void times() {
    for (const double t : {t_.front(), t_.back()})
      s_ << "<text x='" << x(t) << "' y='" << top_ + kPanel + 14 << "' text-anchor='middle'>" << t
         << " s</text>\n";
  }

 private:
  double x(double t) const {
    return kLeft + (kWidth - kLeft - 10) * (t - t_.front()) / std::max(1e-9, t_.back() - t_.front());
  }
  double y(double value) const { return top_ + kPanel * (1 - value / most_); }

  const std::vector<double>& t_;
  double top_, most_;
  std::ostringstream& s_;
};

double most(const std::vector<double>& values) { return *std::max_element(values.begin(), values.end()); }

std::string described(const SeedResult& r) {
  const Draw& d = r.draw;
  std::string out = text(d.scene, "; ", d.light, "; ", d.motion, "; ", d.camera, "; ", d.sensors,
                         "; cloud: ", d.map, "; handed-over calibration: ", d.calibration,
                         ".\n\n<details><summary>All that was "
                         "drawn</summary>\n\n```\n");
  for (const std::string& setting : d.settings) out += setting + "\n";
  return out + "```\n\n</details>\n";
}

std::string worst_section(const std::vector<SeedResult>& results, Given given) {
  std::string out = text("\n## The worst with ", kGivenNames[static_cast<std::size_t>(given)], "\n");
  for (const SeedResult* r : worst(results, given, kWorst)) {
    const RunFigures& run = r->run(given);
    char head[200];
    if (run.fault.empty())
      std::snprintf(head, sizeof head,
                    "\n### Seed %d: %.2f mm, at most %.1f, %.3f deg, NEES/6 %.2f, %s at the end\n\n", r->seed,
                    run.ate_mm, run.ate_max_mm, run.are_deg, run.nees6, run.at_end.c_str());
    else
      std::snprintf(head, sizeof head, "\n### Seed %d: %.150s\n\n", r->seed, run.fault.c_str());
    out += head + described(*r);
    if (run.fault.empty() && !r->of_other_program)
      out += text("\n![Errors over time](", course_name(r->seed, given), ") ![Events and contours](",
                  moment_name(r->seed, given), ")\n");
  }
  return out;
}

/// How many draws could not be flown, and why.
std::string redrawn(const std::vector<SeedResult>& results) {
  std::size_t count = 0, seeds = 0;
  for (const SeedResult& r : results) {
    count += r.refused.size();
    seeds += r.refused.empty() ? 0 : 1;
  }
  if (count == 0) return "All draws could be flown.";
  return text(
      count, " draws of ", seeds,
      " seeds could not be flown (inside of something, too near, too fast, or without contrast) and were "
      "replaced by the seed's next.");
}

}  // namespace

std::string course_picture(const ErrorCourse& c) {
  std::ostringstream s;
  s.precision(4);
  const double second = kTop + kPanel + kGap;
  s << "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 " << kWidth << ' ' << second + kPanel + 22
    << "' font-family='sans-serif' font-size='11'>\n<rect width='100%' height='100%' fill='white'/>\n";
  if (c.t_s.size() > 1) {
    Panel position(c.t_s, kTop, most(c.position_mm), s);
    position.shade(c.tracking);
    position.curve(c.sigma_mm, "#8f96a3");
    position.curve(c.position_mm, "#1f77d0");
    position.frame("position error (blue) and stated sigma (grey), mm");
    Panel rotation(c.t_s, second, most(c.rotation_deg), s);
    rotation.shade(c.tracking);
    rotation.curve(c.rotation_deg, "#c8541e");
    rotation.frame("rotation error, deg");
    rotation.times();
  }
  s << "</svg>\n";
  return s.str();
}

std::string course_name(int seed, Given given) { return name("course", seed, given, "svg"); }
std::string moment_name(int seed, Given given) { return name("moment", seed, given, "png"); }

std::vector<const SeedResult*> worst(const std::vector<SeedResult>& results, Given given, std::size_t count) {
  std::vector<const SeedResult*> out;
  for (const SeedResult& r : results) out.push_back(&r);
  const auto rank = [&](const SeedResult* r) {
    return r->run(given).fault.empty() ? r->run(given).ate_mm : std::numeric_limits<double>::infinity();
  };
  std::stable_sort(out.begin(), out.end(),
                   [&](const SeedResult* a, const SeedResult* b) { return rank(a) > rank(b); });
  out.resize(std::min(count, out.size()));
  return out;
}

std::string page(const std::vector<SeedResult>& results, const PageWords& words) {
  std::string out = text("Made by `", words.command, "`.\n\n# Unseen flights\n\n");
  if (results.size() < static_cast<std::size_t>(words.seeds))
    out += text(results.size(), " of ", words.seeds, " seeds: the time was up.\n\n");
  if (const auto others = std::ranges::count(results, true, &SeedResult::of_other_program); others > 0)
    out += text(others, " of the seeds were flown by another program, whose results were given.\n\n");
  out += text(
      "Each seed draws a place, light, flight, camera, noise, the faults of the map's cloud and of the "
      "handed-over calibration. Started from the truth, judged from 0.3 s on, no alignment; poses that the "
      "tracker "
      "itself calls lost count for the share of `tracking` only. "
      "Silently wrong: called `tracking`, and further from the truth than chi-square (6) of the stated "
      "covariance allows as rarely as 5 sigma. ",
      "\n\n<!-- figures: redrawn -->\n\n", redrawn(results),
      "\n\n<!-- end -->\n\n<!-- figures: all seeds -->\n\n", summary_table(results), "\n<!-- end -->\n\n",
      "Mean / median ATE mm by class:\n\n<!-- figures: classes -->\n\n",
      split_table(results, "scene", [](const Draw& d) { return d.scene; }), "\n",
      split_table(results, "motion", [](const Draw& d) { return d.motion; }), "\n",
      split_table(results, "camera", [](const Draw& d) { return d.camera; }),
      "\n<!-- end -->\n\n## Seeds\n\nATE mm, ARE deg, NEES/6, share of `tracking`.\n\n<!-- figures: seeds "
      "-->\n\n",
      seed_table(results), "\n<!-- end -->\n");
  for (const Given given : kGivenKinds) out += worst_section(results, given);
  return out;
}

}  // namespace evpose::experiments::unseen
