// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/fusion/error_state_filter.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>

#include "evpose/core/error.h"

namespace evpose {
namespace {

void symmetrise(Matrix15d& m) { m = (0.5 * (m + m.transpose())).eval(); }

}  // namespace

const ErrorStateFilter::Slot& ErrorStateFilter::slot(BlockId id) const {
  const Slot& found = slots_[static_cast<std::size_t>(id)];
  EVPOSE_CHECK(found.size > 0);
  return found;
}

void ErrorStateFilter::reset_state(const FusionState& state) {
  state_ = state;
  cross_.setZero();
  by_shared_.resize(15, 0);
  blocks_by_shared_.resize(block_states(), 0);
}

void ErrorStateFilter::follow_shared_errors(int count) {
  by_shared_.setZero(15, count);
  blocks_by_shared_.setZero(block_states(), count);
}

BlockId ErrorStateFilter::add_block(const Eigen::VectorXd& sigma) {
  EVPOSE_CHECK(sigma.size() > 0);
  const auto free = std::find_if(slots_.begin(), slots_.end(), [](const Slot& s) { return s.size == 0; });
  const auto number = static_cast<std::size_t>(free - slots_.begin());
  if (free == slots_.end()) slots_.emplace_back();
  const auto all = blocks_.rows() + sigma.size();
  slots_[number] = {block_states(), static_cast<int>(sigma.size()), false};
  cross_.conservativeResize(Eigen::NoChange, all);
  blocks_.conservativeResize(all, all);
  blocks_by_shared_.conservativeResize(all, Eigen::NoChange);
  correction_.setZero(all);
  reset_block(static_cast<BlockId>(number), sigma);
  return static_cast<BlockId>(number);
}

void ErrorStateFilter::reset_block(BlockId id, const Eigen::VectorXd& sigma) {
  const Slot& s = slot(id);
  EVPOSE_CHECK(sigma.size() == s.size);
  cross_.middleCols(s.at, s.size).setZero();
  blocks_by_shared_.middleRows(s.at, s.size).setZero();
  blocks_.middleRows(s.at, s.size).setZero();
  blocks_.middleCols(s.at, s.size).setZero();
  blocks_.diagonal().segment(s.at, s.size) = sigma.cwiseAbs2();
}

BlockId ErrorStateFilter::add_copy(int first, int size) {
  const BlockId id = add_block(Eigen::VectorXd::Ones(size));
  const int at = slot(id).at;
  cross_.middleCols(at, size) = state_.covariance.middleCols(first, size);
  const Eigen::MatrixXd rows = cross_.middleRows(first, size);
  blocks_.middleRows(at, size) = rows;
  blocks_.middleCols(at, size) = rows.transpose();
  blocks_by_shared_.middleRows(at, size) = by_shared_.middleRows(first, size);
  return id;
}

void ErrorStateFilter::set_covariance(BlockId a, BlockId b, const Eigen::MatrixXd& covariance) {
  const Slot &first = slot(a), &second = slot(b);
  EVPOSE_CHECK(covariance.rows() == first.size && covariance.cols() == second.size);
  blocks_.block(first.at, second.at, first.size, second.size) = covariance;
  blocks_.block(second.at, first.at, second.size, first.size) = covariance.transpose();
}

void ErrorStateFilter::remove_block(BlockId id) {
  const Slot gone = slot(id);
  const Eigen::Index after = block_states() - gone.at - gone.size, left = block_states() - gone.size;
  cross_.middleCols(gone.at, after) = cross_.rightCols(after).eval();
  blocks_.middleRows(gone.at, after) = blocks_.bottomRows(after).eval();
  blocks_.middleCols(gone.at, after) = blocks_.rightCols(after).eval();
  blocks_by_shared_.middleRows(gone.at, after) = blocks_by_shared_.bottomRows(after).eval();
  cross_.conservativeResize(Eigen::NoChange, left);
  blocks_.conservativeResize(left, left);
  blocks_by_shared_.conservativeResize(left, Eigen::NoChange);
  correction_.setZero(left);
  slots_[static_cast<std::size_t>(id)] = {};
  for (Slot& s : slots_)
    if (s.at > gone.at) s.at -= gone.size;
  list_considered();
}

void ErrorStateFilter::set_considered(BlockId id, bool considered) {
  if (slot(id).considered == considered) return;
  slots_[static_cast<std::size_t>(id)].considered = considered;
  list_considered();
}

void ErrorStateFilter::list_considered() {
  considered_.clear();
  for (const Slot& s : slots_)
    for (int i = 0; s.considered && i < s.size; ++i) considered_.push_back(s.at + i);
}

Eigen::MatrixXd ErrorStateFilter::covariance(BlockId id) const {
  const Slot& s = slot(id);
  return blocks_.block(s.at, s.at, s.size, s.size);
}

Eigen::MatrixXd ErrorStateFilter::joint_covariance() const {
  const Eigen::Index n = block_states();
  Eigen::MatrixXd out(15 + n, 15 + n);
  out << state_.covariance, cross_, cross_.transpose(), blocks_;
  return out;
}

void ErrorStateFilter::propagate(const StatePropagator& propagator, const ImuSample& a, const ImuSample& b,
                                 ImuTrust trust) {
  Matrix15d F;
  propagator.propagate(state_, a, b, trust, &F);
  cross_ = (F * cross_).eval();
  by_shared_ = (F * by_shared_).eval();
}

void ErrorStateFilter::propagate(const StatePropagator& propagator, TimeNs t) {
  Matrix15d F;
  propagator.propagate(state_, t, &F);
  cross_ = (F * cross_).eval();
  by_shared_ = (F * by_shared_).eval();
}

void ErrorStateFilter::add_effect(BlockId id, const ByState& by_block) {
  const Slot& s = slot(id);
  const Matrix15d mixed = cross_.middleCols(s.at, s.size) * by_block.transpose();
  state_.covariance +=
      mixed + mixed.transpose() + by_block * blocks_.block(s.at, s.at, s.size, s.size) * by_block.transpose();
  cross_ += by_block * blocks_.middleRows(s.at, s.size);
  by_shared_ += by_block * blocks_by_shared_.middleRows(s.at, s.size);
}

void ErrorStateFilter::update(const JointMeasurement& measurement) {
  if (measurement.blocks().empty())
    update_measured<6>(measurement);
  else
    update_measured<Eigen::Dynamic>(measurement);
}

/// Kalman update in a form that needs no inverse of the information H, which may be singular. With y the
/// measured errors, P_xy the covariance of the state with them and P_yy their own,
///   dx = P_xy (I + H P_yy)^-1 b,   P' = P - P_xy (I + H P_yy)^-1 H P_xy^T,
/// and the same for the blocks. Sizes known beforehand make the update without measured blocks a fast one.
template <int kMeasured>
void ErrorStateFilter::update_measured(const JointMeasurement& m) {
  using Square = Eigen::Matrix<double, kMeasured, kMeasured>;
  const Eigen::Index measured = m.size(), others = block_states();
  Eigen::Matrix<double, 15, kMeasured> P_xy(15, measured);
  Eigen::Matrix<double, Eigen::Dynamic, kMeasured> P_by(others, measured);
  Square P_yy(measured, measured);
  P_xy.template leftCols<6>() = state_.covariance.leftCols<6>();
  P_by.template leftCols<6>() = cross_.topRows<6>().transpose();
  for (const PoseShift& shift : m.shifts()) {
    const Slot& s = slot(shift.block);
    P_xy.template leftCols<6>() += cross_.middleCols(s.at, s.size) * shift.by_block.transpose();
    P_by.template leftCols<6>() += blocks_.middleCols(s.at, s.size) * shift.by_block.transpose();
  }
  for (const JointMeasurement::Block& block : m.blocks()) {
    const int at = slot(block.id).at;
    P_xy.middleCols(block.at, block.size) = cross_.middleCols(at, block.size);
    P_by.middleCols(block.at, block.size) = blocks_.middleCols(at, block.size);
  }
  P_yy.template topRows<6>() = P_xy.template topRows<6>();
  for (const PoseShift& shift : m.shifts())
    P_yy.template topRows<6>() +=
        shift.by_block * P_by.middleRows(slot(shift.block).at, shift.by_block.cols());
  for (const JointMeasurement::Block& block : m.blocks())
    P_yy.middleRows(block.at, block.size) = P_by.middleRows(slot(block.id).at, block.size);

  const Square H = m.information();
  const Eigen::Matrix<double, kMeasured, 1> b = m.vector();
  const Eigen::PartialPivLU<Square> lu(Square::Identity(measured, measured) + H * P_yy);
  const Eigen::Matrix<double, kMeasured, 1> weighed = lu.solve(b);
  const Square gained = lu.solve(H);
  if (by_shared_.cols() > 0) {
    const Eigen::MatrixXd moved = lu.solve(m.shared_errors() - H * measured_by_shared(m));
    const Eigen::MatrixXd kept = blocks_by_shared_(considered_, Eigen::all);
    by_shared_.noalias() += P_xy * moved;
    blocks_by_shared_.noalias() += P_by * moved;
    blocks_by_shared_(considered_, Eigen::all) = kept;
  }
  const Vector15d dx = P_xy * weighed;
  state_.covariance -= (P_xy * gained * P_xy.transpose()).eval();
  symmetrise(state_.covariance);
  if (others > 0) {
    const Eigen::MatrixXd gained_by = gained * P_by.transpose();
    cross_.noalias() -= P_xy * gained_by;
    correction_.noalias() = P_by * weighed;
    correct_blocks(P_by, gained_by);
  }
  state_.add(dx);
  // The attitude error now refers to the corrected body axes.
  Matrix15d turned = Matrix15d::Identity();
  turned.block<3, 3>(error_state::kPhi, error_state::kPhi) =
      so3::right_jacobian(dx.segment<3>(error_state::kPhi));
  state_.covariance = (turned * state_.covariance * turned.transpose()).eval();
  symmetrise(state_.covariance);
  if (others > 0) cross_ = (turned * cross_).eval();
  by_shared_ = (turned * by_shared_).eval();
}

/// Derivative of the measured errors by the shared ones.
Eigen::MatrixXd ErrorStateFilter::measured_by_shared(const JointMeasurement& m) const {
  Eigen::MatrixXd out(m.size(), by_shared_.cols());
  out.topRows<6>() = by_shared_.topRows<6>();
  for (const PoseShift& shift : m.shifts())
    out.topRows<6>() +=
        shift.by_block * blocks_by_shared_.middleRows(slot(shift.block).at, shift.by_block.cols());
  for (const JointMeasurement::Block& block : m.blocks())
    out.middleRows(block.at, block.size) = blocks_by_shared_.middleRows(slot(block.id).at, block.size);
  return out;
}

/// The blocks' own covariance after an update; a considered block has neither correction nor gain.
void ErrorStateFilter::correct_blocks(const Eigen::Ref<const Eigen::MatrixXd>& P_by,
                                      const Eigen::Ref<const Eigen::MatrixXd>& gained_by) {
  const Eigen::MatrixXd kept = blocks_(considered_, considered_);
  blocks_.triangularView<Eigen::Lower>() -= P_by * gained_by;
  blocks_.triangularView<Eigen::StrictlyUpper>() = blocks_.transpose();
  blocks_(considered_, considered_) = kept;
  for (const int i : considered_) correction_(i) = 0;
}

Matrix6d ErrorStateFilter::seen_pose_covariance(std::span<const PoseShift> shifts) const {
  Matrix6d P = state_.pose_covariance();
  if (shifts.empty()) return P;
  for (const PoseShift& a : shifts) {
    const Slot& at = slot(a.block);
    const Matrix6d mixed = cross_.block(0, at.at, 6, at.size) * a.by_block.transpose();
    P += mixed + mixed.transpose();
    for (const PoseShift& b : shifts) {
      const Slot& other = slot(b.block);
      P += a.by_block * blocks_.block(at.at, other.at, at.size, other.size) * b.by_block.transpose();
    }
  }
  return P;
}

Eigen::MatrixXd ErrorStateFilter::seen_covariance(std::span<const PoseShift> shifts,
                                                  const BlockId* block) const {
  const int n = block == nullptr ? 0 : slot(*block).size, all = 15 + block_states();
  Eigen::MatrixXd by_error = Eigen::MatrixXd::Zero(9 + n, all);
  by_error.topLeftCorner<6, 6>().setIdentity();
  for (const PoseShift& shift : shifts)
    by_error.block(0, 15 + slot(shift.block).at, 6, shift.by_block.cols()) = shift.by_block;
  by_error.block<3, 3>(6, error_state::kV).setIdentity();
  if (block != nullptr) by_error.block(9, 15 + slot(*block).at, n, n).setIdentity();
  return by_error * joint_covariance() * by_error.transpose();
}

Matrix6d ErrorStateFilter::share_of_blocks(const JointMeasurement& m) const {
  const Eigen::Index n = m.size() - 6;
  if (n == 0) return Matrix6d::Zero();
  const Matrix6d pose = m.information().topLeftCorner<6, 6>();
  const Matrix6d damped = pose + 1e-9 * pose.trace() * Matrix6d::Identity();
  const Eigen::MatrixXd by_blocks = damped.ldlt().solve(m.information().topRightCorner(6, n));
  std::vector<int> states;
  for (const JointMeasurement::Block& block : m.blocks())
    for (int i = 0; i < block.size; ++i) states.push_back(slot(block.id).at + i);
  return by_blocks * blocks_(states, states) * by_blocks.transpose();
}

}  // namespace evpose
