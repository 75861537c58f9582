// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace evpose::sim {

/// Reflectance in [0, 1] at (u, v), metres; u runs along the face, v up or away.
using Pattern = std::function<double(double u_m, double v_m)>;

/// The period of a pattern in u and v; it repeats without a seam.
struct Repeat {
  double width_m = 4, height_m = 4;
};

// Procedural textures: 0.5 in the mean, with detail from millimetres to decimetres, irregular within a
// Repeat. `seed` selects the marks.

// Walls, floors, ceilings (patterns.cpp).
Pattern bricks(const Repeat& repeat, std::uint64_t seed);
Pattern tiles(const Repeat& repeat, double tile_m, std::uint64_t seed);
Pattern planks(const Repeat& repeat, double plank_m, std::uint64_t seed);
Pattern plaster(const Repeat& repeat, std::uint64_t seed);
Pattern wallpaper(const Repeat& repeat, std::uint64_t seed);
Pattern ceiling_panels(const Repeat& repeat, std::uint64_t seed);
Pattern marble(const Repeat& repeat, std::uint64_t seed);
Pattern carpet(const Repeat& repeat, std::uint64_t seed);
Pattern cloth(const Repeat& repeat, std::uint64_t seed);

// Out of doors (patterns_outdoor.cpp).
Pattern paving(const Repeat& repeat, std::uint64_t seed);
Pattern asphalt(const Repeat& repeat, std::uint64_t seed);
Pattern gravel(const Repeat& repeat, std::uint64_t seed);
Pattern grass(const Repeat& repeat, std::uint64_t seed);
Pattern concrete(const Repeat& repeat, std::uint64_t seed);
Pattern stucco(const Repeat& repeat, std::uint64_t seed);
Pattern graffiti(const Repeat& repeat, std::uint64_t seed);
/// Panes `pane_m` wide and high with what is behind them: curtains, plants, the dark of a room.
Pattern window_panes(const Repeat& repeat, double pane_m, std::uint64_t seed);

// Printed things (patterns_print.cpp).
/// A sheet of paper of the Repeat's size with headline, picture and lines of text.
Pattern poster(const Repeat& repeat, std::uint64_t seed);
/// Cartons: tape, labels with bar codes, stencilled words.
Pattern carton(const Repeat& repeat, std::uint64_t seed);
/// Backs of books side by side, each row `row_m` high.
Pattern book_spines(const Repeat& repeat, double row_m, std::uint64_t seed);
/// Lines of bright text on dark.
Pattern screen_text(const Repeat& repeat, std::uint64_t seed);
/// Painted sheet metal: ribs, big stencilled words, rust and scratches.
Pattern container_side(const Repeat& repeat, std::uint64_t seed);

/// The pattern with its contrasts (of the logarithm, about 0.5) times `factor`, kept within [0.02, 0.95].
Pattern with_contrast(Pattern pattern, double factor);

/// A pattern by the name of its function, with usual measures; none for an unknown name.
Pattern named_pattern(const std::string& name, const Repeat& repeat, std::uint64_t seed);
std::vector<std::string> pattern_names();

}  // namespace evpose::sim
