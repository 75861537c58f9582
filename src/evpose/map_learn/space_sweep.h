// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

namespace evpose::map_learn {

/// A straight edge where viewing rays meet, in the frame of the reference view (z ahead), metres.
struct SweptLine {
  Eigen::Vector3d a, b;            ///< its ends
  double inverse_depth_sigma = 0;  ///< 1/m
  double significance = 0;         ///< as of RidgeLine
};

/// Space sweep (EMVS: Rebecq et al., IJCV 2018): the volume in front of a reference view in slices of equal
/// inverse depth. The viewing ray of each event goes through one cell of each slice; where an edge is, the
/// rays of all its events meet, whatever they were seen from.
class SpaceSweep {
 public:
  struct View {
    Eigen::Vector2d tangents;  ///< half the width and height of what the reference view sees, at depth 1
    double focal_cells = 1;    ///< cells per unit of tangent
    double nearest_m = 1, farthest_m = 2;
    int slices = 2;
  };
  explicit SpaceSweep(const View& view);

  /// One event: from where and in which direction it was seen, reference frame; ray.z() > 0.
  void add(const Eigen::Vector3d& centre, const Eigen::Vector3d& ray);
  /// Edges whose depth the rays tell, the most significant first: where they run along the camera's motion
  /// they tell none. Ends the sweep: the counts are blurred in place.
  std::vector<SweptLine> take_lines();

 private:
  float& cell(int slice, int x, int y) { return counts_[index(slice, x, y)]; }
  float cell(int slice, int x, int y) const { return counts_[index(slice, x, y)]; }
  std::size_t index(int slice, int x, int y) const {
    return (static_cast<std::size_t>(slice) * static_cast<std::size_t>(height_) +
            static_cast<std::size_t>(y)) *
               static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }
  void blur();

  View view_;
  int width_, height_;
  double inverse_farthest_, inverse_step_;  ///< 1/m
  std::vector<float> counts_;               ///< slice by slice, row by row
};

}  // namespace evpose::map_learn
