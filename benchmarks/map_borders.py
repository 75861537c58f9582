# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/map-borders.md: a flight along a corridor whose map is built in tiles and read by place.

The corridor's LiDAR cloud is set one behind the other, so that parts of the map come and go on the way, and built in tiles as
well as in one piece. The simulated flight passes the borders of tiles and the place where the next part of the map is taken
over. Steps are changes of the position's error from one update to the next.
"""
import re
import shutil
import sys

import numpy as np

import files
import harness
import tables

sys.path.insert(0, str(harness.ROOT / "tests/end_to_end"))
from corridor import corridor  # noqa: E402

LENGTH_M, SPEED_M_S, WAY_M = 70, 5, 55
COPIES = range(-2, 3)
PITCH_M = LENGTH_M + 5
TILE_POINTS = 100_000
NEAR_S = 0.2  # of a border
TAKEN_OVER_M = 40  # from where the map was read first; docs/use/map.md
SCENARIO = f"""
scene_file: scene.yaml
duration_s: {WAY_M / SPEED_M_S}
camera: {{size: custom, width: 320, height: 240, focal_px: 190}}
imu: {{rate_hz: 400}}
trajectory: {{kind: traverse, centre_x_m: {2 + WAY_M / 2}, centre_y_m: 0, centre_z_m: 1.5, size_forward_m: {WAY_M},
  size_left_m: 1, size_up_m: 0.5, speed_m_s: {SPEED_M_S}}}
lidar: {{on: true, flight: {{kind: traverse, duration_s: 30, centre_x_m: {LENGTH_M / 2}, centre_y_m: 0, centre_z_m: 1.5,
  size_forward_m: {LENGTH_M - 6}, size_left_m: 1, size_up_m: 0.5, speed_m_s: 4}}}}
"""


def simulated(bench):
    scene = corridor(LENGTH_M)
    folder = bench.scratch / "recordings" / f"corridor-{harness.digest(SCENARIO + scene)[:8]}"
    if not folder.exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        with bench.folder() as scratch:
            (scratch / "scene.yaml").write_text(scene)
            (scratch / "flight.yaml").write_text(SCENARIO)
            bench.run("simulate", scratch / "flight.yaml", "-o", folder)
    return folder


def built(bench, cloud, scratch):
    """The map of the tiles, that of one piece, and the cores of the tiles: low x, y, high x, y."""
    tiles, merged, one = scratch / "tiles", scratch / "merged.h5", scratch / "one.h5"
    bench.run("map", "build", cloud, "--plan", tiles, "--set", f"tile_points={TILE_POINTS}")
    plan = (tiles / "plan.yaml").read_text()
    anchor = np.array(numbers(re.search(r"anchor: \[(.*?)\]", plan)[1]))[:2]
    cores = np.array([numbers(row)[:4] for row in re.findall(r"^  - \[(.*)\]", plan, re.MULTILINE)])
    for tile in range(len(cores)):
        bench.run("map", "build", tiles, "--tile", tile)
    bench.run("map", "merge", tiles, "-o", merged)
    bench.run("map", "build", cloud, "-o", one, "--set", "tile_points=100000000")
    shutil.rmtree(tiles)
    return merged, one, cores + np.tile(anchor, 2)


def numbers(words):
    return [float(word) for word in words.split(",")]


def crossings(truth, cores):
    """Times at which the way passes from one tile to another."""
    places = truth[:, None, 1:3]
    inside = ((places >= cores[:, :2]) & (places < cores[:, 2:])).all(2).argmax(1)
    return truth[1:, 0][np.diff(inside) != 0]


def judged(run, truth, moments):
    """Errors and steps of the updates, near the moments and elsewhere."""
    rows = np.loadtxt(run / "trajectory.tum")
    rows = rows[rows[:, 0] > rows[0, 0] + harness.START_S]
    off = rows[:, 1:4] - np.stack([np.interp(rows[:, 0], truth[:, 0], truth[:, axis]) for axis in (1, 2, 3)], 1)
    error_mm = 1e3 * np.linalg.norm(off, axis=1)
    step_mm = 1e3 * np.linalg.norm(np.diff(off, axis=0, prepend=off[:1]), axis=1)
    near = (np.abs(rows[:, 0, None] - np.asarray(moments)[None]) < NEAR_S).any(1)
    return [figure for part in (near, ~near)
            for figure in (int(part.sum()), f"{error_mm[part].mean():.1f}", f"{step_mm[part].max():.2f}",
                           f"{np.percentile(step_mm[part], 99):.2f}")]


def measure(bench):
    recording = simulated(bench)
    with bench.folder() as scratch:
        points = files.Ply(recording / "map_raw.ply").points().astype("<f4")
        cloud = scratch / "cloud.ply"
        copies = (points + np.array([PITCH_M * k, 0, 0], "<f4") for k in COPIES)
        files.write_points(cloud, copies, len(points) * len(COPIES))
        merged, one, cores = built(bench, cloud, scratch)
        truth = np.loadtxt(recording / "groundtruth.tum")
        borders = crossings(truth, cores)
        away = np.linalg.norm(truth[:, 1:3] - truth[0, 1:3], axis=1)
        taken_over = truth[np.argmax(away > TAKEN_OVER_M), 0]
        runs = {"in tiles, read by place": (merged, []), "in tiles, read as a whole": (merged, ["--learn-map", scratch / "l.h5"]),
                "in one piece": (one, [])}
        rows, kept = [], {}
        for name, (contours, words) in runs.items():
            run = scratch / "run"
            summary = bench.track(recording, contours, run, "--init", "groundtruth", *words)
            kept[name] = (run / "trajectory.tum").read_bytes()
            rows.append([name, f"{100 * summary['tracking_share']:.0f}", f"{summary['resources']['peak_memory_mb']:.0f}",
                         *judged(run, truth, [*borders, taken_over])])
        by_place, whole, _ = kept.values()
        return {"points": len(points) * len(COPIES), "tiles": len(cores), "borders": [round(float(t), 2) for t in borders],
                "taken_over": round(float(taken_over), 2), "same": by_place == whole, "rows": rows}


def make(bench):
    m = bench.once("map-borders", lambda: measure(bench))
    table = tables.table(["map", "tracked %", "peak memory MB", f"updates within {NEAR_S} s of a border", "error mm",
                          "largest step mm", "99 % of steps mm", "updates elsewhere", "error mm", "largest step mm",
                          "99 % of steps mm"], m["rows"])
    said = [f"{m['points'] / 1e6:.1f} million points in {m['tiles']} tiles; {len(m['borders'])} borders are passed (at "
            f"{', '.join(map(str, m['borders']))} s), and the next part of the map is taken over at {m['taken_over']} s. Read by "
            f"place and as a whole the tiled map gives {'the same' if m['same'] else 'DIFFERENT'} poses, byte for byte.", ""]
    return bench.write_page("map-borders", {"borders": said + table}, harness.machine())
