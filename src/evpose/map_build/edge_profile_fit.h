// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <span>

namespace evpose::map_build {

/// What a cut across an edge shows. The plane ends at `place` (+ slope times the way along the edge) and lies
/// at `height`. A second face may begin there and stand at right angles to it, over a `depth` on one `side`
/// of the plane; where it ends, another surface may go back under the plane or on beyond it. Densities are in
/// points per square metre of each surface.
struct EdgeProfileFit {
  double place = 0, slope = 0, height = 0, depth = 0;  ///< metres; slope per metre
  int side = 0;                                        ///< +1 over the plane, -1 under it, 0: no second face
  bool ends = false;                                   ///< the second face ends within the window, at `depth`
  double plane = 0, face = 0, under = 0, beyond = 0;
  double rest = 0;  ///< points per cubic metre that nothing explains
  double sigma_place = 0, sigma_height = 0, sigma_depth = 0;
  double across_m = 0, correlation = 0;  ///< blur of the points across the edge, and with their height
  double rest_share = 0;                 ///< of the points
  double log_likelihood = 0;
  double gain = 0;  ///< of log likelihood over a plane that ends without a second face
};

struct EdgeProfileWindow {
  double half_length, half_width, half_height;  ///< metres: along, across, over the plane
  double noise_m;                               ///< of a point, 1 sigma
  double height_noise_m;                        ///< of a point over this plane, 1 sigma
  double sigma_height_m;                        ///< to which the plane is known
};

/// As wide and high as the noise asks for; `rms_m` and `spacing_m` of the plane.
EdgeProfileWindow edge_profile_window(double half_length, double noise_m, double rms_m, double spacing_m);

/// Maximum likelihood for points (along, outwards, over the plane), those in the window: a Poisson process
/// whose surfaces are blurred by noise. Faces narrower than the noise mix their points with the plane's, and
/// push an edge that is fitted to these alone outwards by as much as the noise; here each point is shared
/// between the surfaces.
EdgeProfileFit fit_edge_profile(std::span<const Eigen::Vector3d> all, const EdgeProfileWindow& window);

}  // namespace evpose::map_build
