// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "evpose/core/time.h"
#include "evpose/tracker/tracker.h"
#include "evpose/view/server.h"

namespace evpose {

/// One pose for the page: what viewer.js calls a row, in this order.
inline constexpr std::array<const char*, 29> kViewColumns{
    "t",          "x",       "y",      "z",   "qx",  "qy",  "qz",  "qw",           "vx",     "vy",
    "vz",         "cxx",     "cxy",    "cxz", "cyy", "cyz", "czz", "rotation_deg", "health", "rate_mev_s",
    "latency_ms", "matched", "points", "bgx", "bgy", "bgz", "bax", "bay",          "baz"};
using ViewRow = std::array<double, kViewColumns.size()>;

/// `t_s`: since the first pose. `rate_mev_s`: events read; `latency_ms`: as the driver measures it.
ViewRow view_row(const Update& update, double t_s, double rate_mev_s, double latency_ms);
/// {"mode", "title", "columns", "rows"}.
std::string history_json(const std::string& mode, const std::string& title, const std::vector<ViewRow>& rows);

/// A live tracker for browsers: a history that grows to a bound, poses as they come, pictures while somebody
/// looks.
class Viewer {
 public:
  static Expected<std::unique_ptr<Viewer>> start(const ServerConfig& config, const std::string& title,
                                                 const ContourMap& map);

  /// An update of `tracker`, which is told when it has to keep what is drawn. `delay_ms`: from its instant to
  /// now.
  void add(const Update& update, Tracker& tracker, double delay_ms);
  void notice(const std::string& words);
  std::string address() const { return server_->address(); }

 private:
  explicit Viewer(std::string title) : title_(std::move(title)) {}
  void flush(TimeNs t);
  void show(const Update& update, Tracker& tracker);
  void draw(const Tracker& tracker, const Update& update);

  std::string title_;
  std::mutex mutex_;
  std::deque<ViewRow> history_;
  TimeNs first_ = 0, last_ = 0, next_row_ = 0, next_flush_ = 0, next_picture_ = 0;
  bool any_ = false;
  std::int64_t events_ = 0;
  std::vector<ViewRow> waiting_;
  std::unique_ptr<Server> server_;  ///< last: its thread reads the others
};

}  // namespace evpose
