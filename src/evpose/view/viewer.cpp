// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/view/viewer.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>

#include "evpose/view/pages.h"
#include "evpose/view/picture.h"

namespace evpose {
namespace {

constexpr TimeNs kRow = 33 * kNsPerMs, kFlush = 66 * kNsPerMs, kPicture = 200 * kNsPerMs;  // of data time
constexpr TimeNs kPictureLead = 50 * kNsPerMs;      // before a picture its events are kept
constexpr std::size_t kMostHistory = 30 * 60 * 20;  // rows: twenty minutes

std::string rows_json(auto begin, auto end) {
  std::string out = "[";
  char number[32];
  for (auto row = begin; row != end; ++row) {
    out += out.size() > 1 ? ",[" : "[";
    for (std::size_t i = 0; i < row->size(); ++i) {
      const double value = (*row)[i];
      if (std::isfinite(value))
        std::snprintf(number, sizeof number, "%s%.8g", i == 0 ? "" : ",", value);
      else
        std::snprintf(number, sizeof number, "%snull", i == 0 ? "" : ",");
      out += number;
    }
    out += ']';
  }
  return out + "]";
}

}  // namespace

ViewRow view_row(const Update& u, double t_s, double rate_mev_s, double latency_ms) {
  const Eigen::Vector3d& p = u.T_map_body.p;
  const Eigen::Quaterniond& q = u.T_map_body.q;
  const Matrix6d& c = u.covariance;
  const double rotation_deg = std::sqrt(std::max(0.0, c.diagonal().tail<3>().maxCoeff())) * 180 / M_PI;
  return {t_s,
          p.x(),
          p.y(),
          p.z(),
          q.x(),
          q.y(),
          q.z(),
          q.w(),
          u.velocity.x(),
          u.velocity.y(),
          u.velocity.z(),
          c(0, 0),
          c(0, 1),
          c(0, 2),
          c(1, 1),
          c(1, 2),
          c(2, 2),
          rotation_deg,
          static_cast<double>(u.health),
          rate_mev_s,
          latency_ms,
          static_cast<double>(u.points_matched),
          static_cast<double>(u.points),
          u.gyro_bias.x(),
          u.gyro_bias.y(),
          u.gyro_bias.z(),
          u.accel_bias.x(),
          u.accel_bias.y(),
          u.accel_bias.z()};
}

std::string history_json(const std::string& mode, const std::string& title,
                         const std::vector<ViewRow>& rows) {
  const nlohmann::json head = {{"mode", mode}, {"title", title}, {"columns", kViewColumns}};
  std::string out = head.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  out.pop_back();
  return out + ",\"rows\":" + rows_json(rows.begin(), rows.end()) + "}";
}

Expected<std::unique_ptr<Viewer>> Viewer::start(const ServerConfig& config, const std::string& title,
                                                const ContourMap& map) {
  std::unique_ptr<Viewer> viewer(new Viewer(title));
  auto server = Server::start(config);
  if (!server) return server.error();
  viewer->server_ = std::move(*server);
  set_viewer_pages(*viewer->server_, "live");
  viewer->server_->set_page("/scene.json", "application/json", scene_json(&map));
  viewer->server_->set_page("/history.json", "application/json", [raw = viewer.get()] {
    std::vector<ViewRow> rows;
    {
      const std::lock_guard lock(raw->mutex_);
      rows.assign(raw->history_.begin(), raw->history_.end());
    }
    return history_json("live", raw->title_, rows);
  });
  return viewer;
}

void Viewer::add(const Update& u, Tracker& tracker, double delay_ms) {
  if (!any_ || u.t < last_) {  // the first, or a clock that went back: the page starts anew
    const std::lock_guard lock(mutex_);
    history_.clear();
    waiting_.clear();
    first_ = next_row_ = next_flush_ = next_picture_ = u.t;
    last_ = u.t;
    if (any_) server_->publish({std::make_shared<std::string>("{\"kind\":\"restart\"}"), false});
    any_ = true;
    events_ = 0;
  }
  events_ += u.events_read;
  if (u.t >= next_row_) {
    const double span_s = to_seconds(u.t - last_);
    const double rate = span_s > 0 ? 1e-6 * static_cast<double>(events_) / span_s : 0;
    const ViewRow row = view_row(u, to_seconds(u.t - first_), rate, delay_ms);
    events_ = 0;
    last_ = u.t;
    next_row_ = u.t + kRow;
    waiting_.push_back(row);
    const std::lock_guard lock(mutex_);
    history_.push_back(row);
    if (history_.size() > kMostHistory) history_.pop_front();
  }
  flush(u.t);
  show(u, tracker);
}

/// A picture now and then while somebody looks. Between them the tracker does not keep the events.
void Viewer::show(const Update& u, Tracker& tracker) {
  const bool looks = server_->clients() > 0;
  if (!looks) next_picture_ = u.t + kPictureLead;
  if (looks && u.t >= next_picture_ && tracker.events().surface() != nullptr) {
    next_picture_ = u.t + kPicture;
    draw(tracker, u);
  }
  tracker.keep_time_surface(looks && u.t + kPictureLead >= next_picture_);
}

void Viewer::flush(TimeNs t) {
  if (t < next_flush_ || waiting_.empty()) return;
  next_flush_ = t + kFlush;
  if (server_->clients() > 0)
    server_->publish({std::make_shared<std::string>(
                          "{\"kind\":\"rows\",\"rows\":" + rows_json(waiting_.begin(), waiting_.end()) + "}"),
                      false});
  waiting_.clear();
}

void Viewer::notice(const std::string& words) {
  const nlohmann::json message = {{"kind", "notice"}, {"words", words}};
  server_->publish(
      {std::make_shared<std::string>(message.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)),
       false});
}

void Viewer::draw(const Tracker& tracker, const Update& u) {
  const std::string picture = picture_bytes(*tracker.events().surface(), tracker.events().stamp(u.t),
                                            tracker.chosen_points(kPictureDecay_s), to_seconds(u.t - first_));
  server_->publish({std::make_shared<std::string>(picture), true});
}

}  // namespace evpose
