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
LONG_SCENARIO, LONG_S, LONG_SEED = "turning_2", 10, 230
LONG_SIZES = {"640x480": "vga", "1280x720": "720p"}
HEAD = ["recording", "focal %", "centre px", "image px rms", "rotation deg", "place mm", "time ms", "NEES", "largest error, sigma",
        "at rest"]
TURN_DEG, TURN_S, TURN_SEED = (0, 60, -40, 60, -40, 30), 5, 301
STAR = "data/real/davis240c_rotating_star"
DRAWN_SCENARIO, DRAWN_S = "turning_2", 5
DRAWN_SEEDS = [seed for seed in range(202, 224) if seed not in (204, 208)]  # these, 200 and 201 were looked at
DRAWN_ROWS = {"focal_percent": "focal %", "centre_px": "centre px", "image_px": "image px rms", "rotation_deg": "rotation deg",
              "place_mm": "place mm", "time_ms": "time ms", "nees": "NEES", "worst_sigma": "largest error, sigma",
              "gyro_ideal": "gyroscope's axes, as if ideal, % rms", "gyro": "gyroscope's axes, found",
              "accel_ideal": "accelerometer's axes, as if ideal, % rms", "accel": "accelerometer's axes, found",
              "axes_square": "axes: mean square of error over sigma"}
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
    return mounted_off(start, true, drawn, 0.5, 5e-3)


def ordinary_start(true, seed):
    """A calibration with errors drawn from the sigmas of an ordinary one, which it states."""
    drawn = random.Random(seed)
    fx, fy, cx, cy = true["intrinsics"]
    focal, lens = drawn.gauss(0, 3e-3), (0.01, 0.02, 5e-4, 5e-4)
    start = {**true, "intrinsics": [fx * (1 + focal), fy * (1 + focal), cx + drawn.gauss(0, 1), cy + drawn.gauss(0, 1)],
             "distortion": [v + drawn.gauss(0, s) for v, s in zip(true["distortion"], lens)],
             "sigmas": {"intrinsics_sigma": [3e-3 * fx, 3e-3 * fy, 1.0, 1.0], "distortion_sigma": list(lens),
                        "T_cam_imu_sigma": [0.3, 0.01], "timeshift_sigma": 2e-3}}
    return mounted_off(start, true, drawn, 0.3, 10e-3)


def mounted_off(start, true, drawn, sigma_deg, sigma_m):
    """With the camera's pose in the body, where there is one, off by these 1 sigmas, and its time by 2 ms."""
    if "T_cam_imu" in true:
        off = np.eye(4)
        off[:3, :3] = errors.rotation(np.array([drawn.gauss(0, 1) for _ in range(3)]) * math.radians(sigma_deg))
        off[:3, 3] = [drawn.gauss(0, sigma_m) for _ in range(3)]
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
        imu = scratch / "found-imu.yaml"
        return {"chain": (scratch / "found.yaml").read_text(), "imu": imu.read_text() if imu.exists() else "",
                "said": re.findall("^note: (.*)$", said, re.MULTILINE)}


def row(name, found, true):
    if "failed" in found:
        why = re.sub(r"\S*/", "", found["failed"].split(": ", 2)[-1]).split(";")[0]  # without folders and what to do
        return [name, "refused: " + why, *["-"] * (len(HEAD) - 2)]
    e = errors.judge(errors.parse(found["chain"]), true)
    rests = not any("come to rest" in words for words in found["said"])
    return [name, *(f"{e[key]:.2g}" for key in ("focal_percent", "centre_px", "image_px", "rotation_deg", "place_mm", "time_ms",
                                                "nees", "worst_sigma")), "yes" if rests else "no, said so"]


def found_of(bench, recording, seed):
    """What is found from a far start before the true contours, and the truth."""
    true = errors.read(next(recording.folder.glob("cam*.yaml")))
    return bench.once(f"calibrate: {recording.name} {FAR}",
                      lambda: calibrated(bench, [recording.folder], far_start(true, seed), "--map", recording.contours,
                                         "--occluders", recording.mesh, "--init", "groundtruth")), true


def found_of_built(bench, recording, seed, start_of=far_start):
    """The same before the map that is built of its cloud."""
    true = errors.read(next(recording.folder.glob("cam*.yaml")))

    def measure():
        with bench.folder() as scratch:
            built = scratch / "built.h5"
            bench.run("map", "build", recording.folder / "map_raw.ply", "-o", built)
            return calibrated(bench, [recording.folder], start_of(true, seed), "--map", built, "--init", "groundtruth")

    return bench.once(f"calibrate: {recording.name} {FAR} built, {start_of.__name__}", measure), true


def long_flights(bench):
    """Ten seconds of a place of their own, before true contours and a built map."""
    rows = []
    for size, words in LONG_SIZES.items():
        recording = bench.simulated(LONG_SCENARIO, LONG_S, [f"camera.size={words}", "lidar.on=true", *harness.seeds(LONG_SEED)],
                                    name=f"calibrate_{words}")
        rows += [row(f"{size}, true contours", *found_of(bench, recording, LONG_SEED)),
                 row(f"{size}, built map", *found_of_built(bench, recording, LONG_SEED)),
                 row(f"{size}, built map, ordinary start", *found_of_built(bench, recording, LONG_SEED, ordinary_start))]
    return tables.table(HEAD, [*rows, GOAL])


def turned(bench):
    """A camera that turns to and fro about the vertical and goes nowhere, from a far start."""
    path = bench.scratch / "turn.txt"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(f"4 3 1.5 {yaw_deg}\n" for yaw_deg in TURN_DEG))
    settings = ["trajectory.kind=waypoints", f"trajectory.file={path}", *harness.TINY, *harness.seeds(TURN_SEED)]
    recording = bench.simulated(LONG_SCENARIO, TURN_S, settings, name="calibrate_turn")
    found, true = found_of(bench, recording, TURN_SEED)
    return [*tables.table(HEAD, [row(f"a turn, {TURN_S} s", found, true)]), "", *told_words(found)]


def star(bench):
    """What is said of a real camera that rolls before a star."""
    folder = bench.shared / STAR
    gravity = (folder / "gravity.txt").read_text().split()[-3:]
    known = [w for axis, value in zip("xyz", gravity) for w in ("--set", f"fusion.gravity_{axis}={value}")]
    found = bench.once("calibrate: star", lambda: calibrated(bench, [folder], errors.read(folder / "camchain-imucam.yaml"), "--map",
                                                             folder / "contours.ply", "--init", folder / "init.tum", *known))
    return told_words(found)


def told_words(found):
    return ["refused: " + found["failed"].split(": ", 2)[-1]] if "failed" in found else [f"- {words}" for words in found["said"]]


def measured(bench, recordings, first_seed):
    rows = [row(recording.name, *found_of(bench, recording, seed)) for seed, recording in enumerate(recordings, first_seed)]
    return tables.table(HEAD, [*rows, GOAL])


def drawn(bench):
    """Flights of their own seeds: distributions of errors, and of how they compare with what is stated."""
    all_errors, refused, restless = [], 0, 0
    for seed in DRAWN_SEEDS[:1] if bench.quick else DRAWN_SEEDS:
        recording = bench.simulated(DRAWN_SCENARIO, DRAWN_S, [*harness.TINY, *harness.seeds(seed)], name=f"calibrate_{seed}")
        found, true = found_of(bench, recording, seed)
        if "failed" in found:
            refused += 1
            continue
        restless += any("come to rest" in words for words in found["said"])
        all_errors.append(errors.judge(errors.parse(found["chain"]), true)
                          | errors.judge_axes(found["imu"], (recording.folder / "imu_truth.yaml").read_text()))
    count = len(all_errors)
    said = [["flights; refused; not at rest, said so", f"{count + refused}; {refused}; {restless}", "", "", ""]]
    return tables.table(["", "mean", "median", "90 %", "worst"],
                        [*([words, *(f"{f(values):.2g}" for f in (np.mean, np.median, lambda v: np.quantile(v, 0.9), np.max))]
                           for key, words in DRAWN_ROWS.items() if (values := [e[key] for e in all_errors])), *said])


def make(bench):
    unseen = [] if bench.quick else bench.more_peers()
    return bench.write_page("calibrate", {"flights": measured(bench, bench.peers(), 0), "unseen": measured(bench, unseen, 100),
                                          "long": long_flights(bench), "turn": turned(bench), "star": star(bench),
                                           "drawn": drawn(bench)})
