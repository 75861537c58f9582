// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/start_looks.h"

#include <cstdio>

#include "evpose/bench/experiments/streams.h"

namespace evpose::experiments {

std::string StartLooks::header() {
  return "recording,start,seed,t_s,health,error_mm,error_mrad,sigmas,probability,pieces,explained,"
         "ratio,worst_ratio,gate_concentration,accepted\n";
}

void StartLooks::add(const Update& u) {
  if (u.points == 0 || u.look.pieces == 0) return;
  const Vector6d e = u.T_map_body.minus(true_pose(*truth_, u.t));
  const double sigmas = (e.array().abs() / u.covariance.diagonal().array().sqrt()).maxCoeff();
  constexpr double kMilli = 1e3;
  char row[200];
  std::snprintf(row, sizeof row, ",%.4f,%s,%.2f,%.2f,%.2f,%.6f,%.0f,%.4f,%.3f,%.3f,%.3f,%d\n",
                to_seconds(u.t - begin_), to_string(u.health), kMilli * e.head<3>().norm(),
                kMilli * e.tail<3>().norm(), sigmas, u.probability, u.look.pieces, u.look.explained,
                u.look.ratio, u.look.worst_ratio, u.gate_concentration, u.accepted ? 1 : 0);
  rows_ += text('"', start_.recording, "\",\"", start_.kind, "\",", start_.seed, row);
}

}  // namespace evpose::experiments
