// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/unseen/tables.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <numeric>

#include "evpose/eval/statistics.h"

namespace evpose::experiments::unseen {
namespace {

constexpr double kHonestLow = 0.5, kHonestHigh = 2;
constexpr double kAlike = 0.05;  // relative difference of an error that is called the same

std::string format(const char* pattern, auto... values) {
  char out[300];
  std::snprintf(out, sizeof out, pattern, values...);
  return out;
}

std::string spread(const Distribution& d, const char* pattern) {
  std::string out;
  for (const double v : {d.mean, d.median, d.p90, d.worst})
    out += (out.empty() ? "" : " / ") + format(pattern, v);
  return out;
}

/// A row of the summary: its head, then what it says of each kind of input.
std::string row(const std::string& head, const std::array<Summary, kGivens>& all,
                const std::function<std::string(const Summary&)>& cell) {
  std::string out = text("| ", head, " |");
  for (const Summary& s : all) out += text(" ", cell(s), " |");
  return out + "\n";
}

std::string heads(const std::string& first) {
  std::string out = text("| ", first, " |"), line = "|---|";
  for (const char c : first) line += c == '|' ? "---|" : "";
  for (const char* name : kGivenNames) out += text(" ", name, " |"), line += "---|";
  return out + "\n" + line + "\n";
}

/// Three axes from number `first` on, and the least known direction.
std::string directions(const std::array<double, 8>& nees, std::size_t first, std::size_t weakest) {
  return format("%.2f, %.2f, %.2f, %.2f", nees[first], nees[first + 1], nees[first + 2], nees[weakest]);
}

std::vector<double> ates(const std::vector<SeedResult>& results, std::size_t given) {
  std::vector<double> out;
  for (const SeedResult& r : results)
    if (r.runs[given].fault.empty()) out.push_back(r.runs[given].ate_mm);
  return out;
}

std::string figures(const RunFigures& r) {
  if (!r.fault.empty()) return r.fault;
  return format("%.2f, %.3f, %.2f, %.0f %%%s", r.ate_mm, r.are_deg, r.nees6, 100 * r.tracking,
                r.silent > 0 ? format(", **%d silent**", r.silent).c_str() : "");
}

struct Pair {
  const SeedResult *before, *after;
};
std::vector<Pair> pairs_of(const std::vector<SeedResult>& before, const std::vector<SeedResult>& after) {
  std::vector<Pair> out;
  for (const SeedResult& b : before)
    for (const SeedResult& a : after)
      if (a.seed == b.seed && a.draw.key() == b.draw.key()) out.push_back({&b, &a});
  return out;
}

/// One line of a comparison.
std::string compared(const std::vector<Pair>& pairs, std::size_t given) {
  std::vector<double> ratios;
  double before_mm = 0, after_mm = 0, before_nees = 0, after_nees = 0;
  int better = 0, worse = 0, silent_before = 0, silent_after = 0;
  for (const auto& [before, after] : pairs) {
    const RunFigures &b = before->runs[given], &a = after->runs[given];
    if (!b.fault.empty() || !a.fault.empty()) continue;
    ratios.push_back(std::log(std::max(a.ate_mm, 1e-9) / std::max(b.ate_mm, 1e-9)));
    before_mm += b.ate_mm, after_mm += a.ate_mm;
    before_nees += b.nees6, after_nees += a.nees6;
    silent_before += b.silent > 0 ? 1 : 0, silent_after += a.silent > 0 ? 1 : 0;
    better += ratios.back() < std::log(1 - kAlike) ? 1 : 0;
    worse += ratios.back() > std::log(1 + kAlike) ? 1 : 0;
  }
  const auto n = static_cast<double>(ratios.size());
  if (ratios.empty()) return text("| ", kGivenNames[given], " | 0 | | | | | | |\n");
  const double mean = std::accumulate(ratios.begin(), ratios.end(), 0.0) / n;
  double square = 0;
  for (const double r : ratios) square += (r - mean) * (r - mean);
  const double error = ratios.size() > 1 ? std::sqrt(square / (n - 1) / n) : 0;
  return format("| %s | %d | %.3f -> %.3f | %.3f (%.3f .. %.3f) | %d / %d / %d | %.2f -> %.2f | %d -> %d |\n",
                kGivenNames[given], static_cast<int>(n), before_mm / n, after_mm / n, std::exp(mean),
                std::exp(mean - 2 * error), std::exp(mean + 2 * error), better,
                static_cast<int>(n) - better - worse, worse, before_nees / n, after_nees / n, silent_before,
                silent_after);
}

std::string compared_runs(const RunFigures& before, const RunFigures& after) {
  if (!before.fault.empty() || !after.fault.empty()) return "-";
  return format("%.2f -> %.2f, %.2f -> %.2f", before.ate_mm, after.ate_mm, before.nees6, after.nees6);
}

}  // namespace

Distribution distribution(std::vector<double> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  return {std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size()),
          quantile(values, 0.5), quantile(values, 0.9), values.back()};
}

Summary summarise(const std::vector<SeedResult>& results, Given given) {
  Summary out;
  std::vector<double> ate_mm, ate_tracking_mm, are_deg, nees6;
  double tracking = 0;
  int tracked = 0;
  out.least_tracking = 1;
  for (const SeedResult& result : results) {
    const RunFigures& r = result.run(given);
    ++out.seeds;
    if (r.poses > 0) {
      ++tracked;
      tracking += r.tracking;
      out.least_tracking = std::min(out.least_tracking, r.tracking);
    }
    if (!r.fault.empty()) {
      ++out.without_figures;
      continue;
    }
    ate_mm.push_back(r.ate_mm);
    if (r.tracking > 0) ate_tracking_mm.push_back(r.ate_tracking_mm);
    are_deg.push_back(r.are_deg);
    nees6.push_back(r.nees6);
    out.honest += r.nees6 >= kHonestLow && r.nees6 <= kHonestHigh ? 1 : 0;
    for (std::size_t i = 0; i < r.nees_by_direction.size(); ++i)
      out.nees_by_direction[i] += r.nees_by_direction[i];
    out.weakest_beyond += std::max(r.nees_by_direction[6], r.nees_by_direction[7]) > kHonestHigh ? 1 : 0;
    out.poses += r.poses;
    out.silent_poses += r.silent;
    out.silent_seeds += r.silent > 0 ? 1 : 0;
  }
  for (double& nees : out.nees_by_direction) nees /= std::max(1, static_cast<int>(ate_mm.size()));
  if (tracked == 0) out.least_tracking = 0;
  out.tracking = tracking / std::max(1, tracked);
  out.ate_mm = distribution(std::move(ate_mm));
  out.ate_tracking_mm = distribution(std::move(ate_tracking_mm));
  out.are_deg = distribution(std::move(are_deg));
  out.nees6 = distribution(std::move(nees6));
  return out;
}

std::string summary_table(const std::vector<SeedResult>& results) {
  std::array<Summary, kGivens> all;
  for (std::size_t g = 0; g < kGivens; ++g) all[g] = summarise(results, static_cast<Given>(g));
  const auto share = [](const Summary& s) {
    return format("%d of %d", s.honest, s.seeds - s.without_figures);
  };
  return heads("mean / median / p90 / worst") +
         row("ATE mm", all, [](const Summary& s) { return spread(s.ate_mm, "%.2f"); }) +
         row("ATE mm of poses called `tracking`, seeds that have some", all,
             [](const Summary& s) { return spread(s.ate_tracking_mm, "%.2f"); }) +
         row("ARE deg", all, [](const Summary& s) { return spread(s.are_deg, "%.3f"); }) +
         row("NEES/6", all, [](const Summary& s) { return spread(s.nees6, "%.2f"); }) +
         row("seeds with NEES/6 in 0.5 .. 2", all, share) +
         row("squared error over variance: position x, y, z, least known direction", all,
             [](const Summary& s) { return directions(s.nees_by_direction, 0, 6); }) +
         row("the same of the rotation", all,
             [](const Summary& s) { return directions(s.nees_by_direction, 3, 7); }) +
         row("seeds with more than 2 in a least known direction", all,
             [](const Summary& s) {
               return format("%d of %d", s.weakest_beyond, s.seeds - s.without_figures);
             }) +
         row("poses called `tracking`: mean, least", all,
             [](const Summary& s) {
               return format("%.1f %%, %.1f %%", 100 * s.tracking, 100 * s.least_tracking);
             }) +
         row("of all poses, silently wrong", all,
             [](const Summary& s) { return format("%d of %d", s.silent_poses, s.poses); }) +
         row("seeds with such", all, [](const Summary& s) { return format("%d", s.silent_seeds); }) +
         row("seeds lost throughout, or without a map", all,
             [](const Summary& s) { return format("%d of %d", s.without_figures, s.seeds); });
}

std::string split_table(const std::vector<SeedResult>& results, const std::string& head,
                        const std::function<std::string(const Draw&)>& words) {
  std::map<std::string, std::vector<SeedResult>> classes;
  for (const SeedResult& r : results) {
    const std::string all = words(r.draw);
    classes[all.substr(0, all.find(','))].push_back(r);
  }
  std::string out = heads(head + " (seeds)");
  for (const auto& [name, members] : classes) {
    out += text("| ", name, " (", members.size(), ") |");
    for (std::size_t g = 0; g < kGivens; ++g) {
      const Distribution d = distribution(ates(members, g));
      out += format(" %.2f / %.2f |", d.mean, d.median);
    }
    out += "\n";
  }
  return out;
}

std::string seed_table(const std::vector<SeedResult>& results) {
  std::string out = heads("seed | scene | light | motion | camera | sensors | Mev/s");
  for (const SeedResult& r : results) {
    const Draw& d = r.draw;
    out += text("| ", r.seed, " | ", d.scene, " | ", d.light, " | ", d.motion, " | ", d.camera, " | ",
                d.sensors, format(" | %.1f |", r.mev_s));
    for (const RunFigures& run : r.runs) out += text(" ", figures(run), " |");
    out += "\n";
  }
  return out;
}

std::string comparison(const std::vector<SeedResult>& before, const std::vector<SeedResult>& after) {
  const std::vector<Pair> pairs = pairs_of(before, after);
  std::string out =
      "| | seeds | mean ATE mm | ratio of ATE (2 sigma) | better / alike / worse by 5 % | mean NEES/6 "
      "| seeds silently wrong |\n|---|---|---|---|---|---|---|\n";
  for (std::size_t g = 0; g < kGivens; ++g) out += compared(pairs, g);
  const std::size_t alone = before.size() + after.size() - 2 * pairs.size();
  if (alone > 0) out += text("\n", alone, " results have no partner of the same draw.\n");
  out += "\nATE mm, NEES/6:\n\n" + heads("seed");
  for (const auto& [b, a] : pairs) {
    out += text("| ", a->seed, " |");
    for (std::size_t g = 0; g < kGivens; ++g) out += text(" ", compared_runs(b->runs[g], a->runs[g]), " |");
    out += "\n";
  }
  return out;
}

}  // namespace evpose::experiments::unseen
