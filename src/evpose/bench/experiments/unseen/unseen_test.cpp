// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>

#include "evpose/bench/experiments/unseen/draw.h"
#include "evpose/bench/experiments/unseen/page.h"
#include "evpose/bench/experiments/unseen/result.h"
#include "evpose/bench/experiments/unseen/tables.h"
#include "evpose/bench/experiments/unseen/tracked_run.h"

namespace evpose::experiments::unseen {
namespace {

constexpr int kDraws = 400;

sim::Scenario scenario(int seed, bool quick = false) {
  const auto made = scenario_of(draw_flight(seed, 0, quick));
  EXPECT_TRUE(made) << (made ? "" : made.error().line());
  return made ? *made : sim::Scenario{};
}

double degrees_across(const sim::CameraConfig& c) {
  const double k1 = c.k1, k2 = c.k2, edge = 0.5 * c.width / c.focal_px;
  double r = edge;  // of the ray that the lens takes to the edge
  for (int i = 0; i < 100; ++i) r = edge / (1 + k1 * r * r + k2 * r * r * r * r);
  return 2 * std::atan(r) * 180 / std::numbers::pi;
}

TEST(UnseenDraw, IsThatOfItsSeedAndAttempt) {
  const Draw draw = draw_flight(7, 0, false);
  EXPECT_EQ(draw.settings, draw_flight(7, 0, false).settings);
  EXPECT_EQ(draw.key(), draw_flight(7, 0, false).key());
  for (const Draw& other : {draw_flight(8, 0, false), draw_flight(7, 1, false), draw_flight(7, 0, true)})
    EXPECT_NE(draw.key(), other.key());
}

TEST(UnseenDraw, EverySettingIsOneOfTheSimulator) {
  for (int seed = 0; seed < kDraws; ++seed)
    for (const bool quick : {false, true}) {
      const auto made = scenario_of(draw_flight(seed, 0, quick));
      ASSERT_TRUE(made) << seed << ": " << made.error().line();
    }
}

TEST(UnseenDraw, TakesPlacesByTheirWeights) {
  std::map<sim::WorldKind, int> places;
  for (int seed = 0; seed < kDraws; ++seed) ++places[scenario(seed).world.kind];
  const auto share = [&](sim::WorldKind kind, double weight) {
    EXPECT_NEAR(places[kind], weight * kDraws, 4 * std::sqrt(weight * (1 - weight) * kDraws));
  };
  share(sim::WorldKind::hall, 0.4);
  share(sim::WorldKind::courtyard, 0.3);
  share(sim::WorldKind::canyon, 0.3);
}

TEST(UnseenDraw, FliesInEveryWay) {
  std::map<sim::TrajectoryKind, int> kinds;
  for (int seed = 0; seed < kDraws; ++seed) ++kinds[scenario(seed).trajectory.kind];
  using Kind = sim::TrajectoryKind;
  for (const Kind kind : {Kind::square_spiral, Kind::hover, Kind::aggressive, Kind::sweep, Kind::lissajous,
                          Kind::landing, Kind::traverse})
    EXPECT_GE(kinds[kind], kDraws / 40) << static_cast<int>(kind);
}

TEST(UnseenDraw, CoversItsRanges) {
  double darkest = 1e9, brightest = 0, slowest = 1e9, fastest = 0, narrowest = 360, widest = 0;
  int large = 0, undistorted = 0;
  for (int seed = 0; seed < kDraws; ++seed) {
    const sim::Scenario s = scenario(seed);
    if (s.world.kind == sim::WorldKind::hall) {
      darkest = std::min(darkest, s.world.lamp_lux);
      brightest = std::max(brightest, s.world.lamp_lux);
    }
    slowest = std::min(slowest, s.trajectory.speed_m_s);
    fastest = std::max(fastest, s.trajectory.speed_m_s);
    narrowest = std::min(narrowest, degrees_across(s.camera));
    widest = std::max(widest, degrees_across(s.camera));
    large += s.camera.width == 1280 ? 1 : 0;
    undistorted += s.camera.k1 == 0 ? 1 : 0;
    EXPECT_GE(s.duration_s, 2);
    EXPECT_LE(s.duration_s, 4);
  }
  EXPECT_GE(darkest, 100);
  EXPECT_LT(darkest, 115);
  EXPECT_LE(brightest, 1000);
  EXPECT_GT(brightest, 870);
  EXPECT_LT(slowest, 0.15);
  EXPECT_GT(fastest, 5.5);
  EXPECT_NEAR(narrowest, 58, 1);
  EXPECT_NEAR(widest, 94, 1);
  EXPECT_NEAR(large, 0.4 * kDraws, 4 * std::sqrt(0.24 * kDraws));
  EXPECT_NEAR(undistorted, 0.2 * kDraws, 4 * std::sqrt(0.16 * kDraws));
}

TEST(UnseenDraw, VolumesOfFlightLieInTheHallsFreeSpace) {
  for (int seed = 0; seed < kDraws; ++seed) {
    const sim::Scenario s = scenario(seed);
    if (s.world.kind != sim::WorldKind::hall) continue;
    const auto& t = s.trajectory;
    const double yaw = t.heading_deg * std::numbers::pi / 180, c = std::abs(std::cos(yaw)),
                 sine = std::abs(std::sin(yaw)), slack = 2e-3;  // of four digits
    const double x = 0.5 * (c * t.size_forward_m + sine * t.size_left_m),
                 y = 0.5 * (sine * t.size_forward_m + c * t.size_left_m), z = 0.5 * t.size_up_m;
    EXPECT_GE(t.centre_x_m - x, 1.2 - slack) << seed;
    EXPECT_LE(t.centre_x_m + x, 5.2 + slack) << seed;
    EXPECT_GE(t.centre_y_m - y, 1.2 - slack) << seed;
    EXPECT_LE(t.centre_y_m + y, 4.8 + slack) << seed;
    EXPECT_GE(t.centre_z_m - z, 0.85 - slack) << seed;
    EXPECT_LE(t.centre_z_m + z, 2.4 + slack) << seed;
  }
}

TEST(UnseenDraw, MapsFiltersAndCalibrationsHaveTheirFaults) {
  int drift = 0, missing = 0, moved = 0, trails = 0, presets = 0, mirrors = 0;
  for (int seed = 0; seed < kDraws; ++seed) {
    const sim::Scenario s = scenario(seed);
    drift += s.lidar.registration_drift_mm_per_10m > 0 ? 1 : 0;
    missing += s.lidar.missing_parts > 0 ? 1 : 0;
    moved += s.lidar.moved_furniture > 0 ? 1 : 0;
    trails += s.read_out.trail != TrailFilterKind::none ? 1 : 0;
    presets += s.events.preset != sim::EventSensorPreset::typical ? 1 : 0;
    mirrors += s.world.mirror > 0 ? 1 : 0;
    EXPECT_TRUE(s.lidar.on);
    EXPECT_GE(s.handed_over.focal_sigma, 0.0015);
    EXPECT_LE(s.handed_over.focal_sigma, 0.003);
    EXPECT_GE(s.handed_over.k1_sigma, 0.0015);
    EXPECT_LE(s.handed_over.k1_sigma, 0.01);
    EXPECT_GE(s.handed_over.time_sigma_ms, 1);
    EXPECT_LE(s.handed_over.time_sigma_ms, 2);
  }
  const auto share = [](int count, double probability) {
    EXPECT_NEAR(count, probability * kDraws, 4 * std::sqrt(probability * (1 - probability) * kDraws));
  };
  share(drift, 0.5);
  share(missing, 0.4);
  share(moved, 0.4);
  share(trails, 0.15);
  share(presets, 0.5);
  share(mirrors, 0.2);
}

TEST(UnseenDraw, QuickOnesAreSmall) {
  const sim::Scenario s = scenario(3, true);
  EXPECT_EQ(s.duration_s, 1);
  EXPECT_EQ(s.camera.width, 320);
  EXPECT_EQ(s.camera.height, 240);
}

TEST(UnseenJudgement, FarIsAsRareAsFiveSigma) {
  // Survival function of chi-square with 6 degrees of freedom.
  const double y = 0.5 * kFarSquared, rare = std::exp(-y) * (1 + y + 0.5 * y * y);
  EXPECT_NEAR(rare / std::erfc(5 / std::numbers::sqrt2), 1, 1e-3);
}

/// A second at 100 poses a second along x, wrong sideways by `sigmas` of 1 mm.
std::vector<TrackedPose> wrong_poses(const std::vector<TimedPose>& truth, double sigmas, Health health) {
  std::vector<TrackedPose> out;
  for (const TimedPose& t : truth) {
    TrackedPose p{t, 1e-6 * Matrix6d::Identity(), health};
    p.pose.pose.p.y() += 1e-3 * sigmas;
    out.push_back(p);
  }
  return out;
}

std::vector<TimedPose> straight_truth() {
  std::vector<TimedPose> out(101);
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i].t = static_cast<TimeNs>(i) * 10 * kNsPerMs;
    out[i].pose.p.x() = 0.01 * static_cast<double>(i);
  }
  return out;
}

TEST(UnseenJudgement, MeasuresTheErrorAfterItsBegin) {
  const std::vector<TimedPose> truth = straight_truth();
  std::vector<TrackedPose> poses = wrong_poses(truth, 2, Health::tracking);
  for (std::size_t i = 0; i < 30; ++i) poses[i].pose.pose.p.z() = 100;
  const RunFigures f = judge(poses, truth, 300 * kNsPerMs).figures;
  EXPECT_EQ(f.fault, "");
  EXPECT_EQ(f.poses, 71);
  EXPECT_NEAR(f.ate_mm, 2, 1e-9);
  EXPECT_NEAR(f.ate_max_mm, 2, 1e-9);
  EXPECT_NEAR(f.are_deg, 0, 1e-9);
  EXPECT_NEAR(f.nees6, 4.0 / 6, 1e-9);
  EXPECT_EQ(f.tracking, 1);
  EXPECT_EQ(f.silent, 0);
}

TEST(UnseenJudgement, ASilentWrongPoseIsFarAndCalledTracking) {
  const std::vector<TimedPose> truth = straight_truth();
  const auto silent = [&](double sigmas, Health health) {
    return judge(wrong_poses(truth, sigmas, health), truth, 0).figures.silent;
  };
  EXPECT_EQ(silent(std::sqrt(kFarSquared) - 0.01, Health::tracking), 0);
  EXPECT_EQ(silent(std::sqrt(kFarSquared) + 0.01, Health::tracking), 101);
  EXPECT_EQ(silent(100, Health::degraded), 0);
}

TEST(UnseenJudgement, CountsWhatIsCalledTracking) {
  const std::vector<TimedPose> truth = straight_truth();
  std::vector<TrackedPose> poses = wrong_poses(truth, 1, Health::tracking);
  for (std::size_t i = 21; i < 101; ++i) poses[i].health = i < 51 ? Health::degraded : Health::lost;
  for (std::size_t i = 21; i < 51; ++i) poses[i].pose.pose.p.z() = 0.1;
  const Judgement judged = judge(poses, truth, 0);
  EXPECT_NEAR(judged.figures.tracking, 21.0 / 101, 1e-12);
  EXPECT_NEAR(judged.figures.ate_tracking_mm, 1, 1e-9);
  EXPECT_EQ(judged.figures.at_end, "lost");
  EXPECT_EQ(judge(wrong_poses(truth, 1, Health::degraded), truth, 0).figures.ate_tracking_mm, 0);
}

TEST(UnseenJudgement, ErrorsAreThoseOfPosesThatItStandsBy) {
  const std::vector<TimedPose> truth = straight_truth();
  std::vector<TrackedPose> poses = wrong_poses(truth, 1, Health::degraded);
  for (std::size_t i = 51; i < 101; ++i) poses[i] = {poses[i].pose, poses[i].covariance, Health::lost};
  for (std::size_t i = 51; i < 101; ++i) poses[i].pose.pose.p.z() = 100;
  const Judgement judged = judge(poses, truth, 0);
  EXPECT_NEAR(judged.figures.ate_max_mm, 1, 1e-9);
  EXPECT_EQ(judged.figures.poses, 101);
  EXPECT_EQ(judged.figures.tracking, 0);
  ASSERT_EQ(judged.course.tracking.size(), 51U);
  EXPECT_FALSE(judged.course.tracking[0]);
  EXPECT_EQ(judge(wrong_poses(truth, 1, Health::lost), truth, 0).figures.fault, "lost");
}

TEST(UnseenJudgement, WithoutPosesOrNumbersThereAreNoFigures) {
  const std::vector<TimedPose> truth = straight_truth();
  EXPECT_NE(judge({}, truth, 0).figures.fault, "");
  EXPECT_NE(judge(wrong_poses(truth, NAN, Health::tracking), truth, 0).figures.fault, "");
}

SeedResult result_of(int seed, double ate_mm, double nees6 = 1) {
  SeedResult out;
  out.seed = seed;
  out.key = "k";
  out.draw.settings = {text("seed=", seed)};
  out.draw.scene = seed % 2 == 0 ? "hall, texture 1" : "canyon, texture 1";
  out.duration_s = 3;
  for (RunFigures& run : out.runs) {
    run.ate_mm = ate_mm;
    run.ate_max_mm = 2 * ate_mm;
    run.are_deg = 0.1 * ate_mm;
    run.nees6 = nees6;
    run.tracking = 1;
    run.ate_tracking_mm = ate_mm;
    run.poses = 100;
    run.at_end = "tracking";
  }
  return out;
}

TEST(UnseenTables, DistributionOfElevenValues) {
  std::vector<double> values;
  for (int i = 11; i >= 1; --i) values.push_back(i);
  const Distribution d = distribution(values);
  EXPECT_EQ(d.mean, 6);
  EXPECT_EQ(d.median, 6);
  EXPECT_EQ(d.p90, 10);
  EXPECT_EQ(d.worst, 11);
}

TEST(UnseenTables, ASummaryCountsSeedsAndPoses) {
  std::vector<SeedResult> results{result_of(0, 1, 0.4), result_of(1, 2, 0.5), result_of(2, 3, 2),
                                  result_of(3, 4, 2.1), result_of(4, 99)};
  results[1].runs[0].silent = 7;
  results[2].runs[0].tracking = 0.5;
  results[3].runs[0].tracking = 0;
  results[4].runs[0] = {};
  results[4].runs[0].fault = "lost";
  results[4].runs[0].poses = 100;
  const Summary s = summarise(results, Given::truth);
  EXPECT_EQ(s.seeds, 5);
  EXPECT_EQ(s.without_figures, 1);
  EXPECT_EQ(s.ate_mm.mean, 2.5);
  EXPECT_EQ(s.ate_mm.worst, 4);
  EXPECT_EQ(s.honest, 2);
  EXPECT_EQ(s.poses, 400);
  EXPECT_EQ(s.silent_poses, 7);
  EXPECT_EQ(s.silent_seeds, 1);
  EXPECT_EQ(s.ate_tracking_mm.mean, 2);
  EXPECT_EQ(s.tracking, 0.5);
  EXPECT_EQ(s.least_tracking, 0);
}

TEST(UnseenTables, ClassesHaveTheirOwnMeans) {
  const std::string table = split_table({result_of(0, 1), result_of(1, 5), result_of(2, 3)}, "scene",
                                        [](const Draw& d) { return d.scene; });
  EXPECT_NE(table.find("| hall (2) | 2.00 / 2.00 |"), std::string::npos) << table;
  EXPECT_NE(table.find("| canyon (1) | 5.00 / 5.00 |"), std::string::npos) << table;
}

TEST(UnseenTables, AComparisonPairsEqualDraws) {
  const std::vector<SeedResult> before{result_of(0, 2), result_of(1, 4), result_of(2, 8)};
  std::vector<SeedResult> after{result_of(0, 1), result_of(1, 2), result_of(2, 8)};
  after[2].draw.settings = {"seed=12"};
  const std::string table = comparison(before, after);
  EXPECT_NE(table.find("| true contours | 2 | 3.000 -> 1.500 | 0.500 (0.500 .. 0.500) | 2 / 0 / 0 |"),
            std::string::npos)
      << table;
  EXPECT_NE(table.find("2 results have no partner"), std::string::npos) << table;
}

TEST(UnseenResult, IsReadAsItWasWritten) {
  SeedResult result = result_of(5, 1.0 / 3);
  result.refused = {"at 0.1 s: \"inside\""};
  result.runs[1].fault = "no map";
  const std::string line = to_json(result);
  EXPECT_EQ(line.find('\n'), std::string::npos);
  const auto read = from_json(line, "here");
  ASSERT_TRUE(read) << read.error().line();
  EXPECT_EQ(to_json(*read), line);
  EXPECT_EQ(read->runs[0].ate_mm, 1.0 / 3);
  EXPECT_EQ(read->runs[1].fault, "no map");
  for (const char* broken : {"", "{}", "[1]", "{\"seed\": \"five\"}"}) {
    const auto refused = from_json(broken, "here");
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().where, "here");
  }
}

TEST(UnseenPage, TheWorstComeFirstAndThoseWithoutFiguresBeforeThem) {
  std::vector<SeedResult> results;
  for (int seed = 0; seed < 15; ++seed) results.push_back(result_of(seed, seed));
  results[4].runs[0].fault = "no map";
  const auto order = worst(results, Given::truth, kWorst);
  ASSERT_EQ(order.size(), kWorst);
  EXPECT_EQ(order[0]->seed, 4);
  EXPECT_EQ(order[1]->seed, 14);
  EXPECT_EQ(order[9]->seed, 6);
  EXPECT_EQ(worst(results, Given::built_map, 3)[0]->seed, 14);
}

}  // namespace
}  // namespace evpose::experiments::unseen
