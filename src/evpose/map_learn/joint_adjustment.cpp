// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/joint_adjustment.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "evpose/core/error.h"

namespace evpose::map_learn {
namespace {

constexpr double kHalfWeight = 2;  // sigmas beyond which what is observed counts less than a quarter
constexpr double kChi2Cut = 9;

double robust_weight(double z) {
  const double w = 1 / (1 + z * z / (kHalfWeight * kHalfWeight));
  return w * w;
}

using Index = Eigen::Index;
using Rows3 = Eigen::Matrix<double, Eigen::Dynamic, 3>;

/// Where each unknown stands.
struct Layout {
  explicit Layout(const AdjustmentProblem& p)
      : delay(15 * static_cast<Index>(p.knots())), shared(delay + 1), size(shared + p.shared.size()) {}
  Index delay, shared, size;
};

/// Derivative of one observation by its unknowns.
struct Row {
  std::vector<std::pair<Index, double>> kept;  ///< among the kept unknowns
  Eigen::Vector3d own;                         ///< by those of its landmark
};

Row row_of(const AdjustmentProblem& p, const Layout& at, const Observation& o) {
  const Landmark& landmark = p.landmarks[o.landmark];
  Row row;
  for (Index i = 0; i < 6; ++i) {
    const Index first = 15 * static_cast<Index>(o.knot) + i;
    row.kept.emplace_back(first, (1 - o.share) * o.by_pose(i));
    if (o.share > 0) row.kept.emplace_back(first + 15, o.share * o.by_pose(i));
  }
  row.kept.emplace_back(at.delay, o.forward);
  row.own << landmark.directions.transpose() * o.by_point, o.forward;
  return row;
}

/// The part of the normal equations that one landmark enters, over the kept unknowns that it touches.
struct Share {
  std::vector<Index> columns;
  Eigen::MatrixXd H;
  Eigen::VectorXd b;
  Rows3 mixed;
  Eigen::Matrix3d own = Eigen::Matrix3d::Zero();
  Eigen::Vector3d own_b = Eigen::Vector3d::Zero();
};

class Adjuster {
 public:
  explicit Adjuster(const AdjustmentProblem& problem) : p_(problem), at_(problem) {
    first_.assign(p_.landmarks.size() + 1, 0);
    for (const Observation& o : p_.observations) ++first_[o.landmark + 1];
    for (std::size_t j = 0; j < p_.landmarks.size(); ++j) first_[j + 1] += first_[j];
    for (std::size_t i = 1; i < p_.observations.size(); ++i)
      EVPOSE_CHECK(p_.observations[i - 1].landmark <= p_.observations[i].landmark);
    weights_.assign(p_.observations.size(), 1);
    prior_weights_.assign(p_.landmarks.size(), Eigen::Vector2d::Ones());
    moves_.assign(p_.landmarks.size(), Eigen::Vector3d::Zero());
  }

  void solve();
  void reweight();
  AdjustmentResult result(const std::vector<Eigen::Matrix3d>& R_map_body) const;

 private:
  Share share_of(std::size_t j) const;
  void add_place_prior(std::size_t j, Share& s) const;
  Eigen::Vector2d off_given(std::size_t j) const;
  void add_priors(Eigen::MatrixXd& H, Eigen::VectorXd& b) const;
  double residual(const Observation& o, const Eigen::Vector3d& own) const;
  LandmarkEstimate estimate(std::size_t j, const Eigen::MatrixXd& covariance) const;

  const AdjustmentProblem& p_;
  Layout at_;
  std::vector<std::size_t> first_;  ///< observation of each landmark
  std::vector<double> weights_;
  std::vector<Eigen::Vector2d> prior_weights_;
  Eigen::VectorXd x_;
  std::vector<Eigen::Vector3d> moves_;
  Eigen::LDLT<Eigen::MatrixXd> ldlt_;
};

Share Adjuster::share_of(std::size_t j) const {
  Share s;
  for (std::size_t i = first_[j]; i < first_[j + 1]; ++i)
    for (const auto& [column, value] : row_of(p_, at_, p_.observations[i]).kept) s.columns.push_back(column);
  for (const auto& [number, by_unit] : p_.landmarks[j].shared) s.columns.push_back(at_.shared + number);
  std::sort(s.columns.begin(), s.columns.end());
  s.columns.erase(std::unique(s.columns.begin(), s.columns.end()), s.columns.end());
  const auto n = static_cast<Index>(s.columns.size());
  s.H.setZero(n, n);
  s.b.setZero(n);
  s.mixed.setZero(n, 3);
  for (std::size_t i = first_[j]; i < first_[j + 1]; ++i) {
    const Observation& o = p_.observations[i];
    Row row = row_of(p_, at_, o);
    const double w = weights_[i] / o.variance_px2;
    for (auto& [column, value] : row.kept)
      column = std::lower_bound(s.columns.begin(), s.columns.end(), column) - s.columns.begin();
    for (const auto& [a, va] : row.kept) {
      for (const auto& [c, vc] : row.kept) s.H(a, c) += w * va * vc;
      s.b(a) += w * va * o.offset_px;
      s.mixed.row(a) += w * va * row.own.transpose();
    }
    s.own += w * row.own * row.own.transpose();
    s.own_b += w * o.offset_px * row.own;
  }
  add_place_prior(j, s);
  s.own(2, 2) += 1 / (p_.own_delay_sigma_px * p_.own_delay_sigma_px);
  return s;
}

/// The landmark has moved from where what it shares has put its given place.
void Adjuster::add_place_prior(std::size_t j, Share& s) const {
  const Landmark& landmark = p_.landmarks[j];
  for (int d = 0; d < 2; ++d) {
    const double w = prior_weights_[j](d) / (landmark.sigma_m(d) * landmark.sigma_m(d));
    double moved = landmark.moved_m(d);
    std::vector<std::pair<Index, double>> by_shared;
    for (const auto& [number, by_unit] : landmark.shared) {
      const double along = landmark.directions.col(d).dot(by_unit);
      moved -= along * p_.shared(number);
      const auto column = std::lower_bound(s.columns.begin(), s.columns.end(), at_.shared + number);
      by_shared.emplace_back(column - s.columns.begin(), along);
    }
    s.own(d, d) += w;
    s.own_b(d) -= w * moved;
    for (const auto& [a, va] : by_shared) {
      for (const auto& [c, vc] : by_shared) s.H(a, c) += w * va * vc;
      s.b(a) += w * va * moved;
      s.mixed(a, d) -= w * va;
    }
  }
}

/// How far it is from where what it shares has put its given place, along its directions.
Eigen::Vector2d Adjuster::off_given(std::size_t j) const {
  const Landmark& landmark = p_.landmarks[j];
  Eigen::Vector2d off = landmark.moved_m + moves_[j].head<2>();
  for (const auto& [number, by_unit] : landmark.shared)
    off -= (p_.shared(number) + x_(at_.shared + number)) * (landmark.directions.transpose() * by_unit);
  return off;
}

void Adjuster::add_priors(Eigen::MatrixXd& H, Eigen::VectorXd& b) const {
  const Matrix15d start = p_.start_covariance.ldlt().solve(Matrix15d::Identity());
  H.topLeftCorner<15, 15>() += start;
  b.head<15>() -= start * p_.start_offset;
  for (std::size_t k = 0; k < p_.steps.size(); ++k) {
    const KnotStep& step = p_.steps[k];
    const Matrix15d information = step.noise.ldlt().solve(Matrix15d::Identity());
    Eigen::Matrix<double, 15, 30> J;  // residual d_next - transition d + offset
    J << -step.transition, Matrix15d::Identity();
    const Index at = 15 * static_cast<Index>(k);
    const Eigen::Matrix<double, 30, 15> JW = J.transpose() * information;
    H.block<30, 30>(at, at) += JW * J;
    b.segment<30>(at) -= JW * step.offset;
  }
  H(at_.delay, at_.delay) += 1 / (p_.delay_sigma_px * p_.delay_sigma_px);
  const Index n = p_.shared.size();
  if (n == 0) return;
  const Eigen::MatrixXd information = p_.shared_covariance.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
  H.bottomRightCorner(n, n) += information;
  b.tail(n) -= information * p_.shared;
}

void Adjuster::solve() {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(at_.size, at_.size);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(at_.size);
  add_priors(H, b);
  for (std::size_t j = 0; j < p_.landmarks.size(); ++j) {
    if (first_[j] == first_[j + 1]) continue;
    const Share s = share_of(j);
    const Eigen::Matrix3d inverse = s.own.ldlt().solve(Eigen::Matrix3d::Identity());
    const Rows3 gain = s.mixed * inverse;
    const Eigen::MatrixXd reduced = s.H - gain * s.mixed.transpose();
    const Eigen::VectorXd vector = s.b - gain * s.own_b;
    for (std::size_t a = 0; a < s.columns.size(); ++a) {
      for (std::size_t c = 0; c < s.columns.size(); ++c)
        H(s.columns[a], s.columns[c]) += reduced(static_cast<Index>(a), static_cast<Index>(c));
      b(s.columns[a]) += vector(static_cast<Index>(a));
    }
  }
  ldlt_.compute(H);
  x_ = ldlt_.solve(b);
  for (std::size_t j = 0; j < p_.landmarks.size(); ++j) {
    if (first_[j] == first_[j + 1]) continue;
    const Share s = share_of(j);
    Eigen::Vector3d rest = s.own_b;
    for (std::size_t a = 0; a < s.columns.size(); ++a)
      rest -= x_(s.columns[a]) * s.mixed.row(static_cast<Index>(a)).transpose();
    moves_[j] = s.own.ldlt().solve(rest);
  }
}

double Adjuster::residual(const Observation& o, const Eigen::Vector3d& own) const {
  const Row row = row_of(p_, at_, o);
  double r = o.offset_px - row.own.dot(own);
  for (const auto& [column, value] : row.kept) r -= value * x_(column);
  return r;
}

void Adjuster::reweight() {
  for (std::size_t i = 0; i < p_.observations.size(); ++i) {
    const Observation& o = p_.observations[i];
    weights_[i] = robust_weight(residual(o, moves_[o.landmark]) / std::sqrt(o.scatter_px2));
  }
  for (std::size_t j = 0; j < p_.landmarks.size(); ++j) {
    const Eigen::Vector2d off = off_given(j);
    for (int d = 0; d < 2; ++d) prior_weights_[j](d) = robust_weight(off(d) / p_.landmarks[j].sigma_m(d));
  }
}

LandmarkEstimate Adjuster::estimate(std::size_t j, const Eigen::MatrixXd& covariance) const {
  LandmarkEstimate out;
  const Share s = share_of(j);
  out.move_m = moves_[j].head<2>();
  out.delay_px = moves_[j](2);
  out.observations = static_cast<int>(first_[j + 1] - first_[j]);
  for (std::size_t i = first_[j]; i < first_[j + 1]; ++i) {
    const double r = residual(p_.observations[i], moves_[j]);
    out.chi2 += std::min(kChi2Cut, r * r / p_.observations[i].scatter_px2) / out.observations;
  }
  const Eigen::Matrix3d inverse = s.own.ldlt().solve(Eigen::Matrix3d::Identity());
  const auto n = static_cast<Index>(s.columns.size());
  Eigen::MatrixXd kept(n, n);
  for (Index a = 0; a < n; ++a)
    for (Index c = 0; c < n; ++c)
      kept(a, c) = covariance(s.columns[static_cast<std::size_t>(a)], s.columns[static_cast<std::size_t>(c)]);
  const Rows3 gain = s.mixed * inverse;
  out.covariance = (inverse + gain.transpose() * kept * gain).topLeftCorner<2, 2>();
  for (std::size_t i = first_[j]; i < first_[j + 1]; ++i) {
    const Eigen::Vector2d across =
        p_.landmarks[j].directions.transpose() * p_.observations[i].by_point.normalized();
    out.seen_variance_m2 += across.dot(out.covariance * across) / out.observations;
  }
  return out;
}

AdjustmentResult Adjuster::result(const std::vector<Eigen::Matrix3d>& R_map_body) const {
  AdjustmentResult out;
  const Eigen::MatrixXd covariance = ldlt_.solve(Eigen::MatrixXd::Identity(at_.size, at_.size));
  const auto knots = static_cast<Index>(p_.knots());
  Eigen::MatrixXd mean = Eigen::MatrixXd::Zero(6, at_.size);  // of the poses' errors in the map frame
  for (Index k = 0; k < knots; ++k) {
    out.states.emplace_back(x_.segment<15>(15 * k));
    out.pose_covariances.emplace_back(covariance.block<6, 6>(15 * k, 15 * k));
    mean.block<3, 3>(0, 15 * k) = Eigen::Matrix3d::Identity() / static_cast<double>(knots);
    mean.block<3, 3>(3, 15 * k + 3) = R_map_body[static_cast<std::size_t>(k)] / static_cast<double>(knots);
  }
  out.common_covariance = mean * covariance * mean.transpose();
  out.delay_px = x_(at_.delay);
  out.shared = p_.shared + x_.tail(p_.shared.size());
  out.landmarks.resize(p_.landmarks.size());
  for (std::size_t j = 0; j < p_.landmarks.size(); ++j)
    if (first_[j] < first_[j + 1]) out.landmarks[j] = estimate(j, covariance);
  return out;
}

}  // namespace

AdjustmentResult adjust(const AdjustmentProblem& problem, const std::vector<Eigen::Matrix3d>& R_map_body,
                        int reweightings) {
  EVPOSE_CHECK(R_map_body.size() == problem.knots());
  EVPOSE_CHECK(problem.shared_covariance.rows() == problem.shared.size());
  Adjuster adjuster(problem);
  adjuster.solve();
  for (int i = 0; i < reweightings; ++i) {
    adjuster.reweight();
    adjuster.solve();
  }
  return adjuster.result(R_map_body);
}

}  // namespace evpose::map_learn
