// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evpose/registration/temporal_field_registration.h"

namespace evpose {

/// The minimum of `minimise` by Ceres: its reference in tests.
FieldSolution minimise_with_ceres(const FieldProblem& problem, const TemporalFieldConfig& config);

}  // namespace evpose
