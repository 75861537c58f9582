// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/recording/turn_of_events.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "evpose/io/motion/imu_axes.h"

namespace evpose {
namespace {

constexpr double kLookedAt_s = 60;
constexpr std::size_t kStretches = 12, kLeastStretches = 3;
constexpr double kApart_s = 0.1;
constexpr double kTurned_px = 6;  // in the middle of the image, over a stretch
constexpr double kLongest_s = 0.03, kShortest_s = 0.002;
constexpr std::size_t kEvents = 40'000, kLeastEvents = 2'000;  // of a stretch; more are thinned
constexpr int kCell_px = 8;                                    // in which the flow is taken as constant
constexpr double kSharper = 0.7;  // blur with the best axes, of that with those that were read, or none

struct Stretch {
  TimeNs begin = 0, end = 0;
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();  ///< mean of the gyroscope, rad/s
  std::vector<std::pair<TimeNs, Event>> events;
};

/// Where the camera turns fastest, each long enough for some pixels, in order of time.
std::vector<Stretch> fast_stretches(const std::vector<ImuSample>& samples, double focal_px) {
  std::vector<Stretch> all;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (to_seconds(samples[i].t - samples.front().t) > kLookedAt_s) break;
    const double rate = samples[i].gyro.norm();
    if (!(rate > 0)) continue;
    const double span_s = kTurned_px / (rate * focal_px);
    if (span_s > kLongest_s) continue;
    Stretch s;
    s.begin = samples[i].t;
    s.end = s.begin + from_seconds(std::max(kShortest_s, span_s));
    int count = 0;
    for (std::size_t k = i; k < samples.size() && samples[k].t <= s.end; ++k, ++count)
      s.rate += samples[k].gyro;
    s.rate /= count;
    if (s.rate.norm() > 0.7 * rate) all.push_back(s);
  }
  std::ranges::stable_sort(all, std::greater(), [](const Stretch& s) { return s.rate.norm(); });
  std::vector<Stretch> out;
  for (const Stretch& s : all) {
    const auto near = [&](const Stretch& kept) {
      return std::abs(to_seconds(s.begin - kept.begin)) < kApart_s;
    };
    if (out.size() < kStretches && std::ranges::none_of(out, near)) out.push_back(s);
  }
  std::ranges::sort(out, {}, &Stretch::begin);
  return out;
}

Status read_stretches(EventReader& reader, std::vector<Stretch>* stretches) {
  EventPacket packet;
  std::size_t first = 0;
  while (first < stretches->size()) {  // none: nothing is read
    const auto more = reader.next(packet);
    if (!more) return more.error();
    if (!*more) break;
    for (const Event& e : packet.events) {
      const TimeNs t = packet.time(e);
      while (first < stretches->size() && (*stretches)[first].end < t) ++first;
      if (first == stretches->size()) break;
      if (t >= (*stretches)[first].begin) (*stretches)[first].events.emplace_back(t, e);
    }
  }
  for (Stretch& s : *stretches) {
    const std::size_t step = s.events.size() / kEvents + 1;
    for (std::size_t i = 0; i * step < s.events.size(); ++i) s.events[i] = s.events[i * step];
    s.events.resize((s.events.size() + step - 1) / step);
  }
  std::erase_if(*stretches, [](const Stretch& s) { return s.events.size() < kLeastEvents; });
  return {};
}

/// How fast pixels move by a rate of the body: rows of 2x3, by cell.
class Flow {
 public:
  Flow(const Camera& camera, const Eigen::Matrix3d& R_cam_body) : size_(camera.size()) {
    columns_ = (size_.width + kCell_px - 1) / kCell_px;
    const int rows = (size_.height + kCell_px - 1) / kCell_px;
    for (int row = 0; row < rows; ++row)
      for (int column = 0; column < columns_; ++column) {
        Eigen::Matrix<double, 2, 3> by_rate = Eigen::Matrix<double, 2, 3>::Zero();
        const auto ray = camera.unproject({(column + 0.5) * kCell_px, (row + 0.5) * kCell_px});
        Matrix23d J;
        if (ray && camera.project(*ray, &J)) by_rate = J * so3::hat(*ray) * R_cam_body;
        by_rate_.push_back(by_rate);
      }
  }

  /// One over the mean number of events that each has for company at its pixel, when all are turned back to
  /// the middle of the stretch: small for a sharp picture.
  double blur(const Stretch& s, const Eigen::Vector3d& rate) const {
    std::vector<Eigen::Vector2d> flow(by_rate_.size());
    for (std::size_t i = 0; i < flow.size(); ++i) flow[i] = by_rate_[i] * rate;
    std::vector<std::uint16_t> counts(static_cast<std::size_t>(size_.width) *
                                      static_cast<std::size_t>(size_.height));
    const TimeNs middle = s.begin + (s.end - s.begin) / 2;
    double pairs = 0, inside = 0;
    for (const auto& [t, e] : s.events) {
      const double later_s = to_seconds(middle - t);
      const Eigen::Vector2d& f = flow[static_cast<std::size_t>(e.y / kCell_px * columns_ + e.x / kCell_px)];
      const auto x = static_cast<int>(std::lround(e.x + f.x() * later_s)),
                 y = static_cast<int>(std::lround(e.y + f.y() * later_s));
      if (x < 0 || y < 0 || x >= size_.width || y >= size_.height) continue;
      std::uint16_t& n = counts[static_cast<std::size_t>(y) * static_cast<std::size_t>(size_.width) +
                                static_cast<std::size_t>(x)];
      pairs += 2 * n;
      n = static_cast<std::uint16_t>(n + 1);
      ++inside;
    }
    return inside / (pairs + 1);
  }

 private:
  ImageSize size_;
  int columns_ = 0;
  std::vector<Eigen::Matrix<double, 2, 3>> by_rate_;
};

}  // namespace

Expected<std::optional<Error>> doubt_gyro_by_events(EventReader& events, const Camera& camera,
                                                    const Eigen::Matrix3d& R_cam_imu,
                                                    const std::vector<ImuSample>& samples,
                                                    const std::string& where) {
  std::vector<Stretch> stretches = fast_stretches(samples, camera.focal_px());
  if (auto ok = read_stretches(events, &stretches); !ok) return ok.error();
  if (stretches.size() < kLeastStretches) return std::optional<Error>();
  const Flow flow(camera, R_cam_imu);
  const auto mean_blur = [&](const Eigen::Matrix3d& of_rate) {
    double sum = 0;
    for (const Stretch& s : stretches) sum += flow.blur(s, of_rate * s.rate);
    return sum / static_cast<double>(stretches.size());
  };
  const AxisChoice choice = choose_axes(mean_blur);
  const double still = mean_blur(Eigen::Matrix3d::Zero());
  if (choice.cost > kSharper * std::min(still, choice.as_read)) return std::optional<Error>();
  Error doubt = wrong_axes(where, "gyroscope", "the turn of the events", choice.names);
  doubt.fix += "; or the rotation of T_cam_imu is wrong, or its inverse";
  return std::optional<Error>(std::move(doubt));
}

Expected<std::optional<Error>> doubt_gyro_by_events(const Recording& recording,
                                                    const std::vector<ImuSample>& samples) {
  const auto camera = make_camera(recording.camera);
  if (!camera || samples.empty()) return std::optional<Error>();
  const auto events = open_events(recording);
  if (!events) return events.error();
  return doubt_gyro_by_events(**events, **camera, recording.T_cam_body.q.toRotationMatrix(), samples,
                              recording.imu_path);
}

}  // namespace evpose
