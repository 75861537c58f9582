# SPDX-License-Identifier: BSD-3-Clause
"""docs/images/map_*.png: maps of the shared clouds of a hall, a facade and a room, and of the edge cloud of a sofa.

Each is seen askew from above. Creases blue, boundaries red, axes of round bodies orange; the planes' polygons are light
grey, darker where several lie behind each other. Shadows are left out: they are many, and nothing is aligned to them.
map_learnt.png is a shared room after a flight has learnt it: what was moved blue, markings green, depth edges red, what was not told grey.
"""
import math
import shutil
import subprocess

import h5py
import numpy as np

import drawing
import harness
import learn
import learnt_edges
from changed_map import MARKING, Contours
from maps import REAL

# Cloud, azimuth and elevation of the view in degrees.
VIEWS = {"hall": ("hall_lidar_4cm", 25, 35), "facade": ("campus_building_livox", 60, 20), "room": ("room_laser_scan", 25, 45),
         "sofa": ("vector_sofa_semi_dense", 0, 0)}
WIDTH = 1000
COLOURS = {1: "#0b5cad", 2: "#d43a4f", 4: "#e08e0b", 5: "#9aa5a0"}  # by kind of contour
SHADOW = 5
LEARNT_VIEW = (25, 45)
MOVED, PRINTED, DEPTH, UNTOLD = "#0b5cad", "#2a9d4a", "#d43a4f", "#c3c9cc"


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


def learnt_colours(learnt, built):
    """Of each contour of the learnt map."""
    points = Contours(learnt)
    first = np.unique(points.contour, return_index=True)[1]
    told, printed = points.looks[first] > 0, points.kinds[first] == MARKING
    new = points.part(first).beside(Contours(built), learnt_edges.FAR_M) < 0
    return np.select([told & printed, told & new, told], [PRINTED, DEPTH, MOVED], UNTOLD)


def draw(path, azimuth_deg, elevation_deg, colours=None):
    """`colours`: of the contours; none: by their kinds."""
    begin, end, kind = contours(path)
    view = projection(azimuth_deg, elevation_deg)
    kept = kind != SHADOW
    if colours is None:
        colours = np.array([COLOURS.get(k, "#444") for k in kind])
    a, b, colours = begin[kept] @ view, end[kept] @ view, colours[kept]
    low, high = np.quantile(np.concatenate([a, b]), [0.005, 0.995], axis=0)
    scale = (WIDTH - 20) / max(high[0] - low[0], 1e-6)
    height = int(min(20 + scale * (high[1] - low[1]), 1.2 * WIDTH))
    metre = 10 ** math.floor(math.log10(0.3 * (high[0] - low[0])))
    svg = drawing.Svg(WIDTH, height)
    svg.raw("<g fill='#000' fill-opacity='0.06'>")
    for ring in polygons(path):
        svg.raw("<path d='M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in 10 + (ring @ view - low) * scale) + "Z'/>")
    svg.raw("</g>")
    for p, q, colour in zip(10 + (a - low) * scale, 10 + (b - low) * scale, colours):
        svg.raw(f"<path d='M{p[0]:.1f} {p[1]:.1f}L{q[0]:.1f} {q[1]:.1f}' stroke='{colour}' stroke-width='1.6'/>")
    svg.raw(f"<path d='M20 {height - 12}h{metre * scale:.1f}' stroke='#000' stroke-width='3'/>")
    svg.text(20, height - 18, f"{metre:g} m", size=13)
    return svg.content(), height


def picture(bench, scratch, name, drawn):
    svg, height = drawn
    (scratch / "map.svg").write_text(svg)
    subprocess.run(["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
                    f"--window-size={WIDTH},{height}", f"--screenshot={bench.image(f'map_{name}.png').resolve()}",
                    f"file://{(scratch / 'map.svg').resolve()}"], check=True, capture_output=True)


def make(bench):
    if not shutil.which("chromium"):
        raise harness.Failure("chromium is not installed: scripts/packages.sh test")
    for name, (cloud, azimuth_deg, elevation_deg) in list(VIEWS.items())[-1:] if bench.quick else VIEWS.items():
        source = bench.shared / f"data/real/clouds/{cloud}.ply"
        with bench.folder() as scratch:
            words = ["import", source] if name == "sofa" else ["build", "--level", source, *REAL[cloud]]
            bench.run("map", *words, "-o", scratch / "map.h5")
            picture(bench, scratch, name, draw(scratch / "map.h5", azimuth_deg, elevation_deg))
    with bench.folder() as scratch:
        flight, built = bench.peer(learn.LEARNS), scratch / "built.h5"
        bench.run("map", "build", learn.cloud_of(bench, flight), "-o", built)
        learnt, _ = learn.learn(bench, built, flight.folder, flight.truth, scratch)
        picture(bench, scratch, "learnt", draw(learnt, *LEARNT_VIEW, learnt_colours(learnt, built)))
    return bench.image("map_*.png")
