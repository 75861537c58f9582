// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/io/recording/recording.h"
#include "evpose/serve/stream_queue.h"

namespace evpose {

class ConfigTable;

struct ReplayConfig {
  double speed = 1;            ///< of the data's time against the wall clock; 0: as fast as it is taken
  double packet_ms = 0.5;      ///< events are handed on in packets of this length, at its end
  bool loop = false;           ///< start again at the end, for ever
  double add_noise_mev_s = 0;  ///< events at random pixels, million a second of data time: a test of load
};
void describe(ConfigTable& table, ReplayConfig& config);

/// Adds events uniformly over the image and over the time from the packet's base to `until`, merged by time.
/// Cheap, so that the load is the tracker's and not the generator's: one step of a 64-bit generator (Vigna's
/// splitmix64) an event. `state`: of the generator.
void add_random_events(EventPacket& packet, ImageSize size, TimeNs until, double per_s, std::uint64_t& state);

/// A recording as if it happened now: every packet and IMU sample comes when it would come from a camera.
class ReplaySource : public Source {
 public:
  ReplaySource(const Recording& recording, const ReplayConfig& config)
      : recording_(recording), config_(config) {}
  void run(StreamQueue& queue) override;

 private:
  Status run_once(StreamQueue& queue);

  const Recording& recording_;
  ReplayConfig config_;
};

}  // namespace evpose
