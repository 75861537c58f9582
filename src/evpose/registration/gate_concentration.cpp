// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/registration/gate_concentration.h"

#include <algorithm>
#include <cmath>

namespace evpose {
namespace {

constexpr double kMemory_s = 0.05;        // of the sums, while many events come
constexpr double kLongestMemory_s = 1;    // of the sums, while few events come
constexpr double kEnoughWeight = 50;      // of events, from which on the concentration is believed
constexpr double kLeast = 0.15;           // keeps finite what is divided by it
constexpr double kConsistent = 0.3;       // of events that are of the contours
constexpr double kFullInformation = 0.5;  // from which on events tell what they are said to

}  // namespace

void GateConcentration::decay(double span_s) {
  sums_ *= std::clamp(2 * kEnoughWeight / std::max(sums_.weight, 1e-9), std::exp(-span_s / kMemory_s),
                      std::exp(-span_s / kLongestMemory_s));
}

bool GateConcentration::known() const { return sums_.weight >= kEnoughWeight; }

double GateConcentration::value() const {
  return sums_.weight > 0 ? std::clamp(sums_.slope(), kLeast, 1.0) : 1;
}

bool GateConcentration::consistent() const { return !known() || value() >= kConsistent; }

double GateConcentration::share_of_information() const {
  return std::pow(std::min(1.0, value() / kFullInformation), 2);
}

}  // namespace evpose
