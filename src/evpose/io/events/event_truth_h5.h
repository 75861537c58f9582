// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "evpose/core/error.h"

namespace evpose {

/// What a simulator knows about an event.
struct EventTruth {
  std::uint8_t cause = 0;    ///< 0 signal, 1 leak, 2 shot noise, 3 hot pixel
  std::uint8_t origin = 0;   ///< 0 texture, 1 edge of what stands still, 2 moving thing
  std::uint16_t object = 0;  ///< row of /objects
};

/// events_truth.h5: /truth/cause, /truth/origin (u8), /truth/object (u16), a row for each row of events.h5;
/// root attribute `objects`: names.
class EventTruthWriter {
 public:
  static Expected<EventTruthWriter> create(const std::string& path, const std::vector<std::string>& objects);
  EventTruthWriter(EventTruthWriter&& other) noexcept;
  EventTruthWriter& operator=(EventTruthWriter&& other) noexcept;
  ~EventTruthWriter();

  Status append(const EventTruth& truth);
  Status finish();

 private:
  struct Impl;
  explicit EventTruthWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace evpose
