// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "evpose/fusion/back_end.h"

namespace evpose {

/// Error-state Kalman filter whose further states are the offsets of single contour pieces: a piece stands
/// elsewhere than the map says, or texture that moves with it is taken for it. An offset is one length, along
/// the direction in the map across which the piece was seen first; with a view from elsewhere it counts by
/// the cosine. Offsets do not change while a piece is in view; when there are more pieces than states, the
/// one not seen for longest gives way, and what finds no state counts without an offset.
class PieceEkf : public BackEnd {
 public:
  PieceEkf(const StatePropagator& propagator, const SlowErrorsConfig& config);

  using BackEnd::start;
  using BackEnd::update;
  /// Forgets the pieces.
  void start(const FusionState& first) override;
  void predict(const ImuSample& a, const ImuSample& b, ImuTrust trust) override;
  void predict(TimeNs t) override;
  void update(const PoseInformation& measurement, std::span<const ContourOffset> contours) override;
  bool takes_contours() const override { return true; }
  const FusionState& state() const override { return state_; }
  /// With the pieces' share, as the last measurement weighed them.
  Matrix6d measured_covariance() const override { return state_.pose_covariance() + pieces_share_; }

  struct Piece {
    std::uint32_t number = 0;
    Eigen::Vector3d across_map;  ///< unit
    double offset_m = 0;
    TimeNs seen = 0;
  };
  const std::vector<Piece>& pieces() const { return pieces_; }
  double sigma_m(std::size_t piece) const;

 private:
  /// The piece's place among the states; -1: there is none.
  int place_of(const ContourOffset& contour, const Eigen::Vector3d& across_map);

  SlowErrorsConfig config_;
  FusionState state_;
  std::vector<Piece> pieces_;
  Eigen::MatrixXd cross_;   ///< covariance of the state (15) with the pieces' offsets
  Eigen::MatrixXd spread_;  ///< covariance of the offsets
  Matrix6d pieces_share_ = Matrix6d::Zero();
};

}  // namespace evpose
