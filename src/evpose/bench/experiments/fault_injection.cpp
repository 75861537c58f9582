// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/fault_injection.h"

#include <algorithm>
#include <cmath>

namespace evpose::experiments {
namespace {

constexpr double kNarrowRange_rad_s = 0.05, kNarrowRange_m_s2 = 4;  // which these flights exceed
constexpr double kSaturated_rad_s = 34.9, kSaturated_m_s2 = 156.9;  // what a sensor then says
constexpr double kSpike_rad_s = 5, kSpike_m_s2 = 50;
constexpr unsigned kSpikeEvery = 10;  // samples, on the mean
constexpr unsigned kPacketsLost = 7, kPacketsOf = 10;
constexpr std::size_t kBurstFactor = 5, kBurstLeast = 5000;  // events added to a packet
constexpr int kStuckRowsApart = 4;                           // parts of the image's height

/// Axis 0 to 2: gyroscope; 3 to 5: accelerometer.
double& value_of(ImuSample& s, int axis) { return axis < 3 ? s.gyro[axis] : s.accel[axis - 3]; }

void saturate(ImuSample& s) {
  for (int axis = 0; axis < 6; ++axis) {
    const double range = axis < 3 ? kNarrowRange_rad_s : kNarrowRange_m_s2;
    double& v = value_of(s, axis);
    if (std::abs(v) > range) v = std::copysign(axis < 3 ? kSaturated_rad_s : kSaturated_m_s2, v);
  }
}

std::uint32_t any_time_us(const EventPacket& packet, std::mt19937& random) {
  return packet.events[random() % packet.events.size()].dt_us;
}

std::vector<Event> burst(const EventPacket& packet, ImageSize size, std::mt19937& random) {
  std::vector<Event> out;
  const std::size_t count = kBurstFactor * packet.events.size() + kBurstLeast;
  for (std::size_t i = 0; i < count; ++i) {
    const bool on = random() % 2 == 0;
    const int y = static_cast<int>(random() % static_cast<unsigned>(size.height));
    const int x = static_cast<int>(random() % static_cast<unsigned>(size.width));
    out.push_back(make_event(any_time_us(packet, random), x, y, on));
  }
  return out;
}

std::vector<Event> stuck_rows(const EventPacket& packet, ImageSize size, std::mt19937& random) {
  std::vector<Event> out;
  const int apart = size.height / kStuckRowsApart;
  for (int row = apart; row < size.height; row += apart)
    for (int x = 0; x < size.width; ++x) {
      const bool on = random() % 2 == 0;
      out.push_back(make_event(any_time_us(packet, random), x, row, on));
    }
  return out;
}

}  // namespace

double uniform_between(std::mt19937& random, double low, double high) {
  return low + (high - low) * (static_cast<double>(random()) + 0.5) / 4294967296.0;
}

void inject_imu_fault(const FaultWindow& window, std::mt19937& random, std::vector<ImuSample>* imu) {
  const Fault fault = window.fault;
  const int axis = static_cast<int>(random() % 6);
  const TimeNs jump = from_seconds(uniform_between(random, 0.03, 0.2));
  double held = 0;
  bool holding = false;
  std::vector<ImuSample> out;
  for (ImuSample s : *imu) {
    const bool inside = s.t >= window.from && s.t < window.to;
    if (fault == Fault::imu_gap && inside) continue;
    if (fault == Fault::imu_saturated && inside) saturate(s);
    if (fault == Fault::imu_stuck && inside) {
      if (!holding) held = value_of(s, axis), holding = true;
      value_of(s, axis) = held;
    }
    if (fault == Fault::imu_not_a_number && inside) value_of(s, axis) = std::nan("");
    if (fault == Fault::imu_spike && inside && random() % kSpikeEvery == 0)
      value_of(s, axis) += (axis < 3 ? kSpike_rad_s : kSpike_m_s2) * (random() % 2 == 0 ? 1 : -1);
    if (fault == Fault::imu_jump_ahead && s.t >= window.from) s.t += jump;
    if (fault == Fault::imu_jump_back && s.t >= window.from) s.t -= jump;
    out.push_back(s);
  }
  *imu = std::move(out);
}

void inject_event_fault(const FaultWindow& window, ImageSize size, std::mt19937& random,
                        std::vector<EventPacket>* packets) {
  for (EventPacket& packet : *packets) {
    if (packet.empty()) continue;
    const TimeNs begin = packet.time(packet.events.front());
    if (begin < window.from || begin >= window.to) continue;
    if (window.fault == Fault::events_drop_out) packet.events.clear();
    if (window.fault == Fault::events_packet_loss && random() % kPacketsOf < kPacketsLost)
      packet.events.clear();
    if (packet.empty()) continue;
    std::vector<Event> extra;
    if (window.fault == Fault::events_burst) extra = burst(packet, size, random);
    if (window.fault == Fault::events_stuck_rows) extra = stuck_rows(packet, size, random);
    packet.events.insert(packet.events.end(), extra.begin(), extra.end());
    std::stable_sort(packet.events.begin(), packet.events.end(),
                     [](const Event& a, const Event& b) { return a.dt_us < b.dt_us; });
  }
}

}  // namespace evpose::experiments
