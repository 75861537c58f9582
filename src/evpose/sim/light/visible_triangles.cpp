// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/visible_triangles.h"

#include <algorithm>
#include <limits>

#include "evpose/core/parallel.h"
#include "evpose/sim/light/triangle_shape.h"

namespace evpose::sim {
namespace {

/// What moves does so on a nearly straight line between the two views.
constexpr float kMargin_px = 2;
constexpr double kNear_m = 1e-3;
/// Depths change by less than this factor between the views.
constexpr float kDepthMargin = 1.05F;
constexpr std::size_t kChunk = 512;

}  // namespace

struct VisibleTriangles::Candidate {
  std::uint32_t triangle;
  int column0, column1, row0, row1;  // tiles, inclusive
  float nearest;                     // 1 / m, of its nearest corner; infinite where that is behind
  std::array<std::optional<TriangleShape>, 2> shape;  // in the two views
};

VisibleTriangles::VisibleTriangles(const PreparedScene& prepared, const std::vector<PixelRay>& rays,
                                   ImageSize size, std::vector<Tile> tiles)
    : prepared_(prepared), tiles_(std::move(tiles)), found_(tiles_.size()) {
  columns_ = (size.width + kTilePx - 1) / kTilePx;
  rows_ = (size.height + kTilePx - 1) / kTilePx;
  constexpr float kFar = std::numeric_limits<float>::infinity();
  column_range_.assign(static_cast<std::size_t>(columns_), {kFar, -kFar});
  row_range_.assign(static_cast<std::size_t>(rows_), {kFar, -kFar});
  for (std::size_t k = 0; k < tiles_.size(); ++k) {
    corners_.push_back(tiles_[k].corners(rays, size, kMargin_px));
    Range &x = column_range_[k % columns_], &y = row_range_[k / columns_];
    for (const Eigen::Vector3f& c : corners_.back()) {
      x = {std::min(x.low, c.x()), std::max(x.high, c.x())};
      y = {std::min(y.low, c.y()), std::max(y.high, c.y())};
    }
  }
}

// Triangles of a chunk with the tiles that the box around them meets.
void VisibleTriangles::collect(const SceneView& from, const SceneView& to, std::size_t begin, std::size_t end,
                               std::vector<Candidate>& out) const {
  const Mesh& mesh = prepared_.scene.mesh;
  for (std::size_t i = begin; i < end; ++i) {
    std::array<std::array<Eigen::Vector3d, 3>, 2> corners;
    Eigen::AlignedBox2f box;
    double least = std::numeric_limits<double>::infinity(), most = -least;
    for (int e = 0; e < 2; ++e) {
      const SceneView& view = e == 0 ? from : to;
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d p = view.R_map_cam.transpose() *
                                  (mesh.vertices[mesh.triangles[i][k]].cast<double>() - view.T_map_cam.p);
        corners[e][k] = p;
        least = std::min(least, p.z());
        most = std::max(most, p.z());
        if (p.z() > kNear_m) box.extend(Eigen::Vector2f((p.head<2>() / p.z()).cast<float>()));
      }
    }
    if (most <= 0) continue;
    const auto first = [](const std::vector<Range>& ranges, float low) {
      return std::find_if(ranges.begin(), ranges.end(), [&](const Range& r) { return r.high >= low; }) -
             ranges.begin();
    };
    const auto last = [](const std::vector<Range>& ranges, float high) {
      return ranges.rend() -
             std::find_if(ranges.rbegin(), ranges.rend(), [&](const Range& r) { return r.low <= high; }) - 1;
    };
    Candidate c{static_cast<std::uint32_t>(i),          0, columns_ - 1, 0, rows_ - 1,
                std::numeric_limits<float>::infinity(), {}};
    if (least > kNear_m) {
      c.column0 = static_cast<int>(first(column_range_, box.min().x()));
      c.column1 = static_cast<int>(last(column_range_, box.max().x()));
      c.row0 = static_cast<int>(first(row_range_, box.min().y()));
      c.row1 = static_cast<int>(last(row_range_, box.max().y()));
      c.nearest = static_cast<float>(1 / least);
      if (c.column0 > c.column1 || c.row0 > c.row1) continue;
    }
    const Patch& patch = prepared_.still.patches[prepared_.still.patch_of[i]];
    for (int e = 0; e < 2; ++e) {
      const SceneView& view = e == 0 ? from : to;
      c.shape[e] = triangle_shape(corners[e], view.R_map_cam.transpose() * patch.normal,
                                  -(patch.normal.dot(view.T_map_cam.p) + patch.offset));
    }
    out.push_back(c);
  }
}

void VisibleTriangles::fill_row(const std::vector<std::vector<Candidate>>& candidates, int row) {
  std::vector<std::vector<Placed>> placed(static_cast<std::size_t>(columns_));
  std::vector<float> covered(placed.size(), 0);
  for (const auto& chunk : candidates) {
    for (const Candidate& c : chunk) {
      if (row < c.row0 || row > c.row1) continue;
      for (int column = c.column0; column <= c.column1; ++column) {
        const auto& corners = corners_[static_cast<std::size_t>(row) * columns_ + column];
        std::array<int, 3> outside{};  // of eight corners, by side
        float least = std::numeric_limits<float>::infinity(), most = 0;
        int inside = 0;
        for (const auto& shape : c.shape) {
          if (!shape) continue;
          for (const Eigen::Vector3f& corner : corners) {
            bool in = true;
            for (int k = 0; k < 3; ++k) {
              const bool out = shape->side[k].dot(corner) < 0;
              outside[k] += out;
              in = in && !out;
            }
            inside += in;
            const float nearness = shape->nearness.dot(corner);
            least = std::min(least, nearness);
            most = std::max(most, nearness);
          }
        }
        const int seen = 4 * (c.shape[0].has_value() + c.shape[1].has_value());
        const bool known = seen == 8;  // else the plane of the triangle passes the camera
        if (known && (outside[0] == seen || outside[1] == seen || outside[2] == seen)) continue;
        if (known && inside == seen && least > 0) covered[column] = std::max(covered[column], least);
        if (known && !(most > 0)) continue;
        placed[column].push_back({c.triangle, known ? std::min(most, c.nearest) : c.nearest});
      }
    }
  }
  for (int column = 0; column < columns_; ++column) {
    auto& list = placed[column];
    std::erase_if(list, [&](const Placed& p) { return p.nearness * kDepthMargin < covered[column]; });
    std::sort(list.begin(), list.end(), [](const Placed& a, const Placed& b) {
      return a.nearness != b.nearness ? a.nearness > b.nearness : a.triangle < b.triangle;
    });
    const std::size_t tile = static_cast<std::size_t>(row) * columns_ + column;
    found_[tile].clear();
    for (const Placed& p : list) found_[tile].push_back(p.triangle);
  }
}

void VisibleTriangles::find(const SceneView& from, const SceneView& to, ThreadPool& pool) {
  const std::size_t triangles = prepared_.scene.mesh.triangles.size();
  std::vector<std::vector<Candidate>> candidates(ThreadPool::chunks(triangles, kChunk));
  pool.for_chunks(triangles, kChunk, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    collect(from, to, begin, end, candidates[chunk]);
  });
  pool.for_chunks(static_cast<std::size_t>(rows_), 1, [&](std::size_t, std::size_t row, std::size_t) {
    fill_row(candidates, static_cast<int>(row));
  });
}

}  // namespace evpose::sim
