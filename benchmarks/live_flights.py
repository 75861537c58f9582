# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/live-flights.md: simulated flights at the rates of a 1280x720 sensor, replayed live beside offline."""
import csv
import json
import re
import shutil

import harness
import tables

RATES_MEV_S = (39, 62)
WIDTH = 1280
HEAD = ["flight", "events, Mev/s", "offline: ATE mm", "`tracking` %", "live: ATE mm", "`tracking` %", "updates",
        "delay p50 / p99, ms", "events shed", "contours looked at"]


def mean_rate(folder):
    return json.loads((folder / "flight.json").read_text())["mev_s"]


def is_wide(folder):
    return str(WIDTH) in (folder / "camchain-imucam_truth.yaml").read_text()


def as_sensor_sends(bench, flight, into):
    """The recording with events as words of EVT3, and with the true calibration."""
    for name in ("imu.csv", "imu.yaml", "groundtruth.tum"):
        shutil.copy(flight.folder / name, into / name)
    shutil.copy(flight.folder / "camchain-imucam_truth.yaml", into / "camchain-imucam.yaml")
    bench.run("convert", flight.folder / "events.h5", into / "events.raw")
    return into


def share_tracking(run):
    with open(run / "states.csv") as file:
        states = [row["health"] for row in csv.DictReader(file)]
    return 100 * sum(state == "tracking" for state in states) / max(1, len(states))


def judged(bench, flight, run):
    accuracy = bench.later_accuracy(run, flight.truth)
    return [f"{accuracy['ate_mean_mm']:.2f}" if accuracy else "-", f"{share_tracking(run):.0f}"]


def measure(bench, flight):
    with bench.folder() as scratch:
        recording = scratch / "recording"
        recording.mkdir()
        as_sensor_sends(bench, flight, recording)
        words = ["--map", flight.contours, "--occluders", flight.mesh, "--init", "groundtruth", "--force",
                 "--set", "fusion.calibration.on=false"]
        bench.run("track", recording, *words, "-o", scratch / "offline", "--set", "overlays=0")
        printed = bench.run("serve", recording, *words, "-o", scratch / "live", "--view", 0)
        found = {key: re.search(pattern, printed) for key, pattern in
                 (("delay", r"p50 ([\d.]+) ms, p99 ([\d.]+) ms"), ("events", r"events: (\d+) arrived, (\d+) shed"),
                  ("updates", r"(\d+) updates"), ("looked", r"contours looked at: (?:([\d.]+) %|all)"))}
        if not all(found.values()):
            raise harness.Failure(f"{flight.name}: serve does not say {[k for k, v in found.items() if not v]}")
        arrived, shed = (int(n) for n in found["events"].groups())
        return [flight.name, f"{mean_rate(flight.folder):.0f}", *judged(bench, flight, scratch / "offline"),
                *judged(bench, flight, scratch / "live"), found["updates"][1],
                f"{found['delay'][1]} / {found['delay'][2]}", f"{100 * shed / arrived:.1f} %",
                f"{float(found['looked'][1] or 100):.0f} %"]


def make(bench):
    low, high = RATES_MEV_S
    flights = [f for f in bench.unseen_flights() if is_wide(f.folder) and low <= mean_rate(f.folder) <= high]
    rows = [bench.once(f"live flight: {f.name}", lambda f=f: measure(bench, f)) for f in flights]
    return bench.write_page("live-flights", {"flights": tables.table(HEAD, rows)}, harness.machine())
