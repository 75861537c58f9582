// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/contour_profiles.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace evpose {
namespace {

constexpr double kBin_px = 0.5;
constexpr double kSlice_s = 0.002;  // contours hardly leave their normal's line in it
constexpr Eigen::Index kDraws = 16384, kBatch = 256;
constexpr std::size_t kElite = 64;
constexpr int kRounds = 6, kPerturbed = 40;  // of each of the elite, in each round by half as much
constexpr double kDistinct_px = 1;
constexpr unsigned kSeed = 1;

/// Begins of a search with their scores.
struct Candidate {
  Eigen::VectorXd z;
  double score;
};

class Search {
 public:
  Search(const ContourProfiles& profiles, const Eigen::MatrixXd& rows) : profiles_(profiles), rows_(rows) {}

  /// The best of many draws.
  std::vector<Candidate> draw() {
    std::vector<Candidate> all;
    for (Eigen::Index done = 0; done < kDraws; done += kBatch) {
      Eigen::MatrixXd z = normal(kBatch, 1);
      if (done == 0) z.col(0).setZero();
      add(z, all);
      keep_best(all, kElite);
    }
    return all;
  }

  /// Each of these climbs on its own.
  void climb(std::vector<Candidate>& elite) {
    double sigma = 0.5;
    for (int round = 0; round < kRounds; ++round, sigma *= 0.5)
      for (Candidate& one : elite) {
        std::vector<Candidate> near;
        const Eigen::MatrixXd z = normal(kPerturbed, sigma).colwise() + one.z;
        add(z, near);
        keep_best(near, 1);
        if (near[0].score > one.score) one = near[0];
      }
    keep_best(elite, elite.size());
  }

 private:
  Eigen::MatrixXd normal(Eigen::Index columns, double sigma) {
    return Eigen::MatrixXd::NullaryExpr(rows_.cols(), columns, [&] { return sigma * unit_(random_); });
  }

  void add(const Eigen::MatrixXd& z, std::vector<Candidate>& out) const {
    const Eigen::MatrixXd px = rows_ * z;
    for (Eigen::Index i = 0; i < z.cols(); ++i)
      out.push_back({z.col(i), profiles_.score(px.col(i)) - 0.5 * z.col(i).squaredNorm()});
  }

  static void keep_best(std::vector<Candidate>& all, std::size_t most) {
    std::ranges::stable_sort(all, std::greater<>{}, &Candidate::score);
    if (all.size() > most) all.erase(all.begin() + static_cast<std::ptrdiff_t>(most), all.end());
  }

  const ContourProfiles& profiles_;
  const Eigen::MatrixXd& rows_;
  std::mt19937 random_{kSeed};
  std::normal_distribution<double> unit_;
};

}  // namespace

ContourProfiles::ContourProfiles(ImageSize size, std::size_t samples, double reach_px)
    : size_(size),
      reach_(static_cast<int>(std::ceil(reach_px / kBin_px))),
      image_(static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height)),
      profiles_(Eigen::MatrixXf::Zero(2 * reach_ + 1, static_cast<Eigen::Index>(samples))) {}

void ContourProfiles::add(std::span<const FilteredEvent> events, std::uint32_t now_us, double span_s,
                          std::span<const ContourSample> samples, std::span<const std::uint32_t> slots) {
  const auto at = [&](const FilteredEvent& e) -> std::uint8_t& {
    return image_[static_cast<std::size_t>(e.y) * static_cast<std::size_t>(size_.width) + e.x];
  };
  const auto count = std::max(1, static_cast<int>(std::ceil(span_s / kSlice_s)));
  std::vector<std::vector<FilteredEvent>> slices(static_cast<std::size_t>(count));
  for (const FilteredEvent& e : events) {
    const double age_s = 1e-6 * static_cast<std::int32_t>(now_us - e.stamp_us);
    slices[static_cast<std::size_t>(std::clamp(static_cast<int>(age_s / kSlice_s), 0, count - 1))].push_back(
        e);
  }
  for (std::size_t k = 0; k < slices.size(); ++k) {
    for (const FilteredEvent& e : slices[k])
      if (at(e) < 255) ++at(e);
    add_slice(samples, slots, (static_cast<double>(k) + 0.5) * kSlice_s);
    for (const FilteredEvent& e : slices[k]) at(e) = 0;
  }
}

void ContourProfiles::add_slice(std::span<const ContourSample> samples, std::span<const std::uint32_t> slots,
                                double age_s) {
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const ContourSample& s = samples[i];
    const Eigen::Vector2d middle = s.pixel - (s.speed_px_s - s.curvature_px_s2 * age_s) * age_s * s.normal_px;
    auto profile = profiles_.col(static_cast<Eigen::Index>(slots[i]));
    for (int bin = -reach_; bin <= reach_; ++bin) {
      const Eigen::Vector2d p = middle + kBin_px * bin * s.normal_px;
      const auto x = static_cast<int>(std::lround(p.x())), y = static_cast<int>(std::lround(p.y()));
      if (x < 0 || y < 0 || x >= size_.width || y >= size_.height) continue;
      profile(bin + reach_) += image_[static_cast<std::size_t>(y) * static_cast<std::size_t>(size_.width) +
                                      static_cast<std::size_t>(x)];
    }
  }
}

void ContourProfiles::finish() {
  for (auto profile : profiles_.colwise()) {
    const float mean = profile.mean();
    profile = ((profile.array() + 1) / (mean + 1)).log();
    profile.array() -= profile.mean();
  }
}

double ContourProfiles::score(const Eigen::Ref<const Eigen::VectorXd>& px) const {
  double sum = 0;
  for (Eigen::Index i = 0; i < px.size(); ++i) {
    const auto bin = static_cast<Eigen::Index>(std::lround(px(i) / kBin_px)) + reach_;
    if (bin >= 0 && bin < profiles_.rows()) sum += static_cast<double>(profiles_(bin, i));
  }
  return sum;
}

std::vector<Eigen::VectorXd> most_gathering(const ContourProfiles& profiles, const Eigen::MatrixXd& rows_px,
                                            std::size_t most) {
  Search search(profiles, rows_px);
  std::vector<Candidate> elite = search.draw();
  search.climb(elite);
  std::vector<Eigen::VectorXd> out;
  const double least = kDistinct_px * std::sqrt(static_cast<double>(rows_px.rows()));
  for (const Candidate& one : elite) {
    const auto same = [&](const Eigen::VectorXd& z) { return (rows_px * (z - one.z)).norm() < least; };
    if (out.size() < most && std::ranges::none_of(out, same)) out.push_back(one.z);
  }
  return out;
}

}  // namespace evpose
