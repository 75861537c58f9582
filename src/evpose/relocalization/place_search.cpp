// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/relocalization/place_search.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace evpose {
namespace {

// First the eighths of each place with a wide kernel, then theirs, and theirs, with a narrow one.
constexpr double kWide = 0.035, kNarrow = 0.015;  // tangent units
constexpr double kKeptShare = 0.05;               // of the first ones
constexpr std::size_t kKept = 400;                // of the second ones
constexpr int kEighths = 8;
constexpr double kMargin = 0.1;  // tangent units beside the image
constexpr float kNearest_m = 0.2F;
constexpr std::size_t kFewestPoints = 40;  // that are in view
constexpr std::size_t kCoarseStep = 2;     // of the points that are compared first

/// A part of a place's cube: an eighth, or an eighth of that, and so on.
struct Candidate {
  float mean, root_count;  ///< of its points
  std::uint32_t place;
  std::uint16_t attitude, part;
};

auto number_of(const Candidate& c) { return std::tie(c.place, c.attitude, c.part); }

/// Of the part's middle from the place's, in edges.
Eigen::Vector3d offset_of(int part, int levels) {
  Eigen::Vector3d out = Eigen::Vector3d::Zero();
  for (double edge = std::pow(0.5, levels); levels > 0; --levels, edge *= 2, part /= kEighths)
    for (int k = 0; k < 3; ++k) out[k] += edge * (static_cast<double>(part >> k & 1) - 0.5);
  return out;
}

/// Mean over candidates of one attitude is chance.
class Chance {
 public:
  explicit Chance(std::size_t attitudes) : sums_(attitudes, 0.0), counts_(attitudes, 0.0) {}
  void add(const Candidate& c) {
    sums_[c.attitude] += static_cast<double>(c.mean);
    ++counts_[c.attitude];
  }
  /// In standard deviations of independent points.
  float above(const Candidate& c) const {
    return c.root_count * (c.mean - static_cast<float>(sums_[c.attitude] / counts_[c.attitude]));
  }

 private:
  std::vector<double> sums_, counts_;
};

/// Best first.
void keep_best(std::vector<Candidate>& candidates, const Chance& chance, std::size_t most) {
  most = std::min(most, candidates.size());
  std::partial_sort(candidates.begin(), candidates.begin() + static_cast<std::ptrdiff_t>(most),
                    candidates.end(), [&](const Candidate& a, const Candidate& b) {
                      const float x = chance.above(a), y = chance.above(b);
                      return x != y ? x > y : number_of(a) < number_of(b);
                    });
  candidates.resize(most);
}

/// Looks from places with attitudes.
class Looks {
 public:
  Looks(const PlaceIndex& index, const LineScores& scores, const Pose& T_body_cam,
        std::span<const AttitudeGuess> attitudes)
      : index_(index), half_view_(scores.half_view().cast<float>() + Eigen::Vector2f::Constant(kMargin)) {
    const double angle = std::atan(half_view_.cast<double>().norm());
    for (const AttitudeGuess& a : attitudes) {
      const Eigen::Quaterniond q_map_cam = a.q_map_body * T_body_cam.q;
      R_cam_map_.push_back(q_map_cam.conjugate().toRotationMatrix().cast<float>());
      directions_.push_back(PlaceIndex::directions_around(q_map_cam * Eigen::Vector3d::UnitZ(), angle));
    }
  }

  /// Sees every `step`-th of the points in view from the middle of a place.
  void look(std::uint32_t place, std::size_t attitude, std::size_t step) {
    const PlaceIndex::Place& from = index_.places()[place];
    const Eigen::Matrix3f& R = R_cam_map_[attitude];
    const Eigen::Vector3f shift = R * (index_.anchor() - from.middle).cast<float>();
    seen_.clear();
    for (const int direction : directions_[attitude]) {
      const std::span<const std::uint32_t> points = index_.seen_from(from, direction);
      for (std::size_t k = 0; k < points.size(); k += step) {
        const PlaceIndex::Sample& sample = index_.sample(points[k]);
        const Eigen::Vector3f x = R * sample.position + shift;
        if (x.z() > kNearest_m && std::abs(x.x()) < half_view_.x() * x.z() &&
            std::abs(x.y()) < half_view_.y() * x.z())
          seen_.add(x, R * sample.tangent);
      }
    }
    seen_.complete();
    place_ = place;
    attitude_ = attitude;
  }
  std::size_t points() const { return seen_.size(); }

  /// The look's points seen from the eighths of a part.
  void score_eighths(const LineScores& scores, int part, int level, Chance* chance,
                     std::vector<Candidate>& out) const {
    const auto count = static_cast<float>(seen_.size());
    for (int eighth = 0; eighth < kEighths; ++eighth) {
      const int smaller = part * kEighths + eighth;
      const Eigen::Vector3d moved = index_.edge_m() * offset_of(smaller, level);
      const float sum = scores.sum(seen_, R_cam_map_[attitude_] * -moved.cast<float>());
      out.push_back({sum / count, std::sqrt(count), place_, static_cast<std::uint16_t>(attitude_),
                     static_cast<std::uint16_t>(smaller)});
      if (chance != nullptr) chance->add(out.back());
    }
  }

 private:
  const PlaceIndex& index_;
  Eigen::Vector2f half_view_;
  std::vector<Eigen::Matrix3f> R_cam_map_;    ///< of the attitudes
  std::vector<std::vector<int>> directions_;  ///< in view
  SeenPoints seen_;
  std::uint32_t place_ = 0;
  std::size_t attitude_ = 0;
};

/// The eighths of candidates, which make parts of `level`.
std::vector<Candidate> eighths_of(std::vector<Candidate> candidates, int level, const LineScores& scores,
                                  Looks& looks, Chance* chance) {
  std::sort(candidates.begin(), candidates.end(),
            [](const Candidate& a, const Candidate& b) { return number_of(a) < number_of(b); });
  std::vector<Candidate> out;
  const Candidate* before = nullptr;
  for (const Candidate& c : candidates) {
    if (before == nullptr || c.place != before->place || c.attitude != before->attitude)
      looks.look(c.place, c.attitude, 1);
    looks.score_eighths(scores, c.part, level, chance, out);
    before = &c;
  }
  return out;
}

}  // namespace

std::vector<PoseGuess> search_places(std::span<const EdgeLine> lines, const Camera& camera,
                                     const Pose& T_body_cam, const PlaceIndex& index,
                                     const Eigen::AlignedBox3d& box, std::span<const AttitudeGuess> attitudes,
                                     std::size_t most) {
  const LineScores wide(lines, camera, kWide), narrow(lines, camera, kNarrow);
  Looks looks(index, wide, T_body_cam, attitudes);
  const double edge_m = index.edge_m();
  const Eigen::AlignedBox3d middles(box.min().array() - 0.5 * edge_m, box.max().array() + 0.5 * edge_m);
  std::vector<Candidate> candidates;
  Chance coarse_chance(attitudes.size()), chance(attitudes.size());
  for (std::uint32_t p = 0; p < index.places().size(); ++p) {
    if (!middles.contains(index.places()[p].middle)) continue;
    for (std::size_t a = 0; a < attitudes.size(); ++a) {
      looks.look(p, a, kCoarseStep);
      if (kCoarseStep * looks.points() >= kFewestPoints)
        looks.score_eighths(wide, 0, 1, &coarse_chance, candidates);
    }
  }
  const auto share = static_cast<std::size_t>(kKeptShare * static_cast<double>(candidates.size()));
  keep_best(candidates, coarse_chance, std::max(kKept, share));
  candidates = eighths_of(std::move(candidates), 2, narrow, looks, &chance);
  keep_best(candidates, chance, kKept);
  candidates = eighths_of(std::move(candidates), 3, narrow, looks, nullptr);
  keep_best(candidates, chance, most);
  std::vector<PoseGuess> out;
  for (const Candidate& c : candidates) {
    // Places are those of the camera.
    const Eigen::Vector3d p_cam = index.places()[c.place].middle + edge_m * offset_of(c.part, 3);
    const Eigen::Quaterniond& q = attitudes[c.attitude].q_map_body;
    out.push_back({{q, p_cam - q * T_body_cam.p}, static_cast<double>(chance.above(c))});
  }
  return out;
}

}  // namespace evpose
