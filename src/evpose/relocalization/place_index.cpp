// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/relocalization/place_index.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "evpose/map/depth_buffer.h"

namespace evpose {
namespace {

constexpr double kLeastEdge_m = 0.7;
constexpr std::uint32_t kNone = ~0U;
constexpr double kMostPlaces = 1500;
constexpr double kCell = 0.03;              // of the depth buffers, tangent units
constexpr double kTangent = 1.05;           // of a side's half angle of view: a little more than 45 deg
constexpr double kSpacing_rad = 0.035;      // of points along contours, as they are seen
constexpr std::size_t kFewestPoints = 150;  // in all directions: fewer are inside of something
constexpr double kRoom_m = 0.2;
constexpr double kNearest_m = 0.3;  // points nearer to a place's middle are left out

/// The camera's z axis along each axis of the map.
Eigen::Matrix3d side(int number) {
  const int axis = number / 2;
  const double sign = number % 2 == 0 ? 1 : -1;
  Eigen::Matrix3d R = Eigen::Matrix3d::Zero();
  R(axis, 2) = sign;
  R((axis + 1) % 3, 0) = 1;
  R((axis + 2) % 3, 1) = sign;
  return R;
}

int side_of(const Eigen::Vector3d& ray) {
  int axis = 0;
  ray.cwiseAbs().maxCoeff(&axis);
  return 2 * axis + (ray[axis] < 0 ? 1 : 0);
}

/// Of the squares that the sides of a cube are divided into.
int direction_of(const Eigen::Vector3d& ray) {
  constexpr int kSquares = PlaceIndex::kSquares;
  const int s = side_of(ray), axis = s / 2;
  const double depth = std::abs(ray[axis]);
  const auto square = [&](int k) {
    const double tangent = ray[(axis + k) % 3] / depth;
    return std::clamp(static_cast<int>(0.5 * (tangent + 1) * kSquares), 0, kSquares - 1);
  };
  return (s * kSquares + square(1)) * kSquares + square(2);
}

/// Evenly in 0 .. 1, the same for a point at every place.
double chance(std::uint32_t point) {
  std::uint32_t h = point * 0x9E3779B1u;
  h ^= h >> 15;
  h *= 0x85EBCA77u;
  return static_cast<double>(h ^ (h >> 13)) / 4294967296.0;
}

template <std::size_t... I>
std::array<DepthBuffer, 6> make_depth(std::index_sequence<I...> /*unused*/) {
  return {((void)I, DepthBuffer(Eigen::Vector2d(kTangent, kTangent), kCell))...};
}

}  // namespace

Eigen::AlignedBox3d space_around(const ContourMap& map) {
  Eigen::AlignedBox3d box;
  for (std::size_t i = 0; i < map.points.size(); ++i)
    if (!is_view_dependent(map.points[i].kind)) box.extend(map.position(i));
  box.min().array() -= kRoom_m;
  box.max().array() += kRoom_m;
  return box;
}

/// Fills an index, place by place.
class PlaceIndexBuilder {
 public:
  /// `known`: of each place, if there is any; `told`: likewise.
  PlaceIndexBuilder(const ContourIndex& index, const VisibleSetConfig& config, const PlaceTable* known,
                    PlaceTable* told, PlaceIndex& out)
      : index_(index),
        config_(config),
        known_(known),
        told_(told),
        out_(out),
        depth_(make_depth(std::make_index_sequence<6>())),
        occlusion_(config.occlusion && !index.occluders().empty()),
        listed_((index.map().points.size() + 63) / 64),
        seen_of_(index.map().points.size()),
        sample_of_(index.map().points.size(), kNone) {}

  void add_all(const Eigen::AlignedBox3d& box);

 private:
  struct Candidate {
    std::uint32_t number;
    Eigen::Vector3d ray;  ///< from the middle
  };
  void add_place(const Eigen::Vector3d& middle, std::size_t place);
  void list_candidates(const Eigen::Vector3d& middle);
  void look(const Eigen::Vector3d& middle, std::size_t place);
  void tell(std::size_t count);
  template <class Do>
  void for_candidates_by_number(const Do& act);
  void draw_surfaces(const Eigen::Vector3d& middle);
  bool hidden(const Eigen::Vector3d& from_middle) const;

  const ContourIndex& index_;
  const VisibleSetConfig& config_;
  const PlaceTable* known_;
  PlaceTable* told_;
  std::size_t known_bytes_ = 0;  ///< that the places before this one have
  PlaceIndex& out_;
  std::array<DepthBuffer, 6> depth_;  ///< to the sides of a cube
  bool occlusion_;
  std::vector<std::uint32_t> cubes_;
  std::vector<Candidate> candidates_;  ///< of the place being made
  std::vector<std::uint8_t> seen_;     ///< which of them are, a byte each
  std::vector<std::uint64_t> listed_;  ///< a bit of each of the map's points, zero between uses
  std::vector<std::uint8_t> seen_of_;  ///< of the map's points that are candidates
  std::array<std::vector<std::uint32_t>, PlaceIndex::kDirections> of_direction_;  ///< of the place being made
  std::vector<std::uint32_t> sample_of_;  ///< of the map's points, kNone: not used
};

double PlaceIndex::edge_m_of(const Eigen::AlignedBox3d& box) {
  return std::max(kLeastEdge_m, std::cbrt(box.volume() / kMostPlaces));
}

Eigen::Vector3d PlaceIndex::counts_of(const Eigen::AlignedBox3d& box) {
  return (box.sizes() / edge_m_of(box)).array().ceil().max(1);
}

PlaceIndex::PlaceIndex(const ContourIndex& index, const VisibleSetConfig& config,
                       const Eigen::AlignedBox3d& box, PlaceTable* told)
    : edge_m_(edge_m_of(box)), anchor_(index.map().anchor) {
  if (told != nullptr)
    *told = {view_fingerprint(index.map()), config.near_m, config.far_m, config.grazing_sin, box, {}, {}};
  PlaceIndexBuilder(index, config, nullptr, told, *this).add_all(box);
}

PlaceIndex::PlaceIndex(const ContourIndex& index, const PlaceTable& table)
    : edge_m_(edge_m_of(table.box)), anchor_(index.map().anchor) {
  VisibleSetConfig config;
  config.near_m = table.near_m;
  config.far_m = table.far_m;
  config.grazing_sin = table.grazing_sin;
  PlaceIndexBuilder(index, config, &table, nullptr, *this).add_all(table.box);
}

void PlaceIndexBuilder::add_all(const Eigen::AlignedBox3d& box) {
  if (box.isEmpty()) return;
  const double edge_m = out_.edge_m_;
  const Eigen::Vector3i counts = PlaceIndex::counts_of(box).cast<int>();
  const Eigen::Vector3d first = box.center() - 0.5 * edge_m * (counts.array() - 1).matrix().cast<double>();
  std::size_t place = 0;
  for (int x = 0; x < counts.x(); ++x)
    for (int y = 0; y < counts.y(); ++y)
      for (int z = 0; z < counts.z(); ++z) add_place(first + edge_m * Eigen::Vector3d(x, y, z), place++);
}

void PlaceIndexBuilder::draw_surfaces(const Eigen::Vector3d& middle) {
  const ContourMap& map = index_.map();
  for (int s = 0; s < 6; ++s) {
    const Eigen::Matrix3d R = side(s);
    DepthBuffer& depth = depth_[static_cast<std::size_t>(s)];
    depth.reset_view(map, {Eigen::Quaterniond(R), middle}, config_.near_m);
    for (const ContourIndex::Occluders& block : index_.occluders()) {
      const Eigen::Vector3d centre = R.transpose() * (map.anchor + block.centre.cast<double>() - middle);
      const double reach = std::max(std::abs(centre.x()), std::abs(centre.y())) - kTangent * centre.z();
      if (reach > 1.5 * block.radius || centre.z() < -block.radius) continue;
      depth.draw(map, std::span(index_.occluder_order()).subspan(block.begin, block.end - block.begin));
    }
  }
}

bool PlaceIndexBuilder::hidden(const Eigen::Vector3d& from_middle) const {
  const int s = side_of(from_middle);
  return depth_[static_cast<std::size_t>(s)].hides(side(s).transpose() * from_middle);
}

/// Points that are seen there if nothing hides them.
void PlaceIndexBuilder::list_candidates(const Eigen::Vector3d& middle) {
  const ContourMap& map = index_.map();
  candidates_.clear();
  cubes_.clear();
  index_.append_cubes_within(middle, config_.far_m, cubes_);
  for (const std::uint32_t c : cubes_) {
    const ContourIndex::Cube& cube = index_.cubes()[c];
    const double nearest =
        (map.anchor + cube.centre.cast<double>() - middle).norm() - static_cast<double>(cube.radius);
    const auto wanted = static_cast<float>(kSpacing_rad * std::max(nearest, kNearest_m));
    const std::uint32_t end = cube.end_for(wanted);
    // Points at that level lie this far apart.
    double spacing = static_cast<double>(ContourIndex::kCoarsest_m);
    while (spacing > wanted && spacing > 0.011) spacing /= 2;
    const double most_wanted = spacing / (kSpacing_rad * std::max(nearest, kNearest_m));
    for (std::uint32_t k = cube.begin; k < end; ++k) {
      const std::uint32_t number = index_.order()[k];
      if (chance(number) > most_wanted) continue;
      const Eigen::Vector3d ray = map.position(number) - middle;
      const double distance = ray.norm();
      if (distance < kNearest_m || distance > config_.far_m) continue;
      const double sine = map.points[number].tangent.cast<double>().cross(ray).norm() / distance;
      if (sine < config_.grazing_sin || chance(number) > spacing * sine / (kSpacing_rad * distance)) continue;
      candidates_.push_back({number, ray});
    }
  }
}

/// Which of the candidates are seen. What is known counts if it is of as many: which points are listed may
/// hang on the last bit of a distance.
void PlaceIndexBuilder::look(const Eigen::Vector3d& middle, std::size_t place) {
  const std::size_t count = candidates_.size();
  seen_.assign(count, 1);
  if (!occlusion_) return;
  if (known_ != nullptr) {
    const std::uint32_t looked_at = known_->looked_at[place];
    const std::uint8_t* bits = known_->seen.data() + known_bytes_;
    known_bytes_ += (std::size_t{looked_at} + 7) / 8;
    if (looked_at == count) {
      std::size_t i = 0;
      for_candidates_by_number([&](std::uint32_t number) {
        seen_of_[number] = bits[i / 8] >> (i % 8) & 1;
        ++i;
      });
      for (i = 0; i < count; ++i) seen_[i] = seen_of_[candidates_[i].number];
      return;
    }
  }
  draw_surfaces(middle);
  for (std::size_t i = 0; i < count; ++i) seen_[i] = hidden(candidates_[i].ray) ? 0 : 1;
}

/// In that order neighbours on a contour follow each other, and what is seen of them is told by few bytes.
template <class Do>
void PlaceIndexBuilder::for_candidates_by_number(const Do& act) {
  for (const Candidate& c : candidates_) listed_[c.number / 64] |= std::uint64_t{1} << (c.number % 64);
  for (std::size_t w = 0; w < listed_.size(); ++w)
    for (; listed_[w] != 0; listed_[w] &= listed_[w] - 1)
      act(static_cast<std::uint32_t>(64 * w + static_cast<std::size_t>(std::countr_zero(listed_[w]))));
}

void PlaceIndexBuilder::tell(std::size_t count) {
  if (told_ == nullptr || !occlusion_) return;
  if (count < kFewestPoints) return told_->looked_at.push_back(PlaceTable::kNoPlace);
  told_->looked_at.push_back(static_cast<std::uint32_t>(seen_.size()));
  for (std::size_t i = 0; i < seen_.size(); ++i) seen_of_[candidates_[i].number] = seen_[i];
  std::size_t i = 0;
  for_candidates_by_number([&](std::uint32_t number) {
    if (i % 8 == 0) told_->seen.push_back(0);
    told_->seen.back() |= static_cast<std::uint8_t>(seen_of_[number] << (i % 8));
    ++i;
  });
}

void PlaceIndexBuilder::add_place(const Eigen::Vector3d& middle, std::size_t place) {
  if (known_ != nullptr && occlusion_ && known_->looked_at[place] == PlaceTable::kNoPlace) return;
  const ContourMap& map = index_.map();
  list_candidates(middle);
  look(middle, place);
  const auto count = static_cast<std::size_t>(std::ranges::count(seen_, 1));
  tell(count);
  if (count < kFewestPoints) return;
  for (auto& seen : of_direction_) seen.clear();
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    if (seen_[i] == 0) continue;
    const auto& [number, ray] = candidates_[i];
    std::uint32_t& sample = sample_of_[number];
    if (sample == kNone) {
      sample = static_cast<std::uint32_t>(out_.samples_.size());
      out_.samples_.push_back({map.points[number].position, map.points[number].tangent});
    }
    of_direction_[static_cast<std::size_t>(direction_of(ray))].push_back(sample);
  }
  PlaceIndex::Place made{middle, {}};
  for (std::size_t k = 0; k < PlaceIndex::kDirections; ++k) {
    made.begins[k] = static_cast<std::uint32_t>(out_.points_.size());
    out_.points_.insert(out_.points_.end(), of_direction_[k].begin(), of_direction_[k].end());
  }
  made.begins[PlaceIndex::kDirections] = static_cast<std::uint32_t>(out_.points_.size());
  out_.places_.push_back(made);
}

std::vector<int> PlaceIndex::directions_around(const Eigen::Vector3d& axis, double angle_rad) {
  std::vector<int> out;
  for (int s = 0; s < 6; ++s)
    for (int i = 0; i < kSquares; ++i)
      for (int j = 0; j < kSquares; ++j) {
        const int along = s / 2;
        const auto corner = [&](double a, double b) {
          Eigen::Vector3d ray;
          ray[along] = s % 2 == 0 ? 1 : -1;
          ray[(along + 1) % 3] = 2 * (i + a) / kSquares - 1;
          ray[(along + 2) % 3] = 2 * (j + b) / kSquares - 1;
          return Eigen::Vector3d(ray.normalized());
        };
        const Eigen::Vector3d middle = corner(0.5, 0.5);
        double radius = 0;
        for (const double a : {0.0, 1.0})
          for (const double b : {0.0, 1.0}) radius = std::max(radius, std::acos(middle.dot(corner(a, b))));
        if (std::acos(std::clamp(middle.dot(axis), -1.0, 1.0)) < angle_rad + radius)
          out.push_back((s * kSquares + i) * kSquares + j);
      }
  return out;
}

}  // namespace evpose
