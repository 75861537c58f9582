// SPDX-License-Identifier: BSD-3-Clause
// Held against others: a second implementation in Python, and the published errors of released trajectories.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <random>

#include "evpose/eval/score.h"
#include "evpose/io/motion/trajectory_tum.h"

namespace evpose {
namespace {

namespace fs = std::filesystem;

fs::path shared_folder() {
  if (const char* set = std::getenv("EVPOSE_SHARED")) return set;
  return fs::path(EVPOSE_SOURCE_DIR) / ".." / "shared";
}

struct Known {
  const char* name;
  std::size_t pairs;  ///< nearest, 10 ms
  double se3_cm, se3_interpolated_cm, sim3_cm, scale;
};
void PrintTo(const Known& known, std::ostream* out) { *out << known.name; }

class Published : public testing::TestWithParam<Known> {};

TEST_P(Published, AteOfReleasedTrajectoriesIsReproduced) {
  const fs::path folder = shared_folder() / "data/real/trajectories";
  if (!fs::exists(folder)) GTEST_SKIP() << "no folder " << folder << ": set EVPOSE_SHARED";
  const Known& known = GetParam();
  const auto estimate = read_tum((folder / known.name).string() + "_est.txt");
  const auto truth = read_tum((folder / known.name).string() + "_gt.txt");
  ASSERT_TRUE(estimate) << estimate.error().line();
  ASSERT_TRUE(truth) << truth.error().line();
  const auto score = [&](AssociationRule rule, Alignment alignment) {
    ScoreOptions options;
    options.association = {rule, 0.1, 0.01};
    options.alignment = alignment;
    return score_trajectory({*estimate, *truth, {}, {}, {}}, options);
  };
  const TrajectoryScore se3 = score(AssociationRule::nearest, Alignment::se3);
  EXPECT_EQ(se3.pairs, known.pairs);
  EXPECT_NEAR(se3.ate_mm.rmse / 10, known.se3_cm, 6e-4);
  EXPECT_NEAR(score(AssociationRule::interpolate, Alignment::se3).ate_mm.rmse / 10, known.se3_interpolated_cm,
              6e-4);
  const TrajectoryScore sim3 = score(AssociationRule::nearest, Alignment::sim3);
  EXPECT_NEAR(sim3.ate_mm.rmse / 10, known.sim3_cm, 6e-4);
  EXPECT_NEAR(sim3.T_truth_estimate.scale, known.scale, 6e-5);
}

INSTANTIATE_TEST_SUITE_P(Released, Published,
                         testing::Values(Known{"vector/corner_slow", 3782, 2.154, 2.154, 1.732, 0.4472},
                                         Known{"vector/desk_normal", 8755, 16.471, 16.471, 14.644, 1.2597},
                                         Known{"vector/hdr_normal", 5969, 13.532, 13.532, 13.339, 1.0837},
                                         Known{"vector/robot_normal", 3789, 4.808, 4.808, 3.386, 1.1770},
                                         Known{"vector/sofa_normal", 8739, 40.278, 40.278, 33.289, 0.6150},
                                         Known{"tum_vie/1d_trans", 3512, 3.334, 3.334, 3.320, 1.0118},
                                         Known{"tum_vie/3d_trans", 3191, 7.263, 7.264, 7.037, 0.9359},
                                         Known{"tum_vie/6d_trans", 1931, 3.210, 3.210, 3.180, 1.0349},
                                         Known{"tum_vie/desk", 3718, 6.161, 6.161, 4.949, 0.7930},
                                         Known{"tum_vie/desk2", 2014, 4.023, 4.023, 3.686, 0.8924},
                                         Known{"mvsec/indoor_flying1", 2376, 7.633, 7.577, 7.626, 0.9977},
                                         Known{"mvsec/indoor_flying4", 563, 5.593, 5.640, 5.449, 0.9895}),
                         [](const auto& test) {
                           std::string name = test.param.name;
                           for (char& c : name)
                             if (c == '/') c = '_';
                           return name;
                         });

/// What a program prints; empty if it fails.
std::string output_of(const std::string& command) {
  std::FILE* pipe = ::popen((command + " 2>/dev/null").c_str(), "r");
  if (pipe == nullptr) return {};
  std::string out;
  std::array<char, 4096> buffer{};
  while (const std::size_t n = std::fread(buffer.data(), 1, buffer.size(), pipe))
    out.append(buffer.data(), n);
  const int status = ::pclose(pipe);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0 ? out : std::string();
}

/// A Python that has numpy: the distribution's may not be the first in PATH.
std::string python_with_numpy() {
  for (const char* python : {"python3", "/usr/bin/python3"})
    if (!output_of(std::string(python) + " -c 'import numpy; print(1)'").empty()) return python;
  return {};
}

/// The number after "word": in JSON; NaN if it is not there.
double number_in(const std::string& json, const std::string& word) {
  const std::size_t at = json.find('"' + word + "\":");
  return at == std::string::npos ? std::nan("") : std::strtod(json.c_str() + at + word.size() + 3, nullptr);
}

Pose flight(double t_s) {
  return {so3::exp({0.3 * std::sin(1.3 * t_s), 0.2 * std::cos(1.7 * t_s), 0.5 * t_s}),
          {1.5 * std::sin(1.1 * t_s), 1.2 * std::cos(0.9 * t_s), 1 + 0.4 * std::sin(0.7 * t_s + 1)}};
}

struct Trajectories {
  std::vector<TimedPose> estimate, truth;
};

/// Ground truth at 200 Hz with a gap; an estimate in another frame, late, noisy, with two lost stretches. No
/// stamp lies where rounding could decide.
Trajectories made_up() {
  Trajectories out;
  for (int i = 0; i <= 2000; ++i)
    if (i < 800 || i > 815) out.truth.push_back({i * 5 * kNsPerMs, flight(0.005 * i)});
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  const Pose T{so3::exp({0.02, -0.01, 0.3}), {0.1, 0.05, -0.02}};
  for (int i = 0; i < 2500; ++i) {
    if ((i > 300 && i < 500) || (i > 2000 && i < 2100)) continue;
    const TimeNs t = 123'456'789 + i * 3'337'001LL;
    Vector6d d;
    for (int k = 0; k < 6; ++k) d[k] = normal(random) * (k < 3 ? 0.003 : 0.002);
    out.estimate.push_back({t, (T * flight(to_seconds(t) - 0.004)).plus(d)});
  }
  return out;
}

class PythonTwin : public testing::TestWithParam<const char*> {};

TEST_P(PythonTwin, AgreesToItsPrintedDigits) {
  const fs::path script = shared_folder() / "tools/score.py";
  if (!fs::exists(script)) GTEST_SKIP() << "no file " << script << ": set EVPOSE_SHARED";
  const std::string python = python_with_numpy();
  if (python.empty()) GTEST_SKIP() << "no Python with numpy: install python3-numpy";

  const std::string alignment = GetParam();
  const fs::path folder = fs::path(testing::TempDir()) / ("evpose_eval_twin_" + std::to_string(::getpid()));
  fs::create_directories(folder);
  const std::string estimate_file = folder / "estimate.tum", truth_file = folder / "truth.tum";
  const Trajectories made = made_up();
  ASSERT_TRUE(write_tum(estimate_file, made.estimate));
  ASSERT_TRUE(write_tum(truth_file, made.truth));
  const std::string files = "'" + estimate_file + "' '" + truth_file + "'";
  const std::string json = output_of(python + " '" + script.string() + "' " + files +
                                     " --json --from 0.5 --to 7.9 --align " + alignment);
  ASSERT_FALSE(json.empty());

  ScoreOptions options;
  options.alignment = alignment == "se3"   ? Alignment::se3
                      : alignment == "yaw" ? Alignment::yaw
                                           : Alignment::none;
  options.from = kNsPerS / 2;
  options.to = from_seconds(7.9);
  const auto estimate = read_tum(estimate_file), truth = read_tum(truth_file);
  ASSERT_TRUE(estimate && truth);
  const TrajectoryScore score = score_trajectory({*estimate, *truth, {}, {}, {}}, options);
  EXPECT_EQ(score.pairs, static_cast<std::size_t>(number_in(json, "pairs")));
  EXPECT_NEAR(score.coverage, number_in(json, "coverage"), 0.51e-4);
  int compared = 0;
  for (const auto& [name, value] : score.words()) {
    const double theirs = number_in(json, name);
    if (std::isnan(theirs)) continue;  // a figure that it does not know
    ++compared;
    const double digit = name == "lag_ms" ? 1e-4 : name.rfind("rre", 0) == 0 ? 1e-6 : 1e-5;
    EXPECT_NEAR(value, theirs, 0.51 * digit) << name;
  }
  EXPECT_EQ(compared, 17);
  fs::remove_all(folder);
}

INSTANTIATE_TEST_SUITE_P(Align, PythonTwin, testing::Values("none", "se3", "yaw"),
                         [](const auto& test) { return std::string(test.param); });

}  // namespace
}  // namespace evpose
