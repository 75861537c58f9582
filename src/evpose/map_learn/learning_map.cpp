// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map_learn/learning_map.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "evpose/fusion/fusion_config.h"

namespace evpose::map_learn {
namespace {

// Of what a cloud's map says of a contour, beside the sigma that it states.
constexpr double kContour_m = SegmentOffsetConfig{}.sigma_m;  // some stand on another edge, and count less
// Of the errors of a contour's segments: measured in rooms; all of them together tell as much as their mean.
constexpr double kCorrelation = 0.3;
// Of a marking: nothing is known along its plane; across it some faces stand further off.
constexpr double kAlongPlane_m = 0.1, kOffPlane_m = 1e-3;
// What is not in the adjustment's covariance: light and shade beside an edge, a tangent that leans.
constexpr double kFloor_m = 0.3e-3;

constexpr double kViewChange = 0.25;  // rad by which views differ from those that told a contour's place

// What a landmark has to show.
constexpr int kLeastObservations = 5;  // a quarter of a second
constexpr double kWorstChi2 = 3;
constexpr double kLargestDelay_px = 0.25;
constexpr double kLargestSigma_m = 3e-3;
constexpr double kLargestHeight_m = 3e-3;      // of a marking over its plane, beside three sigmas
constexpr double kLargestDepthSigma_m = 0.02;  // of an edge on no plane

}  // namespace

LearningMap::LearningMap(const ContourMap& given) : map_(given), frame_(given.learnt) {
  if (frame_) shared_ = Eigen::VectorXd::Zero(6);
  std::int32_t next = next_contour();
  for (ContourPoint& p : map_.points) {
    if (p.contour < 0 && p.kind == ContourKind::marking) p.contour = next++;
    records_.push_back({p.position, p.sigma, false, false, p.contrast != 0, false, p.looks, p.seen_from});
  }
}

Eigen::MatrixXd LearningMap::shared_covariance() const {
  return frame_ ? Eigen::MatrixXd(frame_->covariance) : Eigen::MatrixXd();
}

Eigen::Matrix<double, 3, 6> LearningMap::by_frame(const Eigen::Vector3d& at) const {
  Eigen::Matrix<double, 3, 6> out;
  out << Eigen::Matrix3d::Identity(), -so3::hat(at - frame_->about);
  return out;
}

std::int32_t LearningMap::next_contour() const {
  std::int32_t next = 0;
  for (const ContourPoint& p : map_.points) next = std::max(next, p.contour + 1);
  return next;
}

void LearningMap::displace(const std::vector<Eigen::Vector3d>& displacements) {
  for (std::size_t i = 0; i < displacements.size(); ++i)
    map_.points[i].position += displacements[i].cast<float>();
}

void LearningMap::add_new(const std::vector<ContourPoint>& points) {
  for (const ContourPoint& p : points) {
    map_.points.push_back(p);
    records_.push_back({p.position, p.sigma, true});
  }
}

/// One whose place an earlier flight has told: well across the contour as it was seen, less well towards the
/// camera, and with that flight's error of the frame beside its own.
Landmark LearningMap::told_before(const Landmark& l, const Eigen::Vector3d& at, double stated_m) const {
  Landmark out = l;
  const Eigen::Matrix<double, 3, 6> J = by_frame(at);
  const Eigen::Matrix3d common = J * frame_->covariance * J.transpose();
  const Eigen::Vector3d across = out.directions.col(0);
  const double own_m =
      std::sqrt(std::max(stated_m * stated_m - across.dot(common * across), kFloor_m * kFloor_m));
  out.sigma_m = {own_m, own_m / kViewChange};
  for (Eigen::Index k = 0; k < 6; ++k) out.shared.emplace_back(k, J.col(k));
  return out;
}

namespace {

/// Of each contour, by its number, into how many segments it is cut.
std::vector<int> parts_of_contours(const ContourMap& map, const ContourSegments& segments,
                                   std::int32_t contours) {
  std::vector<int> out(static_cast<std::size_t>(contours), 0);
  std::vector<bool> counted(segments.count, false);
  for (std::size_t i = 0; i < map.points.size(); ++i) {
    const std::uint32_t s = segments.of_point[i];
    if (counted[s] || map.points[i].contour < 0) continue;
    counted[s] = true;
    ++out[static_cast<std::size_t>(map.points[i].contour)];
  }
  return out;
}

}  // namespace

std::vector<Landmark> LearningMap::landmarks(const ContourSegments& segments) const {
  const std::vector<int> parts = parts_of_contours(map_, segments, next_contour());
  std::vector<Landmark> out(segments.count);
  std::vector<Eigen::Vector3d> moved(segments.count, Eigen::Vector3d::Zero()), tangent = moved,
                                                                               normal = moved, place = moved;
  std::vector<double> points(segments.count, 0), sigma(segments.count, 0);
  std::vector<const Record*> record(segments.count, nullptr);
  std::vector<const ContourPoint*> example(segments.count, nullptr);
  for (std::size_t i = 0; i < map_.points.size(); ++i) {
    const std::uint32_t s = segments.of_point[i];
    const ContourPoint& p = map_.points[i];
    if (example[s] == nullptr) example[s] = &p, record[s] = &records_[i];
    const double sign = example[s]->tangent.dot(p.tangent) < 0 ? -1 : 1;
    moved[s] += (p.position - records_[i].given).cast<double>();
    tangent[s] += sign * p.tangent.cast<double>();
    normal[s] += p.normal.cast<double>();
    place[s] += map_.anchor + records_[i].given.cast<double>();
    sigma[s] += static_cast<double>(records_[i].given_sigma);
    points[s] += 1;
  }
  for (std::uint32_t s = 0; s < segments.count; ++s) {
    Landmark& l = out[s];
    const Eigen::Vector3d t = tangent[s].normalized();
    Eigen::Vector3d n = normal[s] - normal[s].dot(t) * t;
    n = n.norm() > 0.1 * points[s] ? n.normalized() : t.unitOrthogonal();
    const bool told = frame_ && record[s]->looks > 0;
    if (const Eigen::Vector3d across = t.cross(record[s]->seen_from.cast<double>());
        told && across.norm() > 0.1)
      n = across.normalized();
    l.directions << n, t.cross(n);
    const double stated = sigma[s] / points[s];
    if (told) {
      l = told_before(l, place[s] / points[s], stated);
    } else if (record[s]->is_new && example[s]->kind != ContourKind::marking) {
      l.sigma_m = {kAlongPlane_m, kAlongPlane_m};
    } else if (example[s]->kind == ContourKind::marking) {
      l.sigma_m = record[s]->is_new ? Eigen::Vector2d(kAlongPlane_m, kOffPlane_m)
                                    : Eigen::Vector2d(stated, stated / kViewChange);
    } else {
      const std::int32_t contour = example[s]->contour;
      const int others = contour < 0 ? 0 : parts[static_cast<std::size_t>(contour)] - 1;
      const double across = std::sqrt(1 + kCorrelation * others) * std::hypot(stated, kContour_m);
      l.sigma_m = {across, across};
    }
    l.moved_m = l.directions.transpose() * (moved[s] / points[s]);
  }
  return out;
}

namespace {

enum class Verdict { untold, good, wrong };

/// What the events say of a landmark. A given contour has the cloud's word, too.
Verdict judge_given(const LandmarkEstimate& e) {
  if (e.observations < kLeastObservations) return Verdict::untold;
  return e.chi2 < kWorstChi2 && std::abs(e.delay_px) < kLargestDelay_px ? Verdict::good : Verdict::wrong;
}

Verdict judge_found(const LandmarkEstimate& e, const Landmark& l, ContourKind kind, bool contrast_is_known) {
  const Verdict verdict = judge_given(e);
  if (verdict != Verdict::good) return verdict;
  const bool placed =
      kind == ContourKind::marking
          ? std::abs(l.moved_m(1) + e.move_m(1)) < kLargestHeight_m + 3 * std::sqrt(e.covariance(1, 1))
          : e.covariance.trace() < kLargestDepthSigma_m * kLargestDepthSigma_m;
  const bool sure = placed && contrast_is_known && std::sqrt(e.seen_variance_m2) < kLargestSigma_m;
  return sure ? Verdict::good : Verdict::wrong;
}

}  // namespace

void LearningMap::take(const LandmarkEstimate& e, const Landmark& l, const Eigen::Vector3d& from,
                       std::size_t point) {
  ContourPoint& p = map_.points[point];
  p.position += (l.directions * e.move_m).cast<float>();
  const double elsewhere = kViewChange * kViewChange * e.covariance.trace();
  Record& record = records_[point];
  p.sigma = static_cast<float>(std::sqrt(e.seen_variance_m2 + elsewhere + kFloor_m * kFloor_m));
  record.was_told = true;
  constexpr int kMost = std::numeric_limits<std::uint16_t>::max();
  const auto before = static_cast<float>(record.looks), now = static_cast<float>(e.observations);
  p.looks = static_cast<std::uint16_t>(std::min(kMost, record.looks + e.observations));
  p.seen_from = (before * record.seen_from + now * from.cast<float>()) / (before + now);
}

namespace {

/// Of each landmark, from where it was seen: mean of unit vectors.
std::vector<Eigen::Vector3d> mean_views(const FlightObservations& observed, std::size_t landmarks) {
  std::vector<Eigen::Vector3d> out(landmarks, Eigen::Vector3d::Zero());
  std::vector<double> count(landmarks, 0);
  for (std::size_t i = 0; i < observed.observations.size(); ++i) {
    out[observed.observations[i].landmark] += observed.views[i];
    ++count[observed.observations[i].landmark];
  }
  for (std::size_t j = 0; j < landmarks; ++j) out[j] /= std::max(1.0, count[j]);
  return out;
}

}  // namespace

void LearningMap::apply(const AdjustmentResult& result, const ContourSegments& segments,
                        const FlightObservations& observed) {
  const auto unknowns = landmarks(segments);
  const auto views = mean_views(observed, segments.count);
  shared_ = result.shared;
  std::vector<bool> gone(map_.points.size(), false);
  for (std::size_t i = 0; i < map_.points.size(); ++i) {
    const std::uint32_t s = segments.of_point[i];
    ContourPoint& p = map_.points[i];
    Record& record = records_[i];
    const LandmarkEstimate& e = result.landmarks[s];
    record.silent = observed.silent[s];
    const bool vanished = record.silent && record.told_before;
    const bool found = record.is_new || p.kind == ContourKind::marking;
    const Verdict verdict = vanished ? Verdict::wrong
                            : found
                                ? judge_found(e, unknowns[s], p.kind, observed.map.points[i].contrast != 0)
                                : judge_given(e);
    if (verdict == Verdict::good) {
      take(e, unknowns[s], views[s], i);
      p.contrast = observed.map.points[i].contrast;
    } else if (verdict == Verdict::untold && !record.was_told) {
      p.position = record.given;
      if (frame_ && record.looks > 0)
        p.position += (by_frame(map_.anchor + record.given.cast<double>()) * shared_.head<6>()).cast<float>();
    }
    gone[i] = verdict == Verdict::wrong || (record.is_new && verdict == Verdict::untold);
    if (gone[i] && !record.is_new) (vanished ? gone_m_ : struck_m_) += static_cast<double>(p.length);
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < map_.points.size(); ++i)
    if (!gone[i]) map_.points[kept] = map_.points[i], records_[kept] = records_[i], ++kept;
  map_.points.resize(kept);
  records_.resize(kept);
}

LearntLengths LearningMap::lengths() const {
  LearntLengths out;
  out.struck_m = struck_m_;
  out.gone_m = gone_m_;
  for (std::size_t i = 0; i < map_.points.size(); ++i) {
    const auto length = static_cast<double>(map_.points[i].length);
    (records_[i].is_new ? out.new_m : records_[i].was_told ? out.moved_m : out.kept_m) += length;
    if (records_[i].silent && !records_[i].was_told && !records_[i].is_new) out.silent_m += length;
  }
  return out;
}

}  // namespace evpose::map_learn
