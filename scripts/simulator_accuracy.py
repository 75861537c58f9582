#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The tables of docs/results/simulator.md: scenarios of `evpose simulate`, tracked with the shipped defaults.

    simulator_accuracy.py EVPOSE RECORDINGS OUT.md [--seconds 2] [--only NAME...]

Makes the recordings that RECORDINGS does not hold yet (half a minute of two cores per second of 640x480, two minutes
at 1280x720, 20 MB a second and more; half an hour for the hover of half a minute), tracks each from ground truth without alignment, and scores what comes after
the first 0.3 s. Maps with errors are the true contours whose 12 cm pieces are moved across their direction. Needs numpy.
"""
import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

PIECE_M = 0.12
SPEEDS = ["speed_1", "speed_2", "speed_3", "turning_1", "turning_2", "turning_3", "aggressive", "slow", "hover"]
HARD = ["hdr_window", "hdr_lights_off", "hdr_flicker", "fan", "people", "car"]
PLAIN = ["indoor_spiral", "outdoor_spiral", "landing"]
LARGE = ["camera.size=720p"]
SMALL = ["camera.size=vga"]
TINY = ["camera.size=custom", "camera.width=320", "camera.height=240", "camera.focal_px=190"]
HOVER_S = 30


def simulate(evpose, folder, scenario, settings, seconds):
    if folder.exists():
        return
    command = [evpose, "-q", "simulate", scenario, "-o", folder, "--duration", str(seconds)]
    for s in settings:
        command += ["--set", s]
    subprocess.run([str(c) for c in command], check=True)


def track(evpose, folder, contours, extra):
    """Figures of `evpose eval` after 0.3 s, with status and NEES/6 of the run."""
    with tempfile.TemporaryDirectory() as scratch:
        run = pathlib.Path(scratch) / "run"
        command = [evpose, "-q", "track", folder, "--map", contours, "--occluders", folder / "mesh.ply", "-o", run, *extra]
        done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
        if done.returncode == 2:
            sys.exit(done.stderr)
        summary = json.loads((run / "summary.json").read_text())
        if not (run / "trajectory.tum").read_text().strip():
            return summary, None
        score = subprocess.run([evpose, "eval", str(run / "trajectory.tum"), str(folder / "groundtruth.tum"), "--from", "0.3",
                                "--json"], capture_output=True, text=True)
    if score.returncode != 0:
        return summary, None
    later = json.loads(score.stdout)
    return summary, later.get("accuracy", later)


def row(name, summary, later):
    a = summary.get("accuracy", {})
    if later is None:
        return f"| {name} | {summary['status']} | {summary['coverage']:.2f} | - | - | - | - |"
    return (f"| {name} | {summary['status']} | {summary['coverage']:.2f} | {later['ate_mean_mm']:.2f} | "
            f"{later['ate_max_mm']:.1f} | {later['are_mean_deg']:.3f} | {a.get('nees6_mean', float('nan')):.2f} |")


def moved_pieces(source, target, sigma_m):
    """Writes the contours with each 12 cm piece of a contour moved at random across its direction."""
    data = source.read_bytes()
    body = data.index(b"end_header\n") + len(b"end_header\n")
    words = [line.split() for line in data[:body].decode().splitlines()]
    names = {"double": "<f8", "float": "<f4", "int": "<i4", "uchar": "u1", "char": "i1"}
    points = np.frombuffer(data, [(w[2], names[w[1]]) for w in words if w[0] == "property"], offset=body).copy()
    position = np.stack([points[c] for c in "xyz"], 1)
    tangent = np.stack([points["t" + c] for c in "xyz"], 1)
    axis = np.abs(tangent).argmax(1)
    cell = np.floor(position[np.arange(len(points)), axis] / PIECE_M).astype(int)
    _, piece = np.unique(np.stack([points["contour"], cell], 1), axis=0, return_inverse=True)
    shift = np.random.default_rng(1).normal(0, sigma_m, (piece.max() + 1, 3))[piece.ravel()]
    position += shift - (shift * tangent).sum(1, keepdims=True) * tangent
    for k, c in enumerate("xyz"):
        points[c] = position[:, k]
    points["sigma"] = sigma_m
    target.write_bytes(data[:body] + points.tobytes())


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("evpose", type=pathlib.Path)
    arguments.add_argument("recordings", type=pathlib.Path)
    arguments.add_argument("out", type=pathlib.Path)
    arguments.add_argument("--seconds", type=float, default=2)
    arguments.add_argument("--only", nargs="*", help="names of the table's flights")
    a = arguments.parse_args()
    a.recordings.mkdir(parents=True, exist_ok=True)
    flights = [(f"{s}, 1280x720", s, LARGE, []) for s in PLAIN + SPEEDS[:3]]
    lamps = [f"lamps.off_at_s={0.4 * a.seconds}", f"lamps.on_at_s={0.7 * a.seconds}"]
    flights += [(s, s, SMALL + (lamps if s == "hdr_lights_off" else []), []) for s in PLAIN + SPEEDS + HARD]
    flights += [(f"imu_1khz, {rate} Hz", "imu_1khz", SMALL, ["--set", f"rate_hz={rate}"])
                for rate in (100, 200, 300, 1000)]
    flights += [(f"{s}, map {mm} mm off", s, SMALL, mm) for mm in (3, 5) for s in PLAIN]
    flights.append((f"hover of {HOVER_S} s, 320x240", "hover", TINY, []))
    lines = ["Made by `scripts/simulator_accuracy.py`; do not edit.", "",
             "| flight | status | coverage | ATE mean mm | max mm | ARE mean deg | NEES/6 |", "|---|---|---|---|---|---|---|"]
    for name, scenario, settings, extra in flights:
        if a.only and name not in a.only:
            continue
        suffix = "_720p" if settings is LARGE else f"_{HOVER_S}s" if settings is TINY else ""
        folder = a.recordings / (scenario + suffix)
        simulate(a.evpose, folder, scenario, settings, HOVER_S if settings is TINY else a.seconds)
        with tempfile.TemporaryDirectory() as scratch:
            contours = folder / "contours.ply"
            if isinstance(extra, int):
                moved_pieces(contours, pathlib.Path(scratch) / "contours.ply", 1e-3 * extra)
                contours, extra = pathlib.Path(scratch) / "contours.ply", []
            lines.append(row(name, *track(a.evpose, folder, contours, extra)))
        print(lines[-1], flush=True)
    a.out.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
