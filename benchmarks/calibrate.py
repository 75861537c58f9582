# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/calibrate.md: `evpose calibrate` from starts that are far off, on shared recordings and a simulated flight."""
import math
import random
import re

import numpy as np

import calibration_errors as errors
import harness
import tables

FAR = {"focal": 0.05, "centre_px": 20}  # of a start
SIMULATED = ("turning_2", 8, ("camera.size=vga",))
HEAD = ["recording", "focal %", "centre px", "image px rms", "rotation deg", "place mm", "time ms", "NEES", "largest error, sigma",
        "at rest"]
GOAL = ["goal, 10 s", "0.02", "0.1", "0.05", "0.01", "1", "0.1", "0.7 to 1.4", "", ""]


def far_start(true, seed, focal=FAR["focal"]):
    """A start that is off: both focal lengths alike, the centre in a direction of its own, no distortion, and of an
    ordinary assembly the camera's pose and time."""
    drawn = random.Random(seed)
    sign = 1 if seed % 2 else -1
    turn = drawn.uniform(0, 2 * math.pi)
    start = {**true, "intrinsics": list(true["intrinsics"]), "distortion": [0.0] * len(true["distortion"])}
    start["intrinsics"][0] *= 1 + sign * focal
    start["intrinsics"][1] *= 1 + sign * focal
    start["intrinsics"][2] += FAR["centre_px"] * math.cos(turn)
    start["intrinsics"][3] += FAR["centre_px"] * math.sin(turn)
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
        return [name, "refused: " + found["failed"].split(": ", 2)[-1][:100], *["-"] * (len(HEAD) - 2)]
    e = errors.judge(errors.parse(found["chain"]), true)
    rests = not any("come to rest" in words for words in found["said"])
    return [name, *(f"{e[key]:.2g}" for key in ("focal_percent", "centre_px", "image_px", "rotation_deg", "place_mm", "time_ms",
                                                "nees", "worst_sigma")), "yes" if rests else "no, said so"]


def measured(bench, recordings, first_seed):
    rows = []
    for seed, recording in enumerate(recordings, first_seed):
        true = errors.read(next(recording.folder.glob("cam*.yaml")))
        found = bench.once(f"calibrate: {recording.name} {FAR}",
                           lambda: calibrated(bench, [recording.folder], far_start(true, seed), "--map", recording.contours,
                                              "--occluders", recording.mesh, "--init", "groundtruth"))
        rows.append(row(recording.name, found, true))
    return tables.table(HEAD, [*rows, GOAL])


def make(bench):
    chosen_on = [*bench.peers(), bench.simulated(*SIMULATED)]
    unseen = [] if bench.quick else bench.more_peers()
    return bench.write_page("calibrate", {"flights": measured(bench, chosen_on, 0), "unseen": measured(bench, unseen, 100)})
