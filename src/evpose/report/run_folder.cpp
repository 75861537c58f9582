// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/run_folder.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <system_error>

#include "evpose/io/calibration/kalibr.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/io/motion/trajectory_tum.h"
#include "evpose/report/page.h"
#include "evpose/report/state_log.h"
#include "evpose/report/summary.h"

namespace evpose {
namespace {

namespace fs = std::filesystem;

constexpr std::array kFiles{"trajectory.tum",   "trajectory_camera.tum", "states.csv",  "states_imu.csv",
                            "latency.csv",      "summary.json",          "config.yaml", "report.html",
                            "calibration.yaml", "calibration.csv"};
constexpr TimeNs kCalibrationApart = 50 * kNsPerMs;  // rows of calibration.csv

/// Nothing, an empty folder, or if asked for an earlier run may be replaced.
Status check_place(const fs::path& place, bool replace) {
  std::error_code error;
  const fs::file_status status = fs::symlink_status(place, error);
  if (status.type() == fs::file_type::not_found) return {};
  const std::string fix = "choose another output folder, or move it away";
  if (status.type() != fs::file_type::directory)
    return Error{place.string(), "is in the way of the run folder", fix};
  bool empty = true, has_summary = false;
  for (fs::directory_iterator it(place, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (std::find(kFiles.begin(), kFiles.end(), name) == kFiles.end())
      return Error{place.string(), "is not a run folder of evpose: it holds '" + name + "'", fix};
    empty = false;
    has_summary = has_summary || name == "summary.json";
  }
  if (error) return Error{place.string(), "cannot be read: " + error.message(), fix};
  if (!empty && !has_summary)
    return Error{place.string(), "is not a run folder of evpose: it has no summary.json", fix};
  if (!empty && !replace)
    return Error{place.string(), "holds an earlier run",
                 "replace it with --force, or give another name with -o"};
  return {};
}

std::optional<TrajectoryScore> score_run(const StateLog& log, const std::vector<TimedPose>& truth) {
  if (truth.size() < 2 || log.rows.empty()) return std::nullopt;
  std::vector<TimedPose> estimate;
  std::vector<Matrix6d> covariances;
  std::vector<Eigen::Vector3d> velocities;
  for (const StateRow& row : log.rows) {
    if (!row.valid()) continue;
    estimate.push_back({row.t, row.T_map_body});
    covariances.push_back(row.covariance_matrix());
    velocities.push_back(row.velocity);
  }
  // Outside the run there was nothing to track.
  ScoreOptions options;
  options.from = log.rows.front().t;
  options.to = log.rows.back().t;
  return score_trajectory({estimate, truth, covariances, velocities, {}}, options);
}

}  // namespace

struct RunFolder::State {
  fs::path place, folder;  ///< where it will stand; where it is made
  std::optional<AtomicFile> states, latency, states_imu, calibration;
  StateLog log;
  std::vector<OverlayPicture> overlays;
  bool replace = false;  ///< what stands there
  bool finished = false;

  ~State() {
    if (finished || folder.empty()) return;
    std::error_code ignored;
    fs::remove_all(folder, ignored);
  }
  std::string file(const char* name) const { return (folder / name).string(); }
  /// Begins a table with its first row. If it cannot be made, neither can the other files: they tell.
  void begin(std::optional<AtomicFile>& table, const char* name, const std::string& header);
  /// The user knows the folder by the place where it will stand.
  Status commit_tables();
  Status write_trajectories(const Pose& T_body_cam) const;
  Status move_into_place();
};

void RunFolder::State::begin(std::optional<AtomicFile>& table, const char* name, const std::string& header) {
  if (table) return;
  auto opened = AtomicFile::create(file(name));
  if (!opened) return;
  table.emplace(std::move(opened).value());
  table->write(header);
}

Status RunFolder::State::commit_tables() {
  for (auto* table : {&states, &latency, &states_imu, &calibration}) {
    if (!*table) continue;
    if (Status done = (*table)->commit(); !done)
      return Error{place.string(), done.error().what, done.error().fix};
  }
  return {};
}

Status RunFolder::State::write_trajectories(const Pose& T_body_cam) const {
  std::vector<TimedPose> body, camera;
  for (const StateRow& row : log.rows) {
    if (!row.valid()) continue;
    body.push_back({row.t, row.T_map_body});
    camera.push_back({row.t, row.T_map_body * T_body_cam});
  }
  Status written = write_tum(file("trajectory.tum"), body, "t x y z qx qy qz qw (map <- body)");
  if (!written) return written;
  return write_tum(file("trajectory_camera.tum"), camera, "t x y z qx qy qz qw (map <- camera)");
}

Status RunFolder::State::move_into_place() {
  // The place may have changed since the start of the run.
  if (Status free = check_place(place, replace); !free) return free;
  std::error_code error;
  const fs::path old = folder.string() + ".old";
  const bool replaces = fs::exists(place, error);
  if (replaces) fs::rename(place, old, error);
  if (!error) {
    fs::rename(folder, place, error);
    std::error_code ignored;
    if (error && replaces) fs::rename(old, place, ignored);
  }
  if (error)
    return Error{place.string(), "cannot be written: " + error.message(), "check the folder's permissions"};
  finished = true;
  if (replaces) fs::remove_all(old, error);
  return {};
}

RunFolder::RunFolder(std::unique_ptr<State> state) : state_(std::move(state)) {}
RunFolder::RunFolder(RunFolder&&) noexcept = default;
RunFolder& RunFolder::operator=(RunFolder&&) noexcept = default;
RunFolder::~RunFolder() = default;

Expected<RunFolder> RunFolder::create(const std::string& path, bool replace) {
  fs::path place = fs::path(path).lexically_normal();
  if (!place.has_filename()) place = place.parent_path();  // "run/" is "run"
  const std::string name = place.filename().string();
  if (name.empty() || name == "." || name == "..")
    return Error{path.empty() ? "output" : path, "is no name for a run folder",
                 "give the name of a folder to make"};
  if (const Status free = check_place(place, replace); !free) return free.error();

  auto state = std::make_unique<State>();
  state->place = place;
  state->replace = replace;
  const fs::path folder = place.parent_path() / text(".", name, ".partial-", ::getpid());
  std::error_code error;
  const bool made = fs::create_directory(folder, error);
  if (!made)
    return Error{path, "cannot be made: " + (error ? error.message() : "a run is already writing there"),
                 "make its parent folder, or choose another output folder"};
  state->folder = folder;
  for (auto* file : {&state->states, &state->latency}) {
    auto opened = AtomicFile::create(state->file(file == &state->states ? "states.csv" : "latency.csv"));
    if (!opened) return opened.error();
    file->emplace(std::move(opened).value());
  }
  state->states->write(states_csv_header());
  state->latency->write(latency_csv_header());
  return RunFolder(std::move(state));
}

void RunFolder::add(const Update& update) {
  EVPOSE_CHECK(state_ && !state_->finished);
  state_->states->write(states_csv_row(update));
  state_->latency->write(latency_csv_row(update));
  state_->log.add(update);
}

void RunFolder::add_state(const FusionState& state) {
  EVPOSE_CHECK(state_ && !state_->finished);
  state_->begin(state_->states_imu, "states_imu.csv", imu_states_csv_header());
  if (state_->states_imu) state_->states_imu->write(imu_states_csv_row(state));
}

void RunFolder::add_calibration(TimeNs t, const Calibration& calibration) {
  EVPOSE_CHECK(state_ && !state_->finished);
  auto& rows = state_->log.calibration;
  if (!rows.empty() && t < rows.back().t + kCalibrationApart) return;
  const CalibrationRow row = calibration_row(t, calibration);
  if (!is_estimated(row)) return;
  state_->begin(state_->calibration, "calibration.csv", calibration_csv_header(row));
  if (state_->calibration) state_->calibration->write(calibration_csv_row(row));
  rows.push_back(row);
}

void RunFolder::add_overlay(const std::string& caption, const RgbImage& image) {
  EVPOSE_CHECK(state_ && !state_->finished);
  state_->overlays.push_back({caption, encode_png(image), image.width, image.height});
}

Expected<RunOutcome> RunFolder::finish(const RunSummary& summary, const ConfigTable& config) {
  EVPOSE_CHECK(state_ && !state_->finished);
  State& s = *state_;
  RunOutcome out;
  out.score = score_run(s.log, summary.truth);
  out.verdict = judge_run(s.log);
  out.text = summary_text(s.log, summary, out.score) + "\n" + verdict_text(out.verdict, summary.findings);
  out.report = (s.place / "report.html").string();

  const auto write = [&](const char* name, const std::string& content) {
    return write_text_file(s.file(name), content);
  };
  if (Status done = s.commit_tables(); !done) return done.error();
  if (Status done = s.write_trajectories(summary.T_body_cam); !done) return done.error();
  if (Status done = write("config.yaml", config.to_yaml()); !done) return done.error();
  if (Status done = write("summary.json", summary_json(s.log, summary, config, out.score, out.verdict));
      !done)
    return done.error();
  if (summary.calibration)
    if (Status done = write_kalibr_camera(s.file("calibration.yaml"), summary.calibration->found); !done)
      return done.error();
  const std::string page = run_page({s.log, summary, config, out.score, s.overlays});
  if (Status done = write("report.html", page); !done) return done.error();
  if (Status done = s.move_into_place(); !done) return done.error();
  return out;
}

}  // namespace evpose
