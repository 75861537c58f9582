// SPDX-License-Identifier: BSD-3-Clause
#include "serve_outputs.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "evpose/core/log.h"

namespace evpose {
namespace {

constexpr int kMostReceived =
    16;  // blocks of bytes at a time: whatever floods us does not keep us from tracking
constexpr std::size_t kMostChanges = 10'000;  // of health: a stream may last for days

/// recording.yaml knows best, then the map file, then the configuration.
VehicleFrames vehicle_frames(const FramesConfig& c, const Recording& recording,
                             const MapPlacement& placement) {
  VehicleFrames out;
  constexpr double kRad = M_PI / 180;
  out.T_ned_map = recording.T_ned_map   ? Pose::from_matrix(*recording.T_ned_map)
                  : placement.T_ned_map ? *placement.T_ned_map
                                        : ned_from_heading(c.map_heading_deg * kRad);
  out.T_body_vehicle.p = {c.vehicle_x_m, c.vehicle_y_m, c.vehicle_z_m};
  out.T_body_vehicle.q = so3::exp({0, 0, c.vehicle_yaw_deg * kRad}) *
                         so3::exp({0, c.vehicle_pitch_deg * kRad, 0}) *
                         so3::exp({c.vehicle_roll_deg * kRad, 0, 0});
  return out;
}

}  // namespace

void Delays::add(TimeNs delay) {
  const TimeNs bin = std::clamp<TimeNs>(delay / kBin, 0, static_cast<TimeNs>(bins_.size()) - 1);
  ++bins_[static_cast<std::size_t>(bin)];
  ++count_;
  late_ += delay > kLate ? 1 : 0;
  largest_ = std::max(largest_, delay);
}

double Delays::quantile_ms(double share) const {
  const auto wanted = static_cast<std::uint64_t>(share * static_cast<double>(count_));
  std::uint64_t seen = 0;
  std::size_t bin = 0;
  while (bin + 1 < bins_.size() && (seen += bins_[bin]) <= wanted) ++bin;
  return bin + 1 == bins_.size() ? largest_ms() : 1e3 * to_seconds(static_cast<TimeNs>(bin) * kBin);
}

Outputs::Outputs(const ServeConfig& config, const TrackJob& job, const MapPlacement& placement)
    : frames_(vehicle_frames(config.frames, job.recording, placement)) {}

Status Outputs::open(const ServeRequest& request, const ServeConfig& config, const TrackJob& job) {
  if (request.view >= 0) {
    auto viewer = Viewer::start({config.view_address, request.view}, job.recording.name, *job.map);
    if (!viewer) return viewer.error();
    viewer_ = std::move(*viewer);
    std::fprintf(stderr, "evpose: open %s in a browser\n", viewer_->address().c_str());
  }
  if (!request.mavlink.empty()) {
    auto link = mavlink::Link::open(request.mavlink);
    if (!link) return link.error();
    link_ = std::move(*link);
    reporter_ = std::make_unique<mavlink::Reporter>(config.mavlink, frames_,
                                                    [this](mavlink::Bytes frame) { link_->send(frame); });
  }
  if (!request.track.output.empty()) {
    auto run = RunFolder::create(request.track.output, request.track.replace);
    if (!run) return run.error();
    run_ = std::make_unique<RunFolder>(std::move(*run));
  }
  return {};
}

void Outputs::add(const Update& u, TimeNs data_to_monotonic, Tracker& tracker) {
  if (reporter_) reporter_->add(u, data_to_monotonic);
  const TimeNs delay = monotonic_ns() - (u.t + data_to_monotonic);
  delays_.add(delay);
  if (viewer_) viewer_->add(u, tracker, 1e3 * to_seconds(delay));
  if (delays_.count() == 1) first_t_ = u.t;
  last_t_ = u.t;
  judged_ += counts_in_share(u.health, to_seconds(u.t - first_t_)) ? 1 : 0;
  if (changes_.empty() || u.health != health_ || !u.reason.empty()) {
    changes_.push_back({u.t, u.health, u.reason});
    if (changes_.size() > kMostChanges) changes_.pop_front();
  }
  health_ = u.health;
  ++updates_[static_cast<std::size_t>(u.health)];
  least_share_ = std::min(least_share_, u.share);
  sum_of_shares_ += u.share;
  if (!u.reason.empty()) log_detail(text(to_string(u.health), ": ", u.reason));
  if (run_ && u.t > recorded_until_) {
    run_->add(u);
    run_->add_calibration(u.t, tracker.calibration());
  }
  recorded_until_ = std::max(recorded_until_, u.t);
}

void Outputs::restarted(const std::string& why) {
  if (reporter_) reporter_->restarted(why);
}

std::optional<TrackerStart> Outputs::whereabouts() const {
  const auto place = reporter_ ? reporter_->vehicle_place(monotonic_ns()) : std::nullopt;
  if (!place) return {};
  return TrackerStart{{0, place->T_map_body}, kByGps_m, place->has_heading ? kByCompass_rad : M_PI};
}

void Outputs::notice(const std::string& words) {
  log_warning(words);
  if (viewer_) viewer_->notice(words);
}

void Outputs::ambiguous(const std::string& poses) {
  notice("ambiguous: " + poses);
  if (reporter_) reporter_->ambiguous(poses);
}

void Outputs::stalled(const std::string& what) {
  if (reporter_) reporter_->stalled(what);
}

void Outputs::service(TimeNs now_ns) {
  if (!reporter_) return;
  for (int i = 0; i < kMostReceived; ++i) {
    const auto bytes = link_->receive();
    if (bytes.empty()) break;
    reporter_->receive(bytes, monotonic_ns());
  }
  reporter_->tick(now_ns);
  if (const std::string words = link_->take_notice(); !words.empty()) notice(words);
}

RunVerdict Outputs::verdict() const {
  const std::vector<HealthChange> changes(changes_.begin(), changes_.end());
  const auto tracking = updates_[static_cast<std::size_t>(Health::tracking)];
  return {judged_ == 0 ? 0 : static_cast<double>(tracking) / static_cast<double>(judged_),
          to_seconds(last_t_ - first_t_), problems_of(changes, last_t_)};
}

std::string Outputs::looked_at() const {
  if (least_share_ >= 1) return "all";
  std::array<char, 60> words{};
  std::snprintf(words.data(), words.size(), "%.1f %% on average, at least %.1f %%",
                100 * sum_of_shares_ / static_cast<double>(delays_.count()), 100 * least_share_);
  return words.data();
}

std::string Outputs::healths() const {
  const auto all = std::accumulate(updates_.begin(), updates_.end(), std::uint64_t{0});
  std::string out;
  for (const Health h : {Health::tracking, Health::degraded, Health::ambiguous, Health::lost,
                         Health::initialising, Health::waiting}) {
    const std::uint64_t count = updates_[static_cast<std::size_t>(h)];
    if (count == 0) continue;
    std::array<char, 40> share{};
    std::snprintf(share.data(), share.size(), " %.2f %%",
                  100 * static_cast<double>(count) / static_cast<double>(all));
    out += (out.empty() ? "" : ", ") + std::string(to_string(h)) + share.data();
  }
  return out;
}

}  // namespace evpose
