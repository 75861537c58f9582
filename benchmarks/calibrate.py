# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/calibrate.md: `evpose calibrate` from starts far off, on shared recordings, before a board, on real data."""
import math
import pathlib
import random
import re

import numpy as np

import board_frames
import calibration_errors as errors
import harness
import tables

SEEDS = 6
FAR = {"focal": 0.05, "centre_px": 20}     # of a start on flights
SHEET = {"focal": 0.10, "centre_px": 0}    # of a start before the board: a data sheet's, centre in the middle
BOARD_S = 5
BOARD = ("--checkerboard", "9x7", "--square", 0.08)
REAL_BOARD = ("--checkerboard", "7x10", "--square", 0.027)
HEAD = ["recording", "focal %", "centre px", "image px rms", "rotation deg", "place mm", "time ms", "NEES", "largest error, sigma"]
GOAL = ["goal", "0.02", "0.1", "0.05", "0.01", "1", "0.1", "0.7 to 1.4", ""]


def far_start(true, seed, how):
    """A start that is off: both focal lengths alike, the centre in a direction of its own, no distortion, and of an
    ordinary assembly the camera's pose and time."""
    drawn = random.Random(seed)
    sign = 1 if seed % 2 else -1
    turn = drawn.uniform(0, 2 * math.pi)
    start = {**true, "intrinsics": list(true["intrinsics"]), "distortion": [0.0] * len(true["distortion"])}
    start["intrinsics"][0] *= 1 + sign * how["focal"]
    start["intrinsics"][1] *= 1 + sign * how["focal"]
    if how["centre_px"]:
        start["intrinsics"][2] += how["centre_px"] * math.cos(turn)
        start["intrinsics"][3] += how["centre_px"] * math.sin(turn)
    else:
        start["intrinsics"][2:] = [(side - 1) / 2 for side in true["size"]]
    if "T_cam_imu" in true:
        off = np.eye(4)
        off[:3, :3] = errors.rotation(np.array([drawn.gauss(0, 1) for _ in range(3)]) * math.radians(0.5))
        off[:3, 3] = [drawn.gauss(0, 5e-3) for _ in range(3)]
        start["T_cam_imu"] = true["T_cam_imu"] @ np.linalg.inv(off)
        start["time_s"] = true["time_s"] + drawn.gauss(0, 2e-3)
    return start


def calibrated(bench, folders, start, *words):
    """The chain that is found, and what is said; None and why where nothing is."""
    with bench.folder() as scratch:
        errors.write(scratch / "start.yaml", start)
        try:
            said = bench.run("calibrate", *folders, "--start", scratch / "start.yaml", "-o", scratch / "found.yaml", *words)
        except harness.Failure as why:
            return {"failed": str(why)}
        return {"chain": (scratch / "found.yaml").read_text(), "said": re.findall("^note: (.*)$", said, re.MULTILINE)}


def row(name, found, true):
    if "failed" in found:
        return [name, found["failed"].rsplit(":", 1)[-1].strip()[:60], *["-"] * (len(HEAD) - 2)]
    e = errors.judge(errors.parse(found["chain"]), true)
    return [name, *(f"{e[key]:.3g}" if key in e else "-" for key in
                    ("focal_percent", "centre_px", "image_px", "rotation_deg", "place_mm", "time_ms", "nees", "worst_sigma"))]


def means(name, rows):
    """Of the rows that have figures."""
    cells = [[float(cell) for cell in column if cell != "-"] for column in zip(*(r[1:] for r in rows if r[3] != "-"))]
    return [f"**{name}**", *(f"**{np.mean(cell):.3g}**" if cell else "-" for cell in cells)]


def of_flights(bench):
    rows = []
    recordings = bench.peers() + ([] if bench.quick else bench.more_peers())
    for seed, recording in enumerate(recordings):
        true = errors.read(next(recording.folder.glob("cam*.yaml")))
        found = bench.once(f"calibrate: {recording.name} {FAR}",
                           lambda: calibrated(bench, [recording.folder], far_start(true, seed, FAR), "--map", recording.contours,
                                              "--occluders", recording.mesh, "--init", "groundtruth"))
        rows.append(row(recording.name, found, true))
    return [*rows, means("mean", rows), GOAL]


def board_map(bench, name, words):
    path = bench.scratch / f"{name}.h5"
    if not path.exists():
        bench.run("map", "board", *words, "-o", path)
    return path


def board_flight(bench, seed):
    """With the frames that the usual route needs."""
    return bench.simulated("board", BOARD_S, (f"seed={seed}", f"trajectory.seed={seed + 1}", "frames.rate_hz=30"),
                           f"board_{seed}")


def of_boards(bench):
    """With the IMU, by the events alone, and from frames by OpenCV."""
    board = board_map(bench, "board", BOARD)
    tables_of = {"imu": [], "alone": [], "frames": []}
    for seed in range(1 if bench.quick else SEEDS):
        flight = board_flight(bench, seed)
        true = errors.read(flight.folder / "camchain-imucam.yaml")
        start = far_start(true, seed, SHEET)
        for kind, begin in (("imu", start), ("alone", errors.without_imu(start))):
            folder = flight.folder if kind == "imu" else errors.events_alone(bench, flight)
            found = bench.once(f"calibrate: board {seed} {kind}",
                               lambda: calibrated(bench, [folder], begin, "--map", board, "--init", "board"))
            tables_of[kind].append(row(f"seed {seed}", found, true))
        frames = bench.once(f"calibrate: board {seed} frames",
                            lambda: board_frames.calibrate(flight.folder.glob("frames/*.png"), (9, 7), 0.08))
        tables_of["frames"].append(row(f"seed {seed}", frames, true))
    return {kind: [*rows, means("mean", rows), GOAL] for kind, rows in tables_of.items()}


def make(bench):
    boards = of_boards(bench)
    return bench.write_page("calibrate", {
        "flights": tables.table(HEAD, of_flights(bench)),
        **{f"board, {kind}": tables.table(HEAD, rows) for kind, rows in boards.items()}})
