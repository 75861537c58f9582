// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/view/recorded_pictures.h"

#include <algorithm>
#include <mutex>
#include <nlohmann/json.hpp>

#include "evpose/report/run_pictures.h"
#include "evpose/view/picture.h"

namespace evpose {
namespace {

constexpr TimeNs kApart = 50 * kNsPerMs;  // least time between pictures
constexpr TimeNs kMost = 800;             // pictures: 100 MB at most

/// The rows that are drawn, evenly over the run.
std::vector<std::size_t> choose_rows(const std::vector<RunRow>& rows) {
  std::vector<std::size_t> out;
  const TimeNs apart = std::max(kApart, (rows.back().t - rows.front().t) / kMost + 1);
  TimeNs next = rows.front().t;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (rows[i].t < next) continue;
    out.push_back(i);
    next = std::max(next + apart, rows[i].t);
  }
  return out;
}

}  // namespace

struct RecordedPictures::Progress {
  std::mutex mutex;
  nlohmann::json answer{{"t", nlohmann::json::array()}, {"made", 0}, {"fault", ""}};

  void tell(const char* key, const nlohmann::json& value) {
    const std::lock_guard lock(mutex);
    answer[key] = value;
  }
  std::string words() {
    const std::lock_guard lock(mutex);
    return answer.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  }
};

RecordedPictures::RecordedPictures(Server& server, RunFiles run, ContourMap map)
    : server_(server),
      run_(std::move(run)),
      rows_(choose_rows(run_.rows)),
      progress_(std::make_shared<Progress>()) {
  for (const std::size_t i : rows_)
    progress_->answer["t"].push_back(to_seconds(run_.rows[i].t - run_.rows.front().t));
  server_.set_page("/pictures.json", "application/json",
                   [progress = progress_] { return progress->words(); });
  thread_ = std::thread([this, drawn = std::move(map)]() mutable {
    const Status done = draw_all(std::move(drawn));
    if (!done) progress_->tell("fault", done.error().line());
  });
}

RecordedPictures::~RecordedPictures() {
  stop_ = true;
  thread_.join();
}

Status RecordedPictures::draw_all(ContourMap map) {
  auto pictures = RunPictures::open(run_, std::move(map));
  if (!pictures) return pictures.error();
  for (std::size_t k = 0; k < rows_.size() && !stop_; ++k) {
    const RunRow& row = run_.rows[rows_[k]];
    const auto moment = pictures->look(row);
    if (!moment) return moment.error();
    const double t_s = to_seconds(row.t - run_.rows.front().t);
    server_.set_page("/picture/" + std::to_string(k), "application/octet-stream",
                     picture_bytes(moment->surface, moment->now_us, moment->points, t_s));
    progress_->tell("made", k + 1);
  }
  return {};
}

}  // namespace evpose
