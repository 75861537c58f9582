// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/mavlink/link_check.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "evpose/core/error.h"
#include "evpose/core/pose.h"

namespace evpose::mavlink {
namespace {

constexpr std::size_t kStreams = 256, kSaid = 50, kDelays = 1'000'000;
constexpr TimeNs kOtherClock = 10 * kNsPerS;  // a stamp so far off is on another clock

std::string fixed(double value, int digits) {
  char buffer[64];
  std::snprintf(buffer, sizeof buffer, "%.*f", digits, value);
  return buffer;
}

std::uint16_t sender_of(const Frame& frame) {
  return static_cast<std::uint16_t>(frame.system << 8 | frame.component);
}

Matrix6d matrix_of(const Covariance21& c) {
  Matrix6d out;
  std::size_t at = 0;
  for (int i = 0; i < 6; ++i)
    for (int j = i; j < 6; ++j) out(i, j) = out(j, i) = c[at++];
  return out;
}

/// The value below which a share of the values lies.
float quantile(std::vector<float> values, double share) {
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

const char* frame_name(std::uint8_t frame) {
  switch (frame) {
    case 1:
      return "LOCAL_NED";
    case 4:
      return "LOCAL_ENU";
    case 8:
      return "BODY_NED";
    case 12:
      return "BODY_FRD";
    case 20:
      return "LOCAL_FRD";
    case 21:
      return "LOCAL_FLU";
    default:
      return "a withdrawn or unknown frame";
  }
}

}  // namespace

void LinkCheck::fault(const std::string& what) { ++faults_[what]; }

void LinkCheck::say(std::string words) {
  if (!said_.empty() && said_.back() == words) return;
  if (said_.size() < kSaid) said_.push_back(std::move(words));
}

void LinkCheck::receive(Bytes bytes, TimeNs now_ns) {
  parser_.parse(bytes, [&](const Frame& frame) { handle(frame, now_ns); });
}

void LinkCheck::handle(const Frame& frame, TimeNs now_ns) {
  const std::uint16_t from = sender_of(frame);
  if (senders_.size() < kStreams || senders_.count(from) > 0) {
    Sender& sender = senders_[from];
    if (sender.frames++ > 0) sender.missed += static_cast<std::uint8_t>(frame.sequence - sender.sequence - 1);
    sender.sequence = frame.sequence;
  }
  if (streams_.size() < kStreams || streams_.count({frame.id, from}) > 0) {
    Stream& stream = streams_[{frame.id, from}];
    if (stream.frames++ == 0)
      stream.first = now_ns;
    else
      stream.longest_gap = std::max(stream.longest_gap, now_ns - stream.last);
    stream.last = now_ns;
  }
  if (const auto odometry = decode<Odometry>(frame)) take(*odometry, now_ns);
  if (const auto m = decode<Statustext>(frame)) {
    std::string words(m->text.data(), std::find(m->text.begin(), m->text.end(), '\0') - m->text.begin());
    for (char& c : words)
      if (c < ' ' || c > '~') c = '?';
    say(text("system ", int{frame.system}, ".", int{frame.component}, " says: ", words));
  }
  if (const auto m = decode<EkfStatusReport>(frame))
    say(text("EKF_STATUS_REPORT: flags ", m->flags,
             (m->flags & 16)  ? ", absolute horizontal position"
             : (m->flags & 8) ? ", relative horizontal position"
                              : ", no horizontal position",
             (m->flags & 1024) ? ", uninitialised" : ""));
  if (const auto m = decode<EstimatorStatus>(frame)) say(text("ESTIMATOR_STATUS: flags ", m->flags));
  if (decode<GpsGlobalOrigin>(frame)) say("GPS_GLOBAL_ORIGIN: the origin is set");
}

void LinkCheck::take(const Odometry& m, TimeNs now_ns) {
  frame_id_ = m.frame_id, child_frame_id_ = m.child_frame_id;
  if (odometry_++ > 0) {
    if (m.reset_counter != reset_counter_) ++resets_;
    if (m.time_usec < last_time_usec_) fault("time_usec goes back");
  }
  reset_counter_ = m.reset_counter;
  last_time_usec_ = m.time_usec;
  const TimeNs delay =
      now_ns - static_cast<TimeNs>(std::min<std::uint64_t>(m.time_usec, INT64_MAX / 1000)) * kNsPerUs;
  if (std::abs(delay) < kOtherClock && delays_ms_.size() < kDelays)
    delays_ms_.push_back(static_cast<float>(1e3 * to_seconds(delay)));
  if (m.quality < 0) {
    ++failed_;
    return;
  }
  const auto finite = [](auto... v) { return (std::isfinite(v) && ...); };
  if (!finite(m.x, m.y, m.z, m.q[0], m.q[1], m.q[2], m.q[3])) fault("a pose of valid quality is not finite");
  const float norm = m.q[0] * m.q[0] + m.q[1] * m.q[1] + m.q[2] * m.q[2] + m.q[3] * m.q[3];
  if (!(std::abs(norm - 1) < 1e-3f)) fault("the quaternion is not of unit length");
  if (m.frame_id >= 14 && m.frame_id <= 19) fault("frame_id is withdrawn; use 20 (LOCAL_FRD)");
  if (std::isnan(m.pose_covariance[0])) return;
  const Matrix6d covariance = matrix_of(m.pose_covariance);
  if (!covariance.allFinite() || !(covariance.llt().info() == Eigen::Success))
    fault("pose_covariance is not positive definite");
  else
    largest_sigma_m_ =
        std::max(largest_sigma_m_, static_cast<float>(std::sqrt(covariance.diagonal().head<3>().maxCoeff())));
}

LinkCheck::Report LinkCheck::report() const {
  Report out;
  const auto& counts = parser_.counts();
  out.lines.push_back(text(counts.frames, " frames in ", counts.bytes, " bytes; ", counts.bad_checksum,
                           " with a wrong checksum, ", counts.unknown, " of unknown kind, ",
                           counts.skipped_bytes, " bytes between frames"));
  for (const auto& [id, sender] : senders_)
    out.lines.push_back(text("system ", id >> 8, " component ", id & 255, ": ", sender.frames, " frames, ",
                             sender.missed, " missed by sequence number"));
  for (const auto& [key, stream] : streams_) {
    const double seconds = to_seconds(stream.last - stream.first);
    const double rate = seconds > 0 ? static_cast<double>(stream.frames - 1) / seconds : 0;
    out.lines.push_back(text("  ", find_type(key.first)->name, " (", key.first, ") from ", key.second >> 8,
                             ".", key.second & 255, ": ", fixed(rate, 1), " Hz, longest gap ",
                             fixed(1e3 * to_seconds(stream.longest_gap), 1), " ms"));
  }
  if (odometry_ > 0) {
    out.lines.push_back(text("ODOMETRY: ", frame_name(frame_id_), " / ", frame_name(child_frame_id_), ", ",
                             resets_, " resets, ", failed_, " of quality -1, largest sigma ",
                             fixed(1e3 * largest_sigma_m_, 1), " mm"));
    if (!delays_ms_.empty())
      out.lines.push_back(text("delay from measurement to here: p50 ", fixed(quantile(delays_ms_, 0.5), 2),
                               " ms, p99 ", fixed(quantile(delays_ms_, 0.99), 2), " ms, largest ",
                               fixed(quantile(delays_ms_, 1), 2), " ms of ", delays_ms_.size()));
    else
      out.lines.push_back("delay: not known, the stamps are on another machine's clock");
  }
  for (const auto& words : said_) out.lines.push_back(words);
  for (const auto& [what, count] : faults_) out.faults.push_back(text(what, " (", count, " times)"));
  if (counts.frames == 0) out.faults.emplace_back("no frame arrived");
  return out;
}

}  // namespace evpose::mavlink
