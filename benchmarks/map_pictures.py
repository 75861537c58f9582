#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of maps for the docs: docs/images/map_*.png.

    map_pictures.py EVPOSE SHARED OUT_FOLDER [--shadows]     needs h5py and chromium

Builds the maps of the shared clouds of a hall, a facade and a room, and imports the edge cloud of a sofa; draws each
seen askew from above. Creases blue, boundaries red, axes of round bodies orange; the planes' polygons are light grey, darker
where several lie behind each other. Shadows, thin and grey, only if asked for: they are many, and nothing is aligned to them.
"""
import math
import pathlib
import subprocess
import sys
import tempfile

import h5py
import numpy as np

# Cloud, azimuth and elevation of the view in degrees, what is said of the cloud (as in map_accuracy.py).
VIEWS = {"hall": ("hall_lidar_4cm", 25, 35, []),
         "facade": ("campus_building_livox", 60, 20, ["--viewpoint", "0,0,0", "--set", "noise=0.015"]),
         "room": ("room_laser_scan", 25, 45, []), "sofa": ("vector_sofa_semi_dense", 0, 0, [])}
WIDTH = 1000
COLOURS = {1: "#0b5cad", 2: "#d43a4f", 4: "#e08e0b", 5: "#9aa5a0"}
SHADOW = 5


def contours(path):
    """Ends of each contour and its kind; isolated points as short strokes."""
    with h5py.File(path) as file:
        points = file["points/xyz"][:].astype(float)
        tangent = file["points/tangent"][:].astype(float)
        start, count = file["contours/start"][:].astype(int), file["contours/count"][:].astype(int)
        length, kind = file["contours/length"][:], file["contours/kind"][:]
    half = 0.5 * (length / np.maximum(count, 1))[:, None]
    last = start + count - 1
    along = np.where((count > 1)[:, None], points[last] - points[start], tangent[start])
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-9)[:, None]
    return points[start] - half * along, points[last] + half * along, kind


def polygons(path):
    """Corners of each polygon of the planes; holes are left out."""
    with h5py.File(path) as file:
        if "polygons" not in file:
            return []
        corners = file["polygons/vertices"][:].astype(float)
        start, count = file["polygons/start"][:].astype(int), file["polygons/count"][:].astype(int)
        outer = file["polygons/hole_of"][:] < 0
    return [corners[s:s + n] for s, n, is_outer in zip(start, count, outer) if is_outer]


def projection(azimuth_deg, elevation_deg):
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    right = np.array([math.cos(a), math.sin(a), 0])
    up = np.array([-math.sin(a) * math.sin(e), math.cos(a) * math.sin(e), math.cos(e)])
    return np.stack([right, -up], axis=1)


def drawing(path, azimuth_deg, elevation_deg, with_shadows):
    begin, end, kind = contours(path)
    view = projection(azimuth_deg, elevation_deg)
    kept = with_shadows | (kind != SHADOW)
    a, b, kind = begin[kept] @ view, end[kept] @ view, kind[kept]
    low, high = np.quantile(np.concatenate([a, b]), [0.005, 0.995], axis=0)
    scale = (WIDTH - 20) / max(high[0] - low[0], 1e-6)
    height = int(min(20 + scale * (high[1] - low[1]), 1.2 * WIDTH))
    metre = 10 ** math.floor(math.log10(0.3 * (high[0] - low[0])))
    areas = "".join("<path d='M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in 10 + (ring @ view - low) * scale) + "Z'/>"
                    for ring in polygons(path))
    lines = "".join(f"<path d='M{p[0]:.1f} {p[1]:.1f}L{q[0]:.1f} {q[1]:.1f}' stroke='{COLOURS.get(k, '#444')}' "
                    f"stroke-width='{0.6 if k == SHADOW else 1.6}'/>"
                    for p, q, k in zip(10 + (a - low) * scale, 10 + (b - low) * scale, kind))
    return (f"<svg xmlns='http://www.w3.org/2000/svg' width='{WIDTH}' height='{height}'><rect width='100%' height='100%' "
            f"fill='#fff'/><g fill='#000' fill-opacity='0.06'>{areas}</g>{lines}<path d='M20 {height - 12}h{metre * scale:.1f}' "
            f"stroke='#000' stroke-width='3'/><text x='20' y='{height - 18}' font-family='sans-serif' "
            f"font-size='13'>{metre:g} m</text></svg>"), height


def main():
    if len(sys.argv) != 4 and sys.argv[4:] != ["--shadows"]:
        sys.exit(__doc__)
    evpose, shared, out = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    with tempfile.TemporaryDirectory() as name:
        scratch = pathlib.Path(name)
        for view, (cloud, azimuth_deg, elevation_deg, more) in VIEWS.items():
            source, built = shared / f"data/real/clouds/{cloud}.ply", scratch / "map.h5"
            words = ["import", source] if view == "sofa" else ["build", "--level", source, *more]
            subprocess.run([evpose, "-q", "map", *words, "-o", built], check=True, stdout=subprocess.DEVNULL)
            svg, height = drawing(built, azimuth_deg, elevation_deg, len(sys.argv) == 5)
            (scratch / "map.svg").write_text(svg)
            subprocess.run(["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
                            f"--window-size={WIDTH},{height}", f"--screenshot={out / f'map_{view}.png'}",
                            f"file://{scratch / 'map.svg'}"], check=True, capture_output=True)


if __name__ == "__main__":
    main()
