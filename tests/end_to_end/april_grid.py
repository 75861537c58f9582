# SPDX-License-Identifier: BSD-3-Clause
"""A scene with an AprilGrid that hangs in a room, as `evpose map board --aprilgrid 4x3 --tag 0.26` has it."""
import pathlib

COLUMNS, ROWS, TAG_M, GAP_M = 4, 3, 0.26, 0.3 * 0.26
CELLS = 6  # of a tag's side, inside its black rim of one cell
# Family 36h11, tags 0 to 11: cells from the upper left, row by row; 1 is white.
TAGS = [0xD5D628584, 0xD97F18B49, 0xDD280910E, 0xE479E9C98, 0xEBCBCA822, 0xF31DAB3AC,
        0x056A5D085, 0x10652E1D4, 0x22B1DFEAD, 0x265AD0472, 0x34FE91B86, 0x3FF962CD5]

SCENE = """
free_space: {low: [-1.2, -0.8, 0.8], high: [1.2, 0.8, 1.8]}
lights:
  - {name: lamp, kind: lamp, at: [-0.6, 0.2, 2.6], candela: 700, radius_m: 0.15}
  - {name: all around, kind: ambient, lux: 150}
materials:
  - {name: white, reflectance: 0.8}
  - {name: black, reflectance: 0.06}
objects:
  - {name: floor, quad: {corner: [-3, -2.5, 0], u: [6, 0, 0], v: [0, 5, 0]}, material: white}
  - {name: ahead, quad: {corner: [-3, 1.501, 0], u: [6, 0, 0], v: [0, 0, 2.8]}, material: white}
  - {name: ink, at: [0, 1.5, 1.3], mesh: {file: ink.obj}, material: black}
"""


def dark_squares():
    """Lower left corner and side of each, in the plane of the board around its middle, metres."""
    step = TAG_M + GAP_M
    left, low = (-0.5 * (step * count - GAP_M) for count in (COLUMNS, ROWS))
    cell = TAG_M / (CELLS + 2)
    for row in range(ROWS + 1):
        for column in range(COLUMNS + 1):
            x, z = left + step * column, low + step * row
            yield x - GAP_M, z - GAP_M, GAP_M
            if row == ROWS or column == COLUMNS:
                continue
            tag = TAGS[COLUMNS * row + column]
            for i in range(CELLS + 2):
                for k in range(CELLS + 2):
                    inside = 1 <= i <= CELLS and 1 <= k <= CELLS
                    bit = CELLS * CELLS - 1 - (CELLS * (CELLS - k) + i - 1)
                    if not (inside and tag >> bit & 1):
                        yield x + cell * i, z + cell * k, cell


def write_scene(folder):
    """The scene's file, beside the mesh of what is printed."""
    folder = pathlib.Path(folder)
    lines, count = [], 0
    for x, z, side in dark_squares():
        for u, v in ((0, 0), (side, 0), (side, side), (0, side)):
            lines.append(f"v {x + u:.6f} 0 {z + v:.6f}")
        lines.append("f " + " ".join(str(count + i) for i in (1, 2, 3, 4)))
        count += 4
    (folder / "ink.obj").write_text("\n".join(lines) + "\n")
    (folder / "scene.yaml").write_text(SCENE)
    return folder / "scene.yaml"
