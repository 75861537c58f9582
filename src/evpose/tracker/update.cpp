// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/update.h"

namespace evpose {

const char* to_string(Health health) {
  switch (health) {
    case Health::waiting:
      return "waiting";
    case Health::initialising:
      return "initialising";
    case Health::tracking:
      return "tracking";
    case Health::degraded:
      return "degraded";
    case Health::ambiguous:
      return "ambiguous";
    case Health::lost:
      return "lost";
  }
  return "unknown";
}

}  // namespace evpose
