// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace evpose {

double wall_s();          ///< on a monotone clock
double cpu_s();           ///< processor time of the program
double peak_memory_mb();  ///< of the program

}  // namespace evpose
