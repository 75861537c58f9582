// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/published.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <thread>
#include <vector>

#include "evpose/core/log.h"
#include "evpose/core/parallel.h"
#include "evpose/eval/score.h"
#include "evpose/io/maps/cloud_files.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/io/recording/dataset_layouts.h"
#include "evpose/map_build/paper_map.h"
#include "evpose/run/progress.h"
#include "evpose/run/track_recording.h"

namespace evpose::experiments {
namespace {

namespace fs = std::filesystem;

/// A way to build a map and to track with it.
struct Form {
  const char* name;
  const char* preset;
};
constexpr std::array kForms{Form{"paper", "paper"}, Form{"defaults", ""}};

struct Tracked {
  double ate_mm = 0, are_deg = 0, tracking_percent = 0;
};

Expected<std::vector<std::string>> sequences_in(const std::string& folder, const std::string& layout) {
  std::error_code failed;
  std::vector<std::string> out;
  for (const auto& entry : fs::directory_iterator(folder, failed))
    if (entry.is_directory())
      if (const auto found = find_recording(entry.path().string()); found && found->layout == layout)
        out.push_back(entry.path().string());
  if (failed) return Error{folder, failed.message(), "give the folder that holds the sequences"};
  if (out.empty())
    return Error{folder, "holds no " + layout, "give the folder that holds the sequences, each in its own"};
  std::sort(out.begin(), out.end());
  return out;
}

std::optional<std::string> beside(const std::string& sequence, const char* what,
                                  const std::vector<const char*>& endings) {
  std::error_code ignored;
  for (const char* ending : endings)
    if (std::string path = sequence + what + ending; fs::exists(path, ignored)) return path;
  return std::nullopt;
}

/// The map that a form tracks a sequence with: the one beside it, or one built of the cloud beside it.
Expected<std::string> map_of(const std::string& sequence, const Form& form, const std::string& folder) {
  if (auto contours = beside(sequence, "_contours", {".ply", ".pcd", ".h5"})) return *contours;
  const auto cloud_path = beside(sequence, "_cloud", {".ply", ".pcd", ".las"});
  if (!cloud_path)
    return Error{sequence, "there is no map of it",
                 "put " + sequence + "_contours.ply or " + sequence + "_cloud.ply there"};
  const std::string path = text(folder, "/", fs::path(sequence).filename().string(), "_", form.name, ".h5");
  std::error_code failed;
  if (fs::exists(path, failed)) return path;
  fs::create_directories(folder, failed);
  if (failed) return Error{folder, failed.message(), "give another folder"};
  auto cloud = read_cloud(*cloud_path);
  if (!cloud) return cloud.error();
  ThreadPool pool(static_cast<int>(std::max(1U, std::thread::hardware_concurrency())));
  const auto go_on = [](double) { return true; };
  const auto built = form.preset[0] != '\0' ? map_build::build_paper_map(*std::move(cloud), pool, go_on)
                                            : map_build::build_map(*std::move(cloud), {}, pool, go_on);
  if (!built) return built.error();
  if (auto ok = write_map_h5(path, built->map); !ok) return ok.error();
  return path;
}

Expected<Tracked> track(const std::string& sequence, const Form& form, const std::string& map_folder) {
  const auto map = map_of(sequence, form, map_folder);
  if (!map) return map.error();
  TrackRequest request;
  request.recording = sequence;
  request.map = *map;
  request.init = "groundtruth";
  request.preset = form.preset;
  const auto config = load_config(request);
  if (!config) return config.error();
  const auto job = prepare(request, *config);
  if (!job) return job.error();
  const auto tracker = Tracker::create(job->setup, job->config.tracker, job->start);
  if (!tracker) return tracker.error();
  std::vector<TimedPose> poses;
  std::size_t tracking = 0;
  (*tracker)->on_update([&](const Update& u) {
    poses.push_back({u.t, u.T_map_body});
    tracking += u.health == Health::tracking ? 1 : 0;
  });
  Progress progress(text(fs::path(sequence).filename().string(), ", ", form.name));
  const auto told = [&](double share) { return progress.at(share), true; };
  if (auto ok = feed_recording(job->recording, job->config, **tracker, told); !ok) return ok.error();
  progress.done();
  if (poses.empty())
    return Error{sequence, "the streams end before the first update", "check that they cover the start"};
  const TrajectoryScore score = score_trajectory({poses, job->truth, {}, {}, {}}, {});
  return Tracked{score.ate_mm.mean, score.are_deg.mean,
                 100 * static_cast<double>(tracking) / static_cast<double>(poses.size())};
}

struct Printed {
  int rows = 0;                ///< that have figures
  std::optional<Error> first;  ///< reason of those that have none
};

Expected<Printed> print_data_set(const std::string& folder, const std::string& layout,
                                 const std::string& maps) {
  const auto sequences = sequences_in(folder, layout);
  if (!sequences) return sequences.error();
  std::printf(
      "\n### %s\n\n| sequence | form | ATE mean mm | ARE mean deg | tracked %% |\n|---|---|---|---|---|\n",
      layout.c_str());
  Printed out;
  for (const Form& form : kForms) {
    Tracked sum;
    int of_form = 0;
    for (const std::string& sequence : *sequences) {
      const auto tracked = track(sequence, form, maps);
      const std::string name = fs::path(sequence).filename().string();
      if (!tracked) {
        if (!out.first) out.first = tracked.error();
        log_warning(tracked.error().line());
        std::printf("| %s | %s | - | - | - |\n", name.c_str(), form.name);
        continue;
      }
      std::printf("| %s | %s | %.2f | %.3f | %.1f |\n", name.c_str(), form.name, tracked->ate_mm,
                  tracked->are_deg, tracked->tracking_percent);
      std::fflush(stdout);
      sum.ate_mm += tracked->ate_mm;
      sum.are_deg += tracked->are_deg;
      sum.tracking_percent += tracked->tracking_percent;
      ++of_form;
    }
    if (of_form > 0)
      std::printf("| mean of %d | %s | %.2f | %.3f | %.1f |\n", of_form, form.name, sum.ate_mm / of_form,
                  sum.are_deg / of_form, sum.tracking_percent / of_form);
    out.rows += of_form;
  }
  return out;
}

}  // namespace

Status print_published(const PublishedRequest& request) {
  const std::array<std::array<std::string, 2>, 2> data_sets{
      {{request.vector, "VECtor sequence"}, {request.tum_vie, "TUM-VIE sequence"}}};
  Printed all;
  for (const auto& [folder, layout] : data_sets) {
    if (folder.empty()) continue;
    const auto printed = print_data_set(folder, layout, request.maps);
    if (!printed) return printed.error();
    all.rows += printed->rows;
    if (!all.first) all.first = printed->first;
  }
  if (all.rows == 0 && all.first) return *all.first;
  return {};
}

}  // namespace evpose::experiments
