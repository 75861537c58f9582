// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace evpose {

/// "MAJOR.MINOR.PATCH" of the library.
const char* version();

}  // namespace evpose
