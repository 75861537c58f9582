#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/map.md: maps built from the shared clouds, and tracking with them.

    map_accuracy.py EVPOSE SHARED OUT.md     some minutes

Builds maps from the peer's clouds and from simulated LiDAR flights and holds them to the true contours; tracks the
recordings in the same worlds with the true contours and with the built maps; builds maps of the real clouds.
"""
import json
import pathlib
import resource
import subprocess
import sys
import tempfile

import h5py
import numpy as np

PEER = {"room": ["room_spiral", "room_hover", "room_people", "room_720p"], "courtyard": ["courtyard_landing"]}
LONG = ["room_people", "room_720p"]  # one of the built map's two rows is enough
SIMULATED, SIMULATED_S = ["indoor_spiral", "outdoor_spiral"], 0.5
# Clouds of one place are told where it was: their own frame's origin.
REAL = {"hall_lidar_4cm": [], "campus_building_livox": ["--viewpoint", "0,0,0", "--set", "noise=0.015"],
        "street_lidar_scan": ["--viewpoint", "0,0,0"], "room_laser_scan": [], "office_rgbd": ["--viewpoint", "0,0,0"]}


def run(*words):
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True)
    if done.returncode not in (0, 1):
        sys.exit(done.stderr)
    return done.stdout


def track(evpose, recording, contours, scratch, *extra):
    run(evpose, "-q", "track", recording, "--map", contours, "-o", scratch / "run", *extra)
    summary = json.loads((scratch / "run/summary.json").read_text())
    a = summary["accuracy"]
    return (f"{summary['status']} | {summary['coverage']:.3f} | {a['ate_mean_mm']:.2f} | {a['ate_p95_mm']:.2f} | "
            f"{a['are_mean_deg']:.3f} | {a['nees6_mean']:.2f}")


def scene_of(name, cloud, contours, mesh, recordings):
    return {"name": name, "cloud": cloud, "contours": contours, "mesh": mesh, "recordings": recordings}


def peer_scenes(shared):
    maps = shared / "data/peer/maps"
    return [scene_of(name, maps / f"{name}_map_raw.ply", maps / f"{name}_contours.ply", maps / f"{name}_mesh.ply",
                     [shared / "data/peer" / recording for recording in recordings])
            for name, recordings in PEER.items()]


def simulated_scenes(evpose, scratch):
    scenes = []
    for name in SIMULATED:
        folder = scratch / name
        run(evpose, "-q", "simulate", name, "-o", folder, "--duration", SIMULATED_S, "--set", "lidar.on=true",
            "--set", "camera.size=vga")
        scenes.append(scene_of(f"{name} (simulated)", folder / "map_raw.ply", folder / "contours.ply",
                               folder / "mesh.ply", [folder]))
    return scenes


def ten_largest(path):
    """Points in the ten largest planes, and in the ten largest groups within 3 degrees and 10 cm: parts of one wall."""
    with h5py.File(path) as file:
        count, normal, d = (file[f"planes/{name}"][:].astype(float) for name in ("inliers", "normal", "d"))
    grouped, left = 0, count.copy()
    for _ in range(10):
        groups = []
        for k in np.argsort(-left)[:60]:
            cosine = normal @ normal[k]
            of_it = (np.abs(cosine) > np.cos(np.radians(3))) & (np.abs(d * np.sign(cosine) - d[k]) < 0.1)
            groups.append((left[of_it].sum(), of_it))
        most, of_it = max(groups, key=lambda group: group[0])
        grouped += most
        left[of_it] = 0
    return np.sort(count)[-10:].sum(), grouped


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    evpose, shared, out = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    lines = ["Made by `scripts/map_accuracy.py`; do not edit.", ""]
    tracking = ["### Tracking", "",
                "| recording | map | status | coverage | ATE mean mm | p95 mm | ARE mean deg | NEES/6 |",
                "|---|---|---|---|---|---|---|---|"]
    with tempfile.TemporaryDirectory() as name:
        scratch = pathlib.Path(name)
        for scene in peer_scenes(shared) + simulated_scenes(evpose, scratch):
            built = scratch / "built.h5"
            figures = run(evpose, "map", "build", scene["cloud"], "-o", built)
            score = run(evpose, "-q", "map", "compare", built, scene["contours"], "--cloud", scene["cloud"],
                        "--flown", scene["recordings"][0] / "groundtruth.tum")
            lines += [f"### {scene['name']}: cloud to map", "", "```", *figures.splitlines(), "", *score.splitlines(),
                      "```", ""]
            for folder in scene["recordings"]:
                occluders = ["--occluders", scene["mesh"]]
                variants = [("true", scene["contours"], occluders), ("built", built, []),
                            ("built, true occluders", built, occluders)]
                for kind, contours, more in variants[:2] if folder.name in LONG else variants:
                    tracking.append(f"| {folder.name} | {kind} | {track(evpose, folder, contours, scratch, *more)} |")
        lines += [*tracking, ""]
        for cloud, more in REAL.items():
            before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            figures = run(evpose, "-q", "map", "build", shared / f"data/real/clouds/{cloud}.ply", "-o",
                          scratch / "real.h5", *more)
            spent = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
            points = int(figures.split()[1].rstrip(","))
            largest, grouped = (100 * n / points for n in ten_largest(scratch / "real.h5"))
            lines += [f"### {cloud}", "", "```", *figures.splitlines(), f"processor  {spent:.1f} s",
                      f"ten planes {largest:.1f} % of the points; parts of one surface taken together {grouped:.1f} %",
                      "```", ""]
    out.write_text("\n".join(lines))


if __name__ == "__main__":
    main()
