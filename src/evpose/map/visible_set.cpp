// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map/visible_set.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "evpose/core/config.h"
#include "evpose/core/error.h"

namespace evpose {
namespace {

constexpr double kInTime = 0.9;            // of the way to a refresh, the next choice shall be there
constexpr double kWhileUsed = 0.6;         // of the way to a refresh, the next choice may take
constexpr double kNearShare = 0.15;        // of the chosen points may move by more than is reckoned with
constexpr float kExamined = 0.4F;          // of the stride, in the image: spacing of the points examined
constexpr std::size_t kSlice = 500;        // points examined in a call, if there is time
constexpr std::size_t kMostUpdates = 100;  // that a choice may take
constexpr std::size_t kCellsAPoint = 200;  // filled in the time that a point takes
constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();
constexpr double kDepthCell_px = 2;  // of the occluders' depth buffer, in an image 640 wide
constexpr double kWidth_px = 640;
// Two points are on one contour of the image if their directions and offsets agree this well.
constexpr float kSameDirectionSin = 0.2F;
constexpr float kSameLine_px = 0.75F;

/// A fixed random order of the points: choosing by it spreads points without regard to their order in the
/// file.
std::uint32_t priority_of(std::uint32_t point) {
  std::uint32_t h = point * 0x9E3779B1u;
  h ^= h >> 15;
  h *= 0x85EBCA77u;
  return h ^ (h >> 13);
}

/// Tangents of the half angles of view, with some room for the margin; at most 75 deg.
Eigen::Vector2d half_view(const Camera& camera) {
  Eigen::Vector2d widest(0.1, 0.1);
  const ImageSize size = camera.size();
  for (double u : {0.0, 0.5, 1.0})
    for (double v : {0.0, 0.5, 1.0}) {
      const auto ray = camera.unproject({u * (size.width - 1), v * (size.height - 1)});
      if (ray && ray->z() > 0.26) widest = widest.cwiseMax((ray->head<2>() / ray->z()).cwiseAbs());
    }
  return 1.05 * widest;
}

}  // namespace

void describe(ConfigTable& table, VisibleSetConfig& c) {
  table.add("far_m", c.far_m, "m", "points further away are left out", {0.1, 1e5});
  table.add("stride_px", c.stride_px, "px", "least distance of two points along one contour", {1, 1000});
  table.add("budget", c.budget, "", "most points in all", {6, 65535});
  table.add("occlusion", c.occlusion, "leave out points behind the map's occluders, if it has any");
}

VisibleSet::VisibleSet(const ContourIndex& index, const Camera& camera, const VisibleSetConfig& config,
                       bool background)
    : index_(index),
      camera_(camera),
      config_(config),
      background_(background),
      depth_(half_view(camera), kDepthCell_px * camera.size().width / kWidth_px / camera.focal_px()) {
  config_.margin_px *= camera.size().width / kWidth_px;
  config_.refresh_px *= camera.size().width / kWidth_px;
  // Widest angle of a ray through the image's border, plus the margin.
  double widest = 0;
  const ImageSize size = camera.size();
  for (int i = 0; i <= 16; ++i) {
    const double x = (size.width - 1) * i / 16.0, y = (size.height - 1) * i / 16.0;
    for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(x, 0), Eigen::Vector2d(x, size.height - 1),
                                         Eigen::Vector2d(0, y), Eigen::Vector2d(size.width - 1, y)}) {
      const auto ray = camera.unproject(pixel);
      widest = std::max(widest, ray ? std::acos(std::clamp(ray->z(), -1.0, 1.0)) : camera.valid_angle());
    }
  }
  widest = std::min(widest + config_.margin_px / camera.focal_px(), camera.valid_angle());
  cone_cos_ = static_cast<float>(std::cos(widest));
  cone_sin_ = static_cast<float>(std::sin(widest));
  columns_ = static_cast<int>((size.width + 2 * config_.margin_px) / config.stride_px) + 4;
  rows_ = static_cast<int>((size.height + 2 * config_.margin_px) / config.stride_px) + 4;
  cells_.resize(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
}

void VisibleSet::renumber(std::span<const std::uint32_t> number_now) {
  EVPOSE_CHECK(!choosing());
  if (job_.valid()) job_.get();
  for (std::uint32_t& point : points_) point = number_now[point];
  std::erase(points_, kGone);
}

double VisibleSet::moved_px(const Pose& from, const Pose& to) const {
  const Vector6d d = to.minus(from);
  return (d.tail<3>().norm() + d.head<3>().norm() / std::max(near_m_, config_.near_m)) * camera_.focal_px();
}

const std::vector<std::uint32_t>& VisibleSet::choose(const Pose& T_map_cam) {
  const double moved = chosen_once_ ? moved_px(T_map_cam_, T_map_cam) : 2 * config_.refresh_px + 1;
  const Pose before = last_.value_or(T_map_cam);
  last_ = T_map_cam;
  if (moved > config_.refresh_px) {
    // Too late to take one's time, unless what is under way is of this place.
    if (calls_left_ == 0 || moved_px(next_T_map_cam_, T_map_cam) > 0.5 * config_.refresh_px)
      begin_choice(T_map_cam, 1);
    complete_choice();
  } else if (calls_left_ > 0) {
    if (--calls_left_ == 0)
      complete_choice();
    else if (!job_.valid())
      examine(remaining_ / static_cast<std::size_t>(calls_left_ + 1));
  } else if (const double step = moved_px(before, T_map_cam);
             moved + updates_for_choice(step) * step > kInTime * config_.refresh_px) {
    // For where it will be half-way until it is taken: as near if the motion ends as if it goes on.
    const int updates = updates_for_choice(step);
    begin_choice(T_map_cam.plus(0.5 * updates * T_map_cam.minus(before)), updates);
    if (background_) job_ = std::async(std::launch::async, [this] { examine(kAll); });
  }
  return points_;
}

/// As many as make a call's part small, if there is time for it.
int VisibleSet::updates_for_choice(double step_px) const {
  const auto wanted = static_cast<double>(std::min(effort_ / kSlice + 1, kMostUpdates));
  const double in_time = step_px > 0 ? kWhileUsed * config_.refresh_px / step_px : wanted;
  return std::max(config_.updates, static_cast<int>(std::min(wanted, in_time)));
}

void VisibleSet::begin_choice(const Pose& T_map_cam, int updates) {
  if (job_.valid()) job_.get();
  list_candidates(T_map_cam);
  calls_left_ = updates;
}

void VisibleSet::complete_choice() {
  if (job_.valid())
    job_.get();
  else
    examine(kAll);
  calls_left_ = 0;
  points_.swap(next_points_);
  T_map_cam_ = next_T_map_cam_;
  near_m_ = next_near_m_;
  chosen_once_ = true;
}

bool VisibleSet::outside_cone(const Eigen::Vector3f& centre, float radius) const {
  // Distance of the sphere's centre from the cone's surface, positive outside.
  return std::sqrt(centre.x() * centre.x() + centre.y() * centre.y()) * cone_cos_ - centre.z() * cone_sin_ >
         radius;
}

void VisibleSet::list_candidates(const Pose& T_map_cam) {
  next_T_map_cam_ = T_map_cam;
  next_points_.clear();
  chosen_.clear();
  finished_ = false;
  std::fill(cells_.begin(), cells_.end(), -1);
  const ContourMap& map = index_.map();
  const Pose T_cam_map = T_map_cam.inverse();
  R_cam_map_ = T_cam_map.rotation().cast<float>();
  offset_ = (T_cam_map * map.anchor).cast<float>();
  const auto far_m = static_cast<float>(config_.far_m);

  occluders_.clear();
  occluders_done_ = cubes_done_ = remaining_ = 0;
  if (config_.occlusion && !index_.occluders().empty()) {
    depth_.reset_view(map, T_map_cam, config_.near_m);
    for (std::uint32_t i = 0; i < index_.occluders().size(); ++i) {
      const auto& block = index_.occluders()[i];
      const Eigen::Vector3f centre = R_cam_map_ * block.centre + offset_;
      if (outside_cone(centre, block.radius) || centre.norm() > far_m + block.radius) continue;
      occluders_.push_back(i);
      remaining_ += block.end - block.begin;
    }
  }
  cubes_.clear();
  index_.append_cubes_within(T_map_cam.p, config_.far_m, cubes_);
  std::erase_if(cubes_, [&](std::uint32_t i) {
    const auto& cube = index_.cubes()[i];
    return outside_cone(R_cam_map_ * cube.centre + offset_, cube.radius);
  });
  for (const std::uint32_t i : cubes_)
    remaining_ += end_of_examined(index_.cubes()[i]) - index_.cubes()[i].begin;
  remaining_ = std::max(remaining_, effort_);
  effort_ = 0;
}

/// Of a cube no more points are examined than its distance asks for.
std::uint32_t VisibleSet::end_of_examined(const ContourIndex::Cube& cube) const {
  const float distance = (R_cam_map_ * cube.centre + offset_).norm() - cube.radius;
  return cube.end_for(kExamined * static_cast<float>(config_.stride_px / camera_.focal_px()) *
                      std::max(distance, static_cast<float>(config_.near_m)));
}

void VisibleSet::examine(std::size_t most) {
  std::size_t done = 0;
  while (done < most && occluders_done_ < occluders_.size()) {
    const auto& block = index_.occluders()[occluders_[occluders_done_++]];
    done += depth_.draw(index_.map(),
                        std::span(index_.occluder_order()).subspan(block.begin, block.end - block.begin)) /
            kCellsAPoint;
    done += block.end - block.begin;
  }
  while (done < most && cubes_done_ < cubes_.size()) {
    const auto& cube = index_.cubes()[cubes_[cubes_done_++]];
    const std::uint32_t end = end_of_examined(cube);
    for (std::uint32_t k = cube.begin; k < end; ++k) keep_if_visible(index_.order()[k]);
    done += end - cube.begin;
  }
  remaining_ -= std::min(remaining_, done);
  effort_ += done;
  if (occluders_done_ == occluders_.size() && cubes_done_ == cubes_.size() && !finished_) keep_to_budget();
}

std::size_t VisibleSet::cell_of(const Eigen::Vector2f& pixel) const {
  const int column = static_cast<int>((pixel.x() + config_.margin_px) / config_.stride_px) + 1;
  const int row = static_cast<int>((pixel.y() + config_.margin_px) / config_.stride_px) + 1;
  return static_cast<std::size_t>(row * columns_ + column);
}

/// True if a chosen point of the same contour, which is at u along t, is nearer than the stride.
bool VisibleSet::has_chosen_neighbour(const Eigen::Vector2f& u, const Eigen::Vector2f& t) const {
  const auto stride = static_cast<float>(config_.stride_px);
  const auto middle = static_cast<std::ptrdiff_t>(cell_of(u));
  for (int row = -1; row <= 1; ++row)
    for (int column = -1; column <= 1; ++column) {
      std::int32_t k = cells_[static_cast<std::size_t>(middle + row * columns_ + column)];
      while (k >= 0) {
        const Chosen& other = chosen_[static_cast<std::size_t>(k)];
        const Eigen::Vector2f d = u - other.pixel;
        if (d.squaredNorm() < stride * stride && std::abs(t.x() * d.y() - t.y() * d.x()) < kSameLine_px &&
            std::abs(t.x() * other.direction.y() - t.y() * other.direction.x()) < kSameDirectionSin)
          return true;
        k = other.next;
      }
    }
  return false;
}

void VisibleSet::keep_if_visible(std::uint32_t number) {
  const ContourPoint& point = index_.map().points[number];
  const Eigen::Vector3f near_by = R_cam_map_ * point.position + offset_;
  const auto far_m = static_cast<float>(config_.far_m);
  if (near_by.z() < static_cast<float>(config_.near_m) || near_by.squaredNorm() > far_m * far_m ||
      outside_cone(near_by, 0))
    return;
  const Eigen::Vector3d x = near_by.cast<double>();
  Matrix23d jacobian;
  const auto pixel = camera_.project(x, &jacobian);
  if (!pixel || !camera_.size().contains(*pixel, -config_.margin_px)) return;
  const Eigen::Vector3d tangent = (R_cam_map_ * point.tangent).cast<double>();
  const Eigen::Vector2d along = jacobian * tangent;
  if (!(along.squaredNorm() > 0)) return;
  const Eigen::Vector2f u = pixel->cast<float>(), direction = along.normalized().cast<float>();
  if (has_chosen_neighbour(u, direction)) return;
  if (tangent.cross(x).squaredNorm() < config_.grazing_sin * config_.grazing_sin * x.squaredNorm()) return;
  if (!occluders_.empty() && depth_.hides(x)) return;
  std::int32_t& head = cells_[cell_of(u)];
  chosen_.push_back({u, direction, head});
  head = static_cast<std::int32_t>(chosen_.size() - 1);
  next_points_.push_back(number);
}

/// Distance below which a share of the chosen points lie.
double VisibleSet::near_distance_m() {
  if (next_points_.empty()) return config_.far_m;
  distances_m_.clear();
  for (const std::uint32_t i : next_points_)
    distances_m_.push_back((index_.map().position(i) - next_T_map_cam_.p).norm());
  const auto at = distances_m_.begin() +
                  static_cast<std::ptrdiff_t>(kNearShare * static_cast<double>(distances_m_.size() - 1));
  std::nth_element(distances_m_.begin(), at, distances_m_.end());
  return *at;
}

void VisibleSet::keep_to_budget() {
  finished_ = true;
  if (next_points_.size() > static_cast<std::size_t>(config_.budget)) {
    const auto middle = next_points_.begin() + config_.budget;
    std::nth_element(next_points_.begin(), middle, next_points_.end(),
                     [this](std::uint32_t a, std::uint32_t b) {
                       const ContourMap& map = index_.map();
                       return priority_of(map.number(a)) < priority_of(map.number(b));
                     });
    next_points_.erase(middle, next_points_.end());
    std::sort(next_points_.begin(), next_points_.end());
  }
  next_near_m_ = near_distance_m();
}

}  // namespace evpose
