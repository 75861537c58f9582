// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>

namespace evpose::sim {

/// Reflectance in [0, 1] at (u, v), metres; u runs along the face, v up or away.
using Pattern = std::function<double(double u_m, double v_m)>;

/// What the faces of a room are covered with. `mean`: average reflectance of the plain material; `seed` picks
/// the marks. All have detail from a few millimetres to decimetres, none of it at the face's own edges.
Pattern bricks(double mean, std::uint64_t seed);
Pattern tiles(double mean, double tile_m, std::uint64_t seed);
Pattern planks(double mean, double plank_m, std::uint64_t seed);
Pattern plaster(double mean, std::uint64_t seed);
Pattern cloth(double mean, std::uint64_t seed);

/// Sheets of paper with headlines, pictures and lines of text, hung in a row over the `base`.
Pattern posters(Pattern base, double width_m, double height_m, std::uint64_t seed);
/// A printed carton: tape, a label with a bar code, a stencil.
Pattern carton(double mean, double width_m, double height_m, std::uint64_t seed);

}  // namespace evpose::sim
