# SPDX-License-Identifier: BSD-3-Clause
"""A scene that is long and quick to simulate: for flights through a map in tiles."""
import numpy as np


def corridor(length_m):
    """A scene: boxes along both walls of a corridor, none like another."""
    random = np.random.default_rng(7)
    objects = [f"{{name: floor, quad: {{corner: [0, -2, 0], u: [{length_m}, 0, 0], v: [0, 4, 0]}}, material: boards}}",
               f"{{name: left, quad: {{corner: [0, 2, 0], u: [{length_m}, 0, 0], v: [0, 0, 3]}}, material: plaster}}",
               f"{{name: right, quad: {{corner: [{length_m}, -2, 0], u: [-{length_m}, 0, 0], v: [0, 0, 3]}}, material: plaster}}",
               f"{{name: ahead, quad: {{corner: [{length_m}, -2, 0], u: [0, 0, 3], v: [0, 4, 0]}}, material: plaster}}"]
    for k in range(2 * length_m // 3):
        size, side = random.uniform([0.4, 0.4, 0.5], [0.8, 0.7, 2.5]), 1 if k % 2 else -1
        objects.append(f"{{name: box {k}, at: [{1 + 1.5 * k}, {1.4 * side}, 0], yaw_deg: {random.uniform(-20, 20):.1f}, "
                       f"box: {{size: [{size[0]:.2f}, {size[1]:.2f}, {size[2]:.2f}]}}, material: {['grey', 'white'][k % 3 > 0]}}}")
    return "\n".join([f"free_space: {{low: [0.2, -1, 0.7], high: [{length_m - 1}, 1, 2.2]}}",
                      "lights: [{name: all around, kind: ambient, lux: 400}]",
                      "materials:",
                      "  - {name: plaster, pattern: plaster, tone: 1.1, size_m: [4, 3], texel_m: 0.01}",
                      "  - {name: boards, pattern: planks, tone: 0.8, size_m: [4, 3], texel_m: 0.01}",
                      "  - {name: white, reflectance: 0.8}", "  - {name: grey, reflectance: 0.25}",
                      "objects:", *(f"  - {one}" for one in objects)]) + "\n"
