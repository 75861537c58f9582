// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/core/version.h"

namespace evpose {

const char* version() { return EVPOSE_VERSION; }

}  // namespace evpose
