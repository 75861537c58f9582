// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/piece_ekf.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace evpose {

PieceEkf::PieceEkf(const StatePropagator& propagator, const SlowErrorsConfig& config)
    : BackEnd(propagator), config_(config) {}

void PieceEkf::start(const FusionState& first) {
  state_ = first;
  pieces_.clear();
  cross_.resize(15, 0);
  spread_.resize(0, 0);
  pieces_share_.setZero();
}

void PieceEkf::predict(const ImuSample& a, const ImuSample& b, ImuTrust trust) {
  Matrix15d F;
  propagator().propagate(state_, a, b, trust, &F);
  cross_ = (F * cross_).eval();
}

void PieceEkf::predict(TimeNs t) {
  Matrix15d F;
  propagator().propagate(state_, t, &F);
  cross_ = (F * cross_).eval();
}

double PieceEkf::sigma_m(std::size_t piece) const {
  const auto i = static_cast<Eigen::Index>(piece);
  return std::sqrt(std::max(0.0, spread_(i, i)));
}

int PieceEkf::place_of(const ContourOffset& contour, const Eigen::Vector3d& across_map) {
  const auto known = std::find_if(pieces_.begin(), pieces_.end(),
                                  [&](const Piece& piece) { return piece.number == contour.piece; });
  if (known != pieces_.end()) {
    known->seen = state_.t;
    return static_cast<int>(known - pieces_.begin());
  }
  auto place = static_cast<Eigen::Index>(pieces_.size());
  if (place < config_.most_pieces) {
    pieces_.emplace_back();
    cross_.conservativeResize(Eigen::NoChange, place + 1);
    spread_.conservativeResize(place + 1, place + 1);
  } else {
    const auto oldest = std::min_element(pieces_.begin(), pieces_.end(),
                                         [](const Piece& a, const Piece& b) { return a.seen < b.seen; });
    constexpr double kGone_s = 0.2;
    if (oldest == pieces_.end() || to_seconds(state_.t - oldest->seen) < kGone_s) return -1;
    place = oldest - pieces_.begin();
  }
  pieces_[static_cast<std::size_t>(place)] = {contour.piece, across_map, 0, state_.t};
  cross_.col(place).setZero();
  spread_.row(place).setZero();
  spread_.col(place).setZero();
  spread_(place, place) = config_.piece_sigma_m * config_.piece_sigma_m + contour.sigma_m * contour.sigma_m;
  return static_cast<int>(place);
}

void PieceEkf::update(const PoseInformation& measurement, std::span<const ContourOffset> contours) {
  const Eigen::Matrix3d R = state_.nav.T_map_body.rotation();
  struct Part {  // of one piece
    Vector6d mixed = Vector6d::Zero();
    double own = 0, vector = 0;
  };
  std::vector<Part> parts;
  Vector6d pose_vector = measurement.vector;
  for (const ContourOffset& contour : contours) {
    const Eigen::Vector3d across = R * contour.across_body;
    const double length = across.norm();
    const int place = length > 0 ? place_of(contour, across / length) : -1;
    if (place < 0) continue;
    parts.resize(pieces_.size());
    Vector6d J;
    J << across, contour.point_body.cross(contour.across_body);
    // The contour asks for J d - c offset: its point moves against the pose and with the piece.
    const Piece& piece = pieces_[static_cast<std::size_t>(place)];
    const double c = across.dot(piece.across_map);
    Part& part = parts[static_cast<std::size_t>(place)];
    part.mixed -= contour.weight * c * J;
    part.own += contour.weight * c * c;
    part.vector -= contour.weight * c * (contour.offset_px + c * piece.offset_m);
    pose_vector += contour.weight * c * piece.offset_m * J;
  }
  std::vector<int> seen;
  for (std::size_t i = 0; i < parts.size(); ++i)
    if (parts[i].own > 0) seen.push_back(static_cast<int>(i));

  // As correct(), with the offsets of the pieces seen beside the pose.
  const auto measured = static_cast<Eigen::Index>(6 + seen.size());
  const auto pieces = static_cast<Eigen::Index>(pieces_.size());
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(measured, measured), P_m(15 + pieces, measured);
  Eigen::VectorXd b(measured);
  H.topLeftCorner<6, 6>() = measurement.information;
  b.head<6>() = pose_vector;
  P_m.topLeftCorner(15, 6) = state_.covariance.leftCols<6>();
  P_m.bottomLeftCorner(pieces, 6) = cross_.topRows<6>().transpose();
  for (Eigen::Index k = 6; k < measured; ++k) {
    const int place = seen[static_cast<std::size_t>(k - 6)];
    const Part& part = parts[static_cast<std::size_t>(place)];
    H.block<6, 1>(0, k) = part.mixed;
    H.block<1, 6>(k, 0) = part.mixed.transpose();
    H(k, k) = part.own;
    b(k) = part.vector;
    P_m.block(0, k, 15, 1) = cross_.col(place);
    P_m.block(15, k, pieces, 1) = spread_.col(place);
  }
  Eigen::MatrixXd P_mm(measured, measured);
  P_mm.topRows<6>() = P_m.topRows<6>();
  for (Eigen::Index k = 6; k < measured; ++k)
    P_mm.row(k) = P_m.row(15 + seen[static_cast<std::size_t>(k - 6)]);
  const Eigen::PartialPivLU<Eigen::MatrixXd> lu(Eigen::MatrixXd::Identity(measured, measured) + H * P_mm);
  const Eigen::VectorXd dx = P_m * lu.solve(b);
  const Eigen::MatrixXd gained = lu.solve(H) * P_m.transpose();
  state_.covariance -= P_m.topRows<15>() * gained.leftCols(15);
  cross_ -= P_m.topRows<15>() * gained.rightCols(pieces);
  spread_ -= P_m.bottomRows(pieces) * gained.rightCols(pieces);
  spread_ = (0.5 * (spread_ + spread_.transpose())).eval();

  state_.add(dx.head<15>());
  for (Eigen::Index i = 0; i < pieces; ++i) pieces_[static_cast<std::size_t>(i)].offset_m += dx(15 + i);
  // The attitude error now refers to the corrected body axes.
  Matrix15d turned = Matrix15d::Identity();
  turned.block<3, 3>(error_state::kPhi, error_state::kPhi) =
      so3::right_jacobian(dx.segment<3>(error_state::kPhi));
  state_.covariance = (turned * state_.covariance * turned.transpose()).eval();
  state_.covariance = (0.5 * (state_.covariance + state_.covariance.transpose())).eval();
  cross_ = (turned * cross_).eval();

  // How the offsets, as they are known now, would shift a pose that this measurement alone told.
  pieces_share_.setZero();
  if (seen.empty()) return;
  const Matrix6d damped =
      measurement.information + 1e-9 * measurement.information.trace() * Matrix6d::Identity();
  const Eigen::MatrixXd by_offsets = damped.ldlt().solve(H.topRightCorner(6, measured - 6));
  Eigen::MatrixXd spread(measured - 6, measured - 6);
  for (Eigen::Index i = 0; i < spread.rows(); ++i)
    for (Eigen::Index k = 0; k < spread.cols(); ++k)
      spread(i, k) = spread_(seen[static_cast<std::size_t>(i)], seen[static_cast<std::size_t>(k)]);
  pieces_share_ = by_offsets * spread * by_offsets.transpose();
}

}  // namespace evpose
