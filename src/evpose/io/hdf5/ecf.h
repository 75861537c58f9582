// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace evpose {

/// An event as Metavision's HDF5 files hold it, in memory and before compression.
struct EcfEvent {
  std::uint16_t x = 0, y = 0;
  std::int16_t p = 0;
  std::int64_t t_us = 0;
};
static_assert(sizeof(EcfEvent) == 16 && offsetof(EcfEvent, t_us) == 8, "the layout of the file's rows");

/// Undoes Metavision's own compression (HDF5 filter 0x8ECF) of one block of at most 65,535 events. False when
/// it is damaged.
bool decode_ecf(std::span<const std::byte> block, std::vector<EcfEvent>& events);

}  // namespace evpose
