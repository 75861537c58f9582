// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>

#include "commands.h"
#include "evpose/eval/score.h"
#include "evpose/io/bags/bag_reader.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/io/motion/trajectory.h"
#include "evpose/io/recording/recording.h"
#include "evpose/report/page.h"
#include "evpose/report/run_files.h"
#include "evpose/report/summary.h"

namespace evpose {
namespace {

struct EvalRequest {
  std::string estimate, truth;
  std::string alignment = "none", association = "interpolate";
  double max_gap_s = 0.05, max_difference_s = 0.01, align_first_s = 0;
  std::optional<double> from_s, to_s;
  bool json = false;
  std::string plot;
};

const std::map<std::string, Alignment> kAlignments{
    {"none", Alignment::none}, {"se3", Alignment::se3}, {"sim3", Alignment::sim3}, {"yaw", Alignment::yaw}};
const std::map<std::string, AssociationRule> kRules{{"interpolate", AssociationRule::interpolate},
                                                    {"nearest", AssociationRule::nearest}};

template <class Value>
std::vector<std::string> names(const std::map<std::string, Value>& values) {
  std::vector<std::string> out;
  for (const auto& [name, value] : values) out.push_back(name);
  return out;
}

ScoreOptions options_of(const EvalRequest& request) {
  ScoreOptions options;
  options.alignment = kAlignments.at(request.alignment);
  options.association = {kRules.at(request.association), request.max_gap_s, request.max_difference_s};
  options.align_first_s = request.align_first_s;
  if (request.from_s) options.from = from_seconds(*request.from_s);
  if (request.to_s) options.to = from_seconds(*request.to_s);
  return options;
}

std::string times_in_words(const std::vector<TimedPose>& trajectory) {
  char out[100];
  std::snprintf(out, sizeof out, "%.3f .. %.3f s", 1e-9 * static_cast<double>(trajectory.front().t),
                1e-9 * static_cast<double>(trajectory.back().t));
  return out;
}

/// The trajectory of a file, or of the run folder that `evpose track -o` left.
Expected<std::vector<TimedPose>> read_estimate(const std::string& path) {
  return read_trajectory(is_run_folder(path) ? path + "/trajectory.tum" : path);
}

/// The ground truth of a file, or of a recording: then in the map and on the IMU's clock, as runs are.
Expected<std::vector<TimedPose>> read_truth(const std::string& path) {
  if (!std::filesystem::is_directory(path) || is_rosbag2_folder(path)) return read_trajectory(path);
  const auto recording = open_recording(path);
  if (!recording) return recording.error();
  if (recording->groundtruth_path.empty())
    return Error{path, "the recording has no ground truth",
                 "give a recording that has, or a trajectory's file"};
  return read_groundtruth(*recording);
}

std::string file_name(const std::string& path) { return std::filesystem::path(path).filename().string(); }

int eval(const EvalRequest& request) {
  const auto estimate = read_estimate(request.estimate);
  if (!estimate) return bad_input(estimate.error());
  const auto truth = read_truth(request.truth);
  if (!truth) return bad_input(truth.error());
  if (truth->size() < 2) return bad_input({request.truth, "one pose is no trajectory", "give two or more"});
  const TrajectoryScore score = score_trajectory({*estimate, *truth, {}, {}, {}}, options_of(request));
  if (score.pairs == 0)
    return bad_input(
        {request.estimate,
         text("fewer than two poses have a partner in ", request.truth, " (estimate ",
              times_in_words(*estimate), ", ground truth ", times_in_words(*truth), ")"),
         "check that both share one clock, or widen --from, --to, --max-gap or --max-difference"});
  if (!request.plot.empty()) {
    const std::string page =
        score_page(file_name(request.estimate) + " against " + file_name(request.truth), "", score, *truth);
    if (const Status written = write_text_file(request.plot, page); !written)
      return bad_input(written.error());
  }
  if (request.json)
    std::fputs(score_json(score).c_str(), stdout);
  else
    std::printf("%s\n", score_text(score).c_str());
  return 0;
}

}  // namespace

void add_eval(CLI::App& app, std::function<int()>& run) {
  auto* command = app.add_subcommand("eval", "Judge a trajectory against ground truth");
  const auto request = std::make_shared<EvalRequest>();
  EvalRequest& r = *request;
  command
      ->add_option("estimate", r.estimate, "run folder, or a trajectory: TUM, EuRoC or KITTI file, or a bag")
      ->required();
  command
      ->add_option("groundtruth", r.truth,
                   "recording with ground truth, or a trajectory of the same frame and body")
      ->required();
  command->add_option("--align", r.alignment, "what is fitted before errors are taken")
      ->check(CLI::IsMember(names(kAlignments)))
      ->capture_default_str();
  command->add_option("--align-first", r.align_first_s, "fit over the first so many seconds; 0: over all")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_option("--association", r.association, "how a pose finds its true partner")
      ->check(CLI::IsMember(names(kRules)))
      ->capture_default_str();
  command->add_option("--max-gap", r.max_gap_s, "longest gap of the ground truth to interpolate in [s]")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  command->add_option("--max-difference", r.max_difference_s, "largest time between nearest partners [s]")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  command->add_option("--from", r.from_s, "judge from this time on [s]")->check(CLI::Range(-4e9, 4e9));
  command->add_option("--to", r.to_s, "judge up to this time [s]")->check(CLI::Range(-4e9, 4e9));
  command->add_flag("--json", r.json, "print JSON");
  command->add_option("--plot", r.plot, "write a page with plots to this HTML file");
  command->callback([request, &run] { run = [request] { return eval(*request); }; });
}

}  // namespace evpose
