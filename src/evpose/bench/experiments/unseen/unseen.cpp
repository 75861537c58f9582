// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/unseen/unseen.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <sstream>

#include "evpose/bench/experiments/recordings.h"
#include "evpose/bench/experiments/unseen/page.h"
#include "evpose/bench/experiments/unseen/tables.h"
#include "evpose/bench/experiments/unseen/tracked_run.h"
#include "evpose/core/parallel.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/io/files/crc32.h"

namespace evpose::experiments {
namespace {

namespace fs = std::filesystem;
using unseen::Given;
using unseen::SeedResult;

constexpr std::size_t kLargestProgram = 1U << 30;

std::string checksum(const std::string& bytes) {
  char out[12];
  std::snprintf(out, sizeof out, "%08x", crc32(bytes.data(), bytes.size()));
  return out;
}

/// What all results of a run depend on besides their draws: the program's bytes and the settings.
Expected<std::string> run_key(const RunConfig& config) {
  const auto program = read_text_file("/proc/self/exe", kLargestProgram);
  if (!program) return program.error();
  RunConfig all = config;
  ConfigTable table;
  describe(table, all);
  return checksum(*program) + " " + checksum(table.to_yaml());
}

/// The work on the seeds of one request; seeds may be worked on at the same time.
class Run {
 public:
  Run(const UnseenRequest& request, const RunConfig& config, std::string key, std::vector<SeedResult> known)
      : request_(request),
        config_(config),
        key_(std::move(key)),
        known_(std::move(known)),
        start_s_(wall_s()) {}

  Status make_folders() const;
  /// Does what is left of a seed.
  void work_on(int seed);
  Status finish(const std::vector<SeedResult>& before);

 private:
  std::string seed_path(int seed) const;
  std::optional<SeedResult> find_result(int seed) const;
  std::optional<SeedResult> find_known(int seed) const;
  std::string key_of(const unseen::Draw& draw) const { return key_ + " " + draw.key(); }
  Expected<SeedResult> make_result(int seed) const;
  Status track(const unseen::Flight& flight, Given given, SeedResult& result) const;
  void keep(Expected<SeedResult> result);
  bool time_is_up() const { return request_.minutes > 0 && wall_s() - start_s_ > 60 * request_.minutes; }

  const UnseenRequest& request_;
  const RunConfig& config_;
  std::string key_;
  std::vector<SeedResult> known_;  ///< of another run
  double start_s_;
  std::mutex mutex_;
  std::map<int, SeedResult> results_;
  std::optional<Error> error_;
};

Status Run::make_folders() const {
  for (const std::string& folder : {request_.output + "/seeds", request_.flights}) {
    std::error_code error;
    if (!folder.empty()) fs::create_directories(folder, error);
    if (error) return Error{folder, error.message(), "name a folder that can be written"};
  }
  return {};
}

std::string Run::seed_path(int seed) const {
  char name[40];
  std::snprintf(name, sizeof name, "/seeds/%04d.json", seed);
  return request_.output + name;
}

/// The finished result of a seed, made by this program with these settings.
std::optional<SeedResult> Run::find_result(int seed) const {
  const auto content = read_text_file(seed_path(seed));
  if (!content) return std::nullopt;
  const auto result = unseen::from_json(*content, seed_path(seed));
  if (!result || result->seed != seed) return std::nullopt;
  const auto draw = unseen::draw_flight(seed, static_cast<int>(result->refused.size()), request_.quick);
  if (result->key != key_of(draw)) return std::nullopt;
  return *result;
}

/// What another program with the same draw has found.
std::optional<SeedResult> Run::find_known(int seed) const {
  const auto known = std::ranges::find(known_, seed, &SeedResult::seed);
  if (known == known_.end()) return std::nullopt;
  const auto draw = unseen::draw_flight(seed, static_cast<int>(known->refused.size()), request_.quick);
  if (!known->key.ends_with(" " + draw.key())) return std::nullopt;
  SeedResult out = *known;
  out.of_other_program = true;
  return out;
}

Status Run::track(const unseen::Flight& flight, Given given, SeedResult& result) const {
  auto run = unseen::track_flight(flight, given, config_);
  if (!run) return run.error();
  result.runs[static_cast<std::size_t>(given)] = run->judgement.figures;
  const std::string beside = request_.output + "/";
  if (Status done = write_text_file(beside + unseen::course_name(result.seed, given),
                                    unseen::course_picture(run->judgement.course));
      !done)
    return done;
  if (!run->picture) return {};
  return write_text_file(beside + unseen::moment_name(result.seed, given), encode_png(*run->picture));
}

Expected<SeedResult> Run::make_result(int seed) const {
  const bool kept = !request_.flights.empty();
  char name[40];
  std::snprintf(name, sizeof name, "/%sflight_%04d", request_.quick ? "quick_" : "", seed);
  const std::string folder = (kept ? request_.flights : request_.output) + name;
  const int threads_each = std::max(1, request_.threads / std::max(1, request_.seeds));
  const auto flight =
      unseen::provide_flight({folder, seed, request_.quick, request_.rebuild_maps, threads_each});
  if (!flight) return flight.error();
  SeedResult result;
  result.seed = seed;
  result.key = key_of(flight->draw);
  result.draw = flight->draw;
  result.refused = flight->refused;
  result.duration_s = flight->duration_s;
  result.mev_s = flight->mev_s;
  for (const Given given : unseen::kGivenKinds)
    if (Status done = track(*flight, given, result); !done) return done.error();
  std::error_code ignored;
  if (!kept) fs::remove_all(folder, ignored);
  if (Status done = write_text_file(seed_path(seed), unseen::to_json(result) + "\n"); !done)
    return done.error();
  return result;
}

void Run::keep(Expected<SeedResult> result) {
  const std::lock_guard lock(mutex_);
  if (!result) {
    if (!error_) error_ = result.error();
    return;
  }
  const auto& runs = result->runs;
  std::printf("seed %d: %s; %s: ATE %.2f, %.2f, %.2f, %.2f mm\n", result->seed, result->draw.scene.c_str(),
              result->draw.motion.c_str(), runs[0].ate_mm, runs[1].ate_mm, runs[2].ate_mm, runs[3].ate_mm);
  std::fflush(stdout);
  const int seed = result->seed;
  results_.emplace(seed, *std::move(result));
}

void Run::work_on(int seed) {
  {
    const std::lock_guard lock(mutex_);
    if (error_) return;
  }
  if (!request_.rebuild_maps) {
    if (auto found = find_result(seed)) return keep(*std::move(found));
    if (auto found = find_known(seed)) return keep(*std::move(found));
  }
  if (!time_is_up()) keep(make_result(seed));
}

std::string command_of(const UnseenRequest& r) {
  std::string out = text("evpose bench unseen --seeds ", r.seeds);
  if (r.from > 0) out += text(" --from ", r.from);
  if (r.quick) out += " --quick";
  for (const std::string& assignment : r.assignments) out += " --set " + assignment;
  return out;
}

/// The lines of a results.jsonl; none if no file is named.
Expected<std::vector<SeedResult>> read_results(const std::string& path) {
  if (path.empty()) return std::vector<SeedResult>();
  const auto content = read_text_file(path);
  if (!content) return content.error();
  std::vector<SeedResult> before;
  std::istringstream lines(*content);
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    auto result = unseen::from_json(line, text(path, ":", ++number));
    if (!result) return result.error();
    before.push_back(*std::move(result));
  }
  return before;
}

Status Run::finish(const std::vector<SeedResult>& before) {
  if (error_) return *error_;
  std::vector<SeedResult> results;
  std::string lines;
  for (const auto& [seed, result] : results_) {
    lines += unseen::to_json(result) + "\n";
    results.push_back(result);
  }
  if (Status done = write_text_file(request_.output + "/results.jsonl", lines); !done) return done;
  const std::string page = unseen::page(results, {command_of(request_), request_.seeds});
  if (Status done = write_text_file(request_.output + "/README.md", page); !done) return done;
  std::printf("\n%s", unseen::summary_table(results).c_str());
  if (!request_.compare.empty())
    std::printf("\nFrom %s to this:\n\n%s", request_.compare.c_str(),
                unseen::comparison(before, results).c_str());
  return {};
}

}  // namespace

Status run_unseen(const UnseenRequest& request) {
  const auto config = configure(request.assignments);
  if (!config) return config.error();
  auto key = run_key(*config);
  if (!key) return key.error();
  auto before = read_results(request.compare);
  if (!before) return before.error();
  auto known = read_results(request.known);
  if (!known) return known.error();
  Run run(request, *config, *std::move(key), *std::move(known));
  if (Status done = run.make_folders(); !done) return done;
  ThreadPool pool(std::min(request.threads, request.seeds));
  pool.for_chunks(static_cast<std::size_t>(request.seeds), 1, [&](std::size_t, std::size_t i, std::size_t) {
    run.work_on(request.from + static_cast<int>(i));
  });
  return run.finish(*before);
}

}  // namespace evpose::experiments
