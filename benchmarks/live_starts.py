# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/live-starts.md: how soon evpose serve has a pose, from starts known well, badly or not at all."""
import csv
import random
import re

import numpy as np

import harness
import tables

FLIGHTS = {"hall": ("indoor_spiral", 10), "landing": ("landing", 10)}
KNOWN = "fusion.calibration.on=false"
OFF_M, OFF_DEG, GPS_M = 0.15, 3, 3
OFF_SAID = f"{OFF_M * 100:.0f} cm, {OFF_DEG} deg off, said"
HEAD = ["recording", "start", "first `tracking` after, s", "of all data, `tracking` %", "its error, mean mm", "largest mm",
        "searches, found"]


def direction(drawn):
    v = np.array([drawn.gauss(0, 1) for _ in range(3)])
    return v / np.linalg.norm(v)


def pose_words(position, quaternion, t_s):
    return ",".join(f"{v:.9g}" for v in [*position, *quaternion]) + f"@{t_s:.6f}"


def product(q, r):
    (x, y, z, w), (a, b, c, d) = q, r
    return [w * a + x * d + y * c - z * b, w * b - x * c + y * d + z * a, w * c + x * b - y * a + z * d, w * d - x * a - y * b - z * c]


def starts(recording, seed):
    """The words of each kind of start."""
    drawn = random.Random(seed)
    t_s, *pose = np.loadtxt(recording.truth)[2]
    position, quaternion = np.array(pose[:3]), pose[3:]
    half = np.radians(OFF_DEG) / 2
    off = pose_words(position + OFF_M * direction(drawn), product([*(np.sin(half) * direction(drawn)), np.cos(half)], quaternion), t_s)
    by_gps = pose_words(position + np.array([drawn.gauss(0, GPS_M) for _ in range(3)]), quaternion, t_s)
    exact = pose_words(position, quaternion, t_s)
    return {"known": ["--init", exact, "--set", KNOWN],
            OFF_SAID: ["--init", off, "--init-sigma", "0.1,2", "--set", KNOWN],
            f"{OFF_M * 100:.0f} cm, {OFF_DEG} deg off, not said": ["--init", off, "--set", KNOWN],
            f"{GPS_M} m off, heading known, said": ["--init", by_gps, "--init-sigma", f"{GPS_M},20", "--set", KNOWN],
            "anywhere": ["--init", "anywhere", "--set", KNOWN],
            "known, calibration ordinary": ["--init", exact]}


def without_sigmas(recording, scratch):
    """The true calibration, of which nothing is said to be sure."""
    chain = next(recording.folder.glob("cam*.yaml"))
    path = scratch / chain.name
    path.write_text("".join(line + "\n" for line in chain.read_text().splitlines() if not re.match(r"\s*\w+_sigma:", line)))
    return path


def judged(recording, run):
    """When `tracking` began, its share of the data, and the errors of its poses."""
    truth = np.loadtxt(recording.truth)
    with open(run / "states.csv", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["health"] == "tracking"]
    if not rows:
        return None
    t_s = np.array([float(row["t_s"]) for row in rows])
    found = np.array([[float(row[c]) for c in ("x_m", "y_m", "z_m")] for row in rows])
    true = np.stack([np.interp(t_s, truth[:, 0], truth[:, 1 + k]) for k in range(3)], axis=1)
    return t_s[0] - truth[0, 0], len(t_s) / (300 * (truth[-1, 0] - truth[0, 0])), 1e3 * np.linalg.norm(found - true, axis=1)


def measure(bench, recording, words):
    with bench.folder() as scratch:
        run = scratch / "run"
        try:
            printed = bench.run("serve", recording.folder, "--map", recording.contours, "--occluders", recording.mesh,
                                "--calibration", without_sigmas(recording, scratch), "-o", run, *words)
        except harness.Failure as why:
            if "before the first pose" not in str(why):
                raise
            return ["not found", "0", "-", "-", "-"]
        searches = re.search(r"searches for the pose: (\d+), found (\d+)", printed)
        said = f"{searches[1]}, {searches[2]}" if searches else "0, 0"
        outcome = judged(recording, run) if (run / "states.csv").exists() else None
    if outcome is None:
        return ["not found", "0", "-", "-", said]
    after_s, share, errors_mm = outcome
    return [f"{after_s:.2f}", f"{100 * share:.0f}", f"{errors_mm.mean():.1f}", f"{errors_mm.max():.1f}", said]


def make(bench):
    rows = []
    for seed, (name, (scenario, seconds)) in enumerate(FLIGHTS.items(), 1):
        recording = bench.simulated(scenario, seconds, ("camera.size=vga",))
        for kind, words in starts(recording, seed).items():
            if bench.quick and kind != "known":
                continue
            rows.append([name, kind, *bench.once(f"live start: {name}, {kind}", lambda: measure(bench, recording, words))])
    return bench.write_page("live-starts", {"starts": tables.table(HEAD, rows)}, harness.machine())
