// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/run_verdict.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <utility>

namespace evpose {
namespace {

constexpr double kCollecting_s = 0.1;    // a start may take so long: nothing is wrong with it
constexpr double kShortShare = 0.01;     // of a good run: problems that lasted less are not worth a line
constexpr std::size_t kMostPrinted = 4;  // problems on the terminal

/// What the tracker says, and what is behind it. The first that is found in a reason holds.
struct Explanation {
  const char* words;
  const char* cause;
  const char* remedy;
};
constexpr const char* kSearch = "searching for the pose";  // follows from something else, mostly
constexpr std::array kExplanations{
    Explanation{"not in this map",
                "the map is of another place or mirrored, or the start is further off than was said",
                "check --map and --init; give the start's true error with --init-sigma"},
    Explanation{"pose in doubt", "part of the map is wrong or has changed, or little of it is in view",
                "look at the report's pictures: contours must lie on events; fly on, or give another --map"},
    Explanation{"do not gather", "wrong map, start or calibration: contours are not where the events are",
                "look at the report's pictures: contours must lie on events; `evpose check` the recording"},
    Explanation{"IMU contradicts", "axes, units or clock of the IMU do not fit the camera's",
                "`evpose check` names wrong axes and units; else calibrate T_cam_imu and the time offset"},
    Explanation{"no map point in view", "start pose, T_cam_imu or the map's frame is wrong, or the map ends",
                "check --init, which is the pose of the IMU in the map, and how the camera sits on it"},
    Explanation{"have events near by",
                "little motion or light, or contours of another place, scale or calibration",
                "look at the report's pictures: contours must lie on events; `evpose check` the recording"},
    Explanation{"contradicts the prediction", "the IMU and the contours tell different motions",
                "check axes, units and clock of the IMU with `evpose check`"},
    Explanation{"explain the events alike", "the map looks the same from several places, as far as was seen",
                "fly on to where they differ, or give a nearer --init"},
    Explanation{kSearch, "the pose was lost and is not found, or the start is further off than was said",
                "mend what else is named; else give a nearer --init, or its true error with --init-sigma"},
    Explanation{"IMU saturated", "the motion exceeds the range of the IMU",
                "set a wider range in the sensor, and imu.gyro_range_rad_s and imu.accel_range_m_s2"},
    Explanation{"IMU gap", "samples of the IMU were lost", "record with less load; `evpose info` lists gaps"},
    Explanation{"IMU samples", "samples of the IMU were lost, or end before the events",
                "record with less load; `evpose info` lists gaps"},
    Explanation{"IMU", "the stream of the IMU has faults", "`evpose info` lists them; check the driver"},
    Explanation{"events.most_mev_s", "more events than the budget allows",
                "set events.most_mev_s higher, threads=2, or biases of the sensor that make fewer events"},
    Explanation{"time offset has changed", "the time offset between camera and IMU is far from what was said",
                "calibrate it: docs/use/calibration.md"},
    Explanation{"collecting events", "too few events come: no motion, or a dark scene",
                "start where the camera moves"},
    Explanation{"pose uncertain", "too few contours in view, or all of one direction",
                "`evpose map info --report` shows where a map tells the pose; face more structure"},
};

double seconds(TimeNs t) { return static_cast<double>(t) / 1e9; }

bool counts(const StateLog& log, const StateRow& row) {
  return counts_in_share(row.health, to_seconds(row.t - log.rows.front().t));
}

double tracking_share(const StateLog& log) {
  std::size_t all = 0, tracking = 0;
  for (const StateRow& row : log.rows) {
    all += counts(log, row) ? 1 : 0;
    tracking += row.health == Health::tracking ? 1 : 0;
  }
  return all == 0 ? 0 : static_cast<double>(tracking) / static_cast<double>(all);
}

/// Numbers of a reason with two decimals at most.
std::string shortened(const std::string& reason) {
  std::string out;
  int decimals = -1;  // of the number at hand; -1: before its point
  for (const char c : reason) {
    const bool digit = c >= '0' && c <= '9';
    if (!digit) decimals = c == '.' && !out.empty() && out.back() >= '0' && out.back() <= '9' ? 0 : -1;
    if (digit && decimals >= 0 && ++decimals > 2) continue;
    out += c;
  }
  return out;
}

std::string line(const char* format, auto... values) {
  std::array<char, 200> out{};
  std::snprintf(out.data(), out.size(), format, values...);
  return out.data();
}

}  // namespace

bool counts_in_share(Health health, double since_first_s) {
  return health != Health::initialising || since_first_s >= kCollecting_s;
}

Error explain_reason(const std::string& reason) {
  for (const Explanation& e : kExplanations)
    if (reason.find(e.words) != std::string::npos) return {reason, e.cause, e.remedy};
  return {reason, "the tracker found no contours that agree with the events",
          "check start, map and calibration: `evpose check` the recording"};
}

std::vector<RunProblem> problems_of(std::span<const HealthChange> changes, TimeNs end) {
  std::vector<RunProblem> out;
  for (std::size_t i = 0; i < changes.size(); ++i) {
    const HealthChange& change = changes[i];
    if (change.health == Health::tracking) continue;
    // A stream whose clock starts again goes back in time.
    const double lasted_s =
        std::max(0.0, to_seconds((i + 1 < changes.size() ? changes[i + 1].t : end) - change.t));
    if (change.health == Health::initialising && lasted_s < kCollecting_s) continue;
    const std::string reason =
        !change.reason.empty() ? shortened(change.reason) : "no pose that the events confirm";
    const Error why = explain_reason(reason);
    auto known =
        std::find_if(out.begin(), out.end(), [&](const RunProblem& p) { return p.cause == why.what; });
    if (known == out.end()) known = out.insert(out.end(), {change.health, "", 0, 0, why.what, why.fix});
    known->health = std::max(known->health, change.health);
    known->reason = reason;
    known->total_s += lasted_s;
    known->last = change.t;
  }
  const auto follows = [](const RunProblem& p) { return p.reason.find(kSearch) != std::string::npos; };
  std::stable_sort(out.begin(), out.end(), [&](const RunProblem& a, const RunProblem& b) {
    return std::pair(follows(a), -a.total_s) < std::pair(follows(b), -b.total_s);
  });
  return out;
}

RunVerdict judge_run(const StateLog& log) {
  if (log.rows.empty()) return {};
  return {tracking_share(log), to_seconds(log.rows.back().t - log.rows.front().t),
          problems_of(log.health, log.rows.back().t)};
}

std::string verdict_text(const RunVerdict& verdict, const std::vector<Error>& findings) {
  std::string out = line("tracking in %.1f %% of the updates", 100 * verdict.tracking_share);
  if (!verdict.good()) {
    out += line(": less than %.0f %%", 100 * kGoodTrackingShare);
    for (const Error& finding : findings) out += "\n  " + finding.line();
  }
  const double shortest_s = verdict.good() ? kShortShare * verdict.length_s : 0;
  for (std::size_t i = 0; i < std::min(kMostPrinted, verdict.problems.size()); ++i) {
    const RunProblem& p = verdict.problems[i];
    if (p.total_s < shortest_s) break;
    out += line("\n  %s for %.2f s, last at %.3f s: ", to_string(p.health), p.total_s, seconds(p.last)) +
           p.reason;
    out += "\n    likely: " + p.cause + "\n    do: " + p.remedy;
  }
  return out;
}

}  // namespace evpose
