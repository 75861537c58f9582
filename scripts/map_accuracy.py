#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""docs/map-table.md: maps built from the shared clouds, and tracking with them.

    map_accuracy.py EVPOSE SHARED OUT.md     some minutes

Builds maps from the peer's clouds and holds them to the true contours; tracks the peer's recordings with the true
contours and with the built maps; builds maps of the real clouds.
"""
import json
import pathlib
import resource
import subprocess
import sys
import tempfile

SCENES = {"room": ["room_spiral", "room_hover"], "courtyard": ["courtyard_landing"]}
REAL = ["hall_lidar_4cm", "campus_building_livox", "street_lidar_scan", "room_laser_scan", "office_rgbd"]


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


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    evpose, shared, out = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    maps = shared / "data/peer/maps"
    lines = ["Made by `scripts/map_accuracy.py`; do not edit.", ""]
    with tempfile.TemporaryDirectory() as name:
        scratch = pathlib.Path(name)
        for scene in SCENES:
            cloud, built = maps / f"{scene}_map_raw.ply", scratch / f"{scene}.h5"
            figures = run(evpose, "map", "build", cloud, "-o", built)
            score = run(evpose, "-q", "map", "compare", built, maps / f"{scene}_contours.ply", "--cloud", cloud)
            lines += [f"### {scene}: cloud to map", "", "```", *figures.splitlines(), "", *score.splitlines(), "```", ""]
        lines += ["### Tracking", "", "| recording | map | status | coverage | ATE mean mm | p95 mm | ARE mean deg | NEES/6 |",
                  "|---|---|---|---|---|---|---|---|"]
        for scene, recording in ((scene, one) for scene, all_of_it in SCENES.items() for one in all_of_it):
            folder = shared / "data/peer" / recording
            true, mesh = maps / f"{scene}_contours.ply", maps / f"{scene}_mesh.ply"
            lines.append(f"| {recording} | true | {track(evpose, folder, true, scratch, '--occluders', mesh)} |")
            built = scratch / f"{scene}.h5"
            lines.append(f"| {recording} | built | {track(evpose, folder, built, scratch)} |")
            lines.append(f"| {recording} | built, true occluders | "
                         f"{track(evpose, folder, built, scratch, '--occluders', mesh)} |")
        lines.append("")
        for cloud in REAL:
            before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            figures = run(evpose, "-q", "map", "build", shared / f"data/real/clouds/{cloud}.ply", "-o", scratch / "real.h5")
            spent = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
            lines += [f"### {cloud}", "", "```", *figures.splitlines(), f"processor  {spent:.1f} s", "```", ""]
    out.write_text("\n".join(lines))


if __name__ == "__main__":
    main()
