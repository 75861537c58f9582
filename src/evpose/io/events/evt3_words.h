// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace evpose {

/// Kinds of EVT3's 16-bit words, as their upper four bits have them.
struct Evt3Word {
  enum Kind : unsigned {
    kAddressY = 0x0,
    kAddressX = 0x2,
    kVectorBase = 0x3,
    kVector12 = 0x4,
    kVector8 = 0x5,
    kTimeLow = 0x6,
    kContinued4 = 0x7,
    kTimeHigh = 0x8,
    kTrigger = 0xA,
    kOthers = 0xE,
    kContinued12 = 0xF,
  };
};

}  // namespace evpose
