// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <numeric>
#include <random>
#include <set>
#include <sstream>

#include "evpose/io/files/png_file.h"
#include "evpose/report/map_accuracy.h"
#include "evpose/report/overlay.h"
#include "evpose/report/page.h"
#include "evpose/report/page_parts.h"
#include "evpose/report/run_folder.h"
#include "evpose/report/series.h"
#include "evpose/report/state_log.h"
#include "evpose/report/summary.h"

namespace evpose {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

std::string content(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// A folder of its own for each test.
class Folder {
 public:
  Folder() {
    path_ = fs::path(testing::TempDir()) / ("evpose_report_" + std::to_string(::getpid()));
    fs::remove_all(path_);
    fs::create_directories(path_);
  }
  ~Folder() { fs::remove_all(path_); }
  std::string file(const std::string& name) const { return (path_ / name).string(); }
  std::vector<std::string> names() const {
    std::vector<std::string> out;
    for (const auto& entry : fs::directory_iterator(path_)) out.push_back(entry.path().filename());
    return out;
  }

 private:
  fs::path path_;
};

Pose circle(double t_s) { return {so3::exp({0, 0, t_s}), {std::cos(t_s), std::sin(t_s), 1.5}}; }

Update update_at(int i, double wall_s) {
  Update u;
  u.t = i * 10 * kNsPerMs;
  u.T_map_body = circle(0.01 * i);
  u.T_map_body.p.x() += 0.002;
  u.velocity = Eigen::Vector3d(-std::sin(0.01 * i), std::cos(0.01 * i), 0);
  u.covariance = 4e-6 * Matrix6d::Identity();
  u.health = i == 0   ? Health::initialising
             : i < 80 ? Health::tracking
             : i < 90 ? Health::lost
                      : Health::tracking;
  if (i == 0 || i == 80 || i == 90) u.reason = "because, \"so\"";
  u.events_read = 1000 + i;
  u.events_kept = 800;
  u.points = 300;
  u.points_matched = 250;
  u.times = {wall_s, wall_s, wall_s, 2 * wall_s, wall_s};
  return u;
}

RunSummary a_summary() {
  RunSummary s;
  s.title = "a <b>circle</b> </script><script>alert(1)</script> & more";
  s.T_body_cam = {so3::exp({0.1, 0, 0}), {0.05, 0, 0}};
  for (int i = -50; i <= 250; ++i) s.truth.push_back({i * 10 * kNsPerMs, circle(0.01 * i)});
  s.map_points = {{1, 2, 3}, {0, 0, 0}, {1e6, 0, 0}};
  s.events_read = 120'000;
  s.events_kept = 90'000;
  s.hot_pixels = {{3, 4}};
  s.wall_s = 0.5;
  s.cpu_s = 0.4;
  s.peak_memory_mb = 60;
  return s;
}

struct Settings {
  double rate_hz = 300;
  bool on = true;
  std::string name = "x: y";
};

Expected<RunOutcome> write_run(const std::string& path, double wall_s = 1e-4, bool replace = false) {
  auto folder = RunFolder::create(path, replace);
  if (!folder) return folder.error();
  for (int i = 0; i <= 150; ++i) folder->add(update_at(i, wall_s));
  folder->add_overlay("at 1 s", RgbImage(8, 6));
  Settings config;
  ConfigTable table;
  table.add("tracker.rate_hz", config.rate_hz, "Hz", "updates", {1, 1000});
  table.add("tracker.on", config.on, "a switch");
  table.add("tracker.name", config.name, "a name");
  return folder->finish(a_summary(), table);
}

TEST(Overlay, OnIsRedOffIsBlueMatchedIsGreenNothingIsWhite) {
  const std::vector<float> decay{1, -1, 0, 0, 0, 0, 0, 0, 0, 0, 0.5f, 0, 0, 0, 0, 0};
  const std::vector<OverlayPoint> points{
      {3, 3, true}, {-100, 2, true}, {1e30f, 0, true}, {std::nanf(""), 0, true}, {3.4f, 0, false}};
  RgbImage image = draw_overlay(4, 4, decay, points);
  const auto is = [&](int x, int y) { return std::vector<int>(image.pixel(x, y), image.pixel(x, y) + 3); };
  EXPECT_GT(is(0, 0)[0], is(0, 0)[2] + 100);
  EXPECT_GT(is(1, 0)[2], is(1, 0)[0] + 100);
  EXPECT_EQ(is(0, 2), (std::vector<int>{255, 255, 255}));
  EXPECT_GT(is(2, 2)[0], is(2, 2)[2]);
  EXPECT_GT(is(3, 3)[1], is(3, 3)[0] + 100);
  EXPECT_EQ(is(3, 0)[0], is(3, 0)[1]);
}

TEST(Series, ThinningKeepsPeaksAndEnds) {
  Series s;
  for (int i = 0; i < 100'000; ++i) s.add(i, i == 54'321 ? 9 : i == 777 ? -9 : std::sin(1e-3 * i));
  const Series few = thin(s, 1000);
  EXPECT_LE(few.y.size(), 1000u);
  EXPECT_GE(few.y.size(), 900u);
  EXPECT_EQ(*std::max_element(few.y.begin(), few.y.end()), 9);
  EXPECT_EQ(*std::min_element(few.y.begin(), few.y.end()), -9);
  EXPECT_EQ(few.t.front(), 0);
  EXPECT_EQ(few.t.back(), 99'999);
  EXPECT_TRUE(std::is_sorted(few.t.begin(), few.t.end()));
  EXPECT_EQ(thin(few, 1000).y, few.y);
}

TEST(Series, SpreadIndicesReachBothEnds) {
  EXPECT_EQ(evenly_spaced_indices(10, 3), (std::vector<std::size_t>{0, 4, 9}));
  EXPECT_EQ(evenly_spaced_indices(2, 5), (std::vector<std::size_t>{0, 1}));
  EXPECT_TRUE(evenly_spaced_indices(0, 5).empty());
  EXPECT_EQ(evenly_spaced_indices(7, 1), (std::vector<std::size_t>{0}));
}

TEST(Series, HistogramSharesAddUpToOne) {
  const LogHistogram h = log_histogram({0, 0.001, 0.5, 0.5, 3, 1e9}, 0.001, 10, 4);
  EXPECT_EQ(h.edges.size(), h.shares.size() + 1);
  EXPECT_NEAR(std::accumulate(h.shares.begin(), h.shares.end(), 0.0), 1, 1e-12);
  EXPECT_NEAR(h.shares.front(), 2.0 / 6, 1e-12);
  EXPECT_NEAR(h.shares.back(), 1.0 / 6, 1e-12);
}

TEST(Series, Base64OfTheStandardsExamples) {
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foo"), "Zm9v");
  EXPECT_EQ(base64("\xff\xfe"), "//4=");
}

TEST(RunFolder, HoldsAllFilesAndTheAgreedWords) {
  const Folder folder;
  const auto out = write_run(folder.file("run"));
  ASSERT_TRUE(out) << out.error().line();
  for (const char* name : {"trajectory.tum", "trajectory_camera.tum", "states.csv", "latency.csv",
                           "summary.json", "config.yaml", "report.html"})
    EXPECT_TRUE(fs::exists(folder.file("run/") + name)) << name;
  EXPECT_EQ(folder.names().size(), 1u);  // nothing temporary is left beside it

  const Json j = Json::parse(content(folder.file("run/summary.json")));
  EXPECT_EQ(j["status"], "tracking");
  EXPECT_NEAR(j["accuracy"]["ate_mean_mm"], 2, 1e-5);
  EXPECT_EQ(j["accuracy"]["alignment"], "none");
  EXPECT_EQ(j["accuracy"]["pairs"], 141);
  EXPECT_NEAR(j["accuracy"]["nees6_mean"], 1.0 / 6, 1e-3);
  EXPECT_TRUE(j["accuracy"].contains("velocity_rmse_mm_s"));
  EXPECT_NEAR(j["coverage"], 1 - 6.0 / 150, 1e-5);  // between 0.79 and 0.90: instants 0.82 ... 0.87
  EXPECT_EQ(j["lost"].size(), 1u);
  EXPECT_NEAR(j["latency"]["update_p50_ms"], 0.4, 1e-6);
  EXPECT_NEAR(j["latency"]["stages"]["register"]["p99_ms"], 0.2, 1e-6);
  EXPECT_EQ(j["events"]["read"], 120'000);
  EXPECT_NEAR(j["events"]["rate_mev_s"], 0.24, 1e-9);
  EXPECT_EQ(j["events"]["hot_pixels"][0][1], 4);
  EXPECT_NEAR(j["resources"]["cpu_share"], 0.4 / 1.5, 1e-5);
  EXPECT_EQ(j["health"].size(), 4u);
  EXPECT_EQ(j["health"][2]["state"], "lost");
  EXPECT_EQ(j["health"][2]["reason"], "because, \"so\"");
  EXPECT_EQ(j["config"]["tracker.rate_hz"], 300);
  EXPECT_EQ(j["config"]["tracker.on"], true);
  EXPECT_EQ(j["config"]["tracker.name"], "x: y");
  EXPECT_TRUE(j["versions"].contains("evpose"));
  EXPECT_EQ(std::count(out->text.begin(), out->text.end(), '\n'),
            5 + 3);  // with the loss, its cause and remedy
}

TEST(RunFolder, RowsHaveAsManyFieldsAsTheHeaderAndLostPosesAreNoTrajectory) {
  const Folder folder;
  ASSERT_TRUE(write_run(folder.file("run")));
  std::ifstream states(folder.file("run/states.csv"));
  std::string header, row;
  std::getline(states, header);
  std::getline(states, row);
  std::getline(states, row);  // one without a reason, so without commas in quotes
  EXPECT_EQ(std::count(header.begin(), header.end(), ','), std::count(row.begin(), row.end(), ','));
  const std::string trajectory = content(folder.file("run/trajectory.tum"));
  EXPECT_EQ(std::count(trajectory.begin(), trajectory.end(), '\n'), 1 + 151 - 10);
}

TEST(RunFolder, SameEstimatesGiveTheSameBytes) {
  const Folder folder;
  ASSERT_TRUE(write_run(folder.file("a"), 1e-4));
  ASSERT_TRUE(write_run(folder.file("b"), 7e-4));
  for (const char* name : {"trajectory.tum", "trajectory_camera.tum", "states.csv", "config.yaml"})
    EXPECT_EQ(content(folder.file("a/") + name), content(folder.file("b/") + name)) << name;
  EXPECT_NE(content(folder.file("a/latency.csv")), content(folder.file("b/latency.csv")));
}

TEST(RunFolder, ReplacesAnEarlierRunOnlyIfAskedToAndWhenFinished) {
  const Folder folder;
  ASSERT_TRUE(write_run(folder.file("run/")));
  const std::string before = content(folder.file("run/latency.csv"));
  {
    auto unfinished = RunFolder::create(folder.file("run"), true);
    ASSERT_TRUE(unfinished);
    unfinished->add(update_at(0, 1));
  }
  EXPECT_EQ(content(folder.file("run/latency.csv")), before);
  EXPECT_EQ(folder.names().size(), 1u);
  const auto refused = write_run(folder.file("run"), 3e-4);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().line().find("holds an earlier run; replace it with --force"), std::string::npos);
  EXPECT_EQ(content(folder.file("run/latency.csv")), before);
  ASSERT_TRUE(write_run(folder.file("run"), 3e-4, true));
  EXPECT_NE(content(folder.file("run/latency.csv")), before);
  EXPECT_EQ(folder.names().size(), 1u);
}

TEST(RunFolder, LeavesOtherThingsAlone) {
  const Folder folder;
  fs::create_directories(folder.file("mine"));
  std::ofstream(folder.file("mine/thesis.tex")) << "work of years";
  std::ofstream(folder.file("file")) << "a file";
  fs::create_directories(folder.file("empty"));
  EXPECT_NE(RunFolder::create(folder.file("mine"), true).error().line().find("thesis.tex"),
            std::string::npos);
  EXPECT_FALSE(RunFolder::create(folder.file("file"), true));
  EXPECT_FALSE(RunFolder::create(folder.file("no/such/parent"), true));
  EXPECT_FALSE(RunFolder::create("", true));
  EXPECT_FALSE(RunFolder::create("/", true));
  EXPECT_FALSE(RunFolder::create("..", true));
  EXPECT_TRUE(RunFolder::create(folder.file("empty"), true));
  EXPECT_EQ(folder.names().size(), 3u);
}

TEST(RunFolder, OfARunWithoutUpdatesOrTruthIsComplete) {
  const Folder folder;
  auto run = RunFolder::create(folder.file("run"), true);
  ASSERT_TRUE(run);
  ConfigTable table;
  RunSummary summary;
  summary.truth = a_summary().truth;
  const auto out = run->finish(summary, table);
  ASSERT_TRUE(out) << out.error().line();
  EXPECT_EQ(Json::parse(content(folder.file("run/summary.json")))["status"], "lost");
  EXPECT_FALSE(out->score);
}

TEST(Page, NothingInTheDataCanEndItsElement) {
  const Folder folder;
  ASSERT_TRUE(write_run(folder.file("run")));
  const std::string page = content(folder.file("run/report.html"));
  // The shell has four scripts; whatever the title says, there are no more.
  std::size_t ends = 0;
  for (std::size_t at = page.find("</script"); at != std::string::npos; at = page.find("</script", at + 1))
    ++ends;
  EXPECT_EQ(ends, 4u);
  EXPECT_EQ(page.find("<b>circle"), std::string::npos);
  EXPECT_NE(page.find("&lt;b&gt;circle"), std::string::npos);

  const std::string open = R"(id="run">)";
  const std::size_t begin = page.find(open) + open.size();
  const Json data = Json::parse(page.substr(begin, page.find("</script>", begin) - begin));
  EXPECT_EQ(data["title"], a_summary().title);
  EXPECT_EQ(data["paths"].size(), 2u);
  EXPECT_EQ(data["map"]["x"].size(), 2u);  // the far point is left out
}

/// Noise that neither thins out nor packs.
Expected<RunOutcome> write_noisy_run(const std::string& path) {
  auto folder = RunFolder::create(path, false);
  if (!folder) return folder.error();
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  RunSummary summary = a_summary();
  summary.truth.clear();
  for (int i = 0; i < 6000; ++i) {
    Update u = update_at(i + 100, 1e-4);
    for (int k = 0; k < 3; ++k) {
      u.velocity[k] = normal(random);
      u.gyro_bias[k] = u.accel_bias[k] = 0.01 * normal(random);
      u.velocity_covariance(k, k) = 0.01 * std::abs(normal(random));
      u.T_map_body.p[k] += 0.01 * normal(random);
    }
    summary.truth.push_back({u.t, circle(0.01 * i + 1)});
    summary.map_points.push_back(u.T_map_body.p);
    folder->add(u);
    Calibration c;
    c.intrinsics = Eigen::VectorXd::NullaryExpr(8, [&] { return normal(random); });
    c.intrinsics_sigma = Eigen::VectorXd::Constant(8, 1 + 0.1 * normal(random));
    c.turn_sigma_rad.setConstant(0.01 * std::abs(normal(random)) + 1e-3);
    folder->add_calibration(u.t, c);
  }
  for (int i = 0; i < 8; ++i) {
    RgbImage image(640, 480);
    for (std::uint8_t& byte : image.rgb) byte = random() % 4 == 0 ? 0 : 255;
    folder->add_overlay("noise", image);
  }
  ConfigTable none;
  return folder->finish(summary, none);
}

TEST(Page, OfALongNoisyRunStaysBelowTwoAndAHalfMegabytesWithAllSections) {
  const Folder folder;
  ASSERT_TRUE(write_noisy_run(folder.file("run")));
  const std::string page = content(folder.file("run/report.html"));
  EXPECT_LT(page.size(), 2'500'000u);
  const std::string open = R"(id="run">)";
  const std::size_t begin = page.find(open) + open.size();
  const Json data = Json::parse(page.substr(begin, page.find("</script>", begin) - begin));
  for (const char* part : {"paths", "errors", "motion", "biases", "start", "activity", "health", "overlays"})
    EXPECT_FALSE(data[part].empty()) << part;
  EXPECT_LT(data["overlays"].size(), 8u);
  // The peaks are there, though few of the values are.
  double peak = 0;
  std::ifstream states(folder.file("run/states.csv"));
  std::string row;
  std::getline(states, row);
  while (std::getline(states, row)) {
    std::stringstream fields(row);
    for (int k = 0; k < 9; ++k) std::getline(fields, row, ',');
    peak = std::max(peak, std::stod(row));
  }
  const auto shown = data["motion"]["velocity"][0]["series"]["y"].get<std::vector<double>>();
  EXPECT_LE(shown.size(), 1000u);
  EXPECT_NEAR(*std::max_element(shown.begin(), shown.end()), peak, 1e-4);
}

TEST(Page, TellsWhatWasGivenAndFoundOfTheCalibration) {
  StateLog log;
  for (int i = 0; i < 20; ++i) log.add(update_at(i, 0));
  Calibration c;
  c.time_offset_s = 0.002;
  c.time_sigma_s = 0.001;
  log.calibration = {calibration_row(0, c), calibration_row(kNsPerS, c)};
  RunSummary summary = a_summary();
  summary.start = "started from ground truth";
  RunCalibration known;
  known.given.intrinsics = CameraIntrinsics{400, 400, 320, 240, "none", {}, {640, 480}};
  known.given.sigma.intrinsics = std::vector<double>{2, 2, 1, 1};
  known.found = known.given;
  known.found.intrinsics->fx = 401;
  summary.calibration = known;
  const PageJson page = calibration_page_json(log, summary, 0);
  EXPECT_EQ(page["table"][0], Json({"Focal length x, px", "400", "2", "401", "2", "+0.50"}));
  ASSERT_EQ(page["plots"].size(), 1u) << "the time offset alone is a state";
  EXPECT_EQ(page["plots"][0]["id"], "calibration-time");
  EXPECT_NEAR(page["plots"][0]["lines"][0]["high"]["y"][0], 3, 1e-9);
  EXPECT_EQ(start_json(log, summary)[0], Json({"Start", "started from ground truth"}));
  EXPECT_TRUE(biases_json(log, 0).is_null());
  // A heading that passes half a turn has no jump.
  const auto yaw = motion_json(log, {}, 0)["attitude"][2]["series"]["y"].get<std::vector<double>>();
  EXPECT_NEAR(yaw.back() - yaw.front(), 0.19 * 180 / M_PI, 1e-2);
}

TEST(RunFolder, TellsTheCourseOfTheCalibrationTwentyTimesASecond) {
  const Folder folder;
  auto run = RunFolder::create(folder.file("run"), false);
  ASSERT_TRUE(run);
  for (int i = 0; i < 100; ++i) {
    run->add(update_at(i, 0));
    Calibration c;
    if (i >= 10) c.shift_sigma_m.setConstant(0.01);
    run->add_calibration(i * 10 * kNsPerMs, c);
  }
  ConfigTable none;
  ASSERT_TRUE(run->finish(a_summary(), none));
  std::ifstream file(folder.file("run/calibration.csv"));
  std::string header, row, last;
  std::getline(file, header);
  EXPECT_EQ(header.rfind("t_s,time_offset_s,turn_x_rad,", 0), 0u);
  std::size_t rows = 0;
  while (std::getline(file, row)) last = row, ++rows;
  EXPECT_EQ(rows, 18u) << "from 0.1 s, when it became a state";
  EXPECT_EQ(std::count(header.begin(), header.end(), ','), std::count(last.begin(), last.end(), ','));
}

TEST(Page, KeepsAtSignsOfTheData) {
  const std::string page = page_html("a@TITLE@b", R"({"x": "@SCRIPT@"})");
  EXPECT_NE(page.find("<title>a@TITLE@b</title>"), std::string::npos);
  EXPECT_NE(page.find(R"({"x": "@SCRIPT@"})"), std::string::npos);
}

TEST(Summary, ScoreWordsAreThoseOfTheSummary) {
  std::vector<TimedPose> truth;
  for (int i = 0; i < 200; ++i) truth.push_back({i * 10 * kNsPerMs, circle(0.01 * i)});
  const TrajectoryScore score = score_trajectory({truth, truth, {}, {}, {}}, {});
  const Json j = Json::parse(score_json(score));
  const std::set<std::string> agreed{"ate_mean_mm", "ate_median_mm", "ate_rmse_mm",  "ate_p95_mm",
                                     "ate_max_mm",  "are_mean_deg",  "are_rmse_deg", "are_p95_deg",
                                     "rte_10ms_mm", "rte_100ms_mm",  "rre_10ms_deg", "rre_100ms_deg",
                                     "lag_ms",      "jitter_mm",     "alignment",    "pairs"};
  for (const std::string& word : agreed) EXPECT_TRUE(j["accuracy"].contains(word)) << word;
  EXPECT_EQ(j["coverage"], 1);
  EXPECT_NE(score_text(score).find("ate_mean_mm"), std::string::npos);
}

/// Contour points every 2 cm along a line.
void add_line(const Eigen::Vector3d& from, const Eigen::Vector3d& to, ContourMap& map) {
  const double length = (to - from).norm();
  const int count = static_cast<int>(length / 0.02);
  for (int k = 0; k < count; ++k) {
    ContourPoint p;
    p.position = (from + (to - from) * ((k + 0.5) / count)).cast<float>();
    p.tangent = ((to - from) / length).cast<float>();
    p.normal = p.tangent.unitOrthogonal();
    p.length = 0.02F;
    p.sigma = 0.002F;
    map.points.push_back(p);
  }
}

TEST(MapAccuracy, ALonePadSeenFromTwoMetresTellsLittleSideways) {
  const auto camera = make_camera({460, 460, 319.5, 239.5, "none", {}, {640, 480}});
  ASSERT_TRUE(camera);
  ContourMap map;
  constexpr double kHalf = 0.25;
  const Eigen::Vector3d corners[4] = {
      {-kHalf, -kHalf, 0}, {kHalf, -kHalf, 0}, {kHalf, kHalf, 0}, {-kHalf, kHalf, 0}};
  for (int k = 0; k < 4; ++k) add_line(corners[k], corners[(k + 1) % 4], map);
  Eigen::Matrix3d down;
  down << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  const Pose above{Eigen::Quaterniond(down), {0, 0, 2}};
  const auto accuracy = [&] {
    std::vector<std::uint32_t> all(map.points.size());
    std::iota(all.begin(), all.end(), 0U);
    return expected_accuracy(map, all, **camera, above);
  };
  const ViewAccuracy alone = accuracy();
  EXPECT_LT(std::abs(alone.worst_axis.z()), 0.1);
  EXPECT_GT(alone.worst_mm, 10);
  // Boxes of different heights around it tell tilt from sideways.
  for (const double x : {-0.7, 0.5})
    for (const double z : {0.0, 0.4, 0.8}) {
      add_line({x, -0.3, z}, {x, 0.3, z}, map);
      add_line({x, 0.3, z}, {x + 0.2, 0.3, z}, map);
    }
  EXPECT_LT(accuracy().worst_mm, alone.worst_mm / 3);
}

}  // namespace
}  // namespace evpose
