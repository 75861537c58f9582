// SPDX-License-Identifier: BSD-3-Clause
// As much of the Metavision SDK 5 as evpose asks of it, by the names of its documentation.
#pragma once

#include <cstdint>

namespace Metavision {

using timestamp = std::int64_t;

struct EventCD {
  unsigned short x, y;
  short p;
  timestamp t;
};

}  // namespace Metavision
