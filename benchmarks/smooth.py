# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/smooth.md: `evpose smooth` beside `evpose track`, on shared recordings and on flights of reporting seeds."""
import json
import statistics

import tables

UNSEEN = 4  # the first of them: smoothing a second of 1280x720 takes minutes
FIGURES = {"ate_mean_mm": "ATE mm", "are_mean_deg": "ARE deg", "velocity_rmse_mm_s": "velocity mm/s", "nees6_mean": "NEES/6",
           "tracking": "share of `tracking`"}
DIGITS = {"ate_mean_mm": 2, "are_mean_deg": 3, "velocity_rmse_mm_s": 1, "nees6_mean": 2, "tracking": 2}


def measure(bench, recording, *calibration):
    """Figures of both commands; of one without accuracy, none."""
    found = {}
    for command in ("track", "smooth"):
        with bench.folder() as scratch:
            run = scratch / "run"
            bench.run(command, recording.folder, "--map", recording.contours, "--occluders", recording.mesh, "--init",
                      "groundtruth", "-o", run, *calibration)
            summary = json.loads((run / "summary.json").read_text())
            found[command] = {"tracking": summary["tracking_share"], **(summary.get("accuracy") or {})}
    return found


def cell(measured, key):
    return ", ".join(f"{run[key]:.{DIGITS[key]}f}" if key in run else "-" for run in measured.values())


def rows_of(measured):
    return [[name, *(cell(runs, key) for key in FIGURES)] for name, runs in measured.items()]


def summary(kinds):
    """Means over the recordings, in how many the smoother has the smaller error."""
    rows = []
    for kind, measured in kinds.items():
        pairs = [runs for runs in measured.values() if all("ate_mean_mm" in run for run in runs.values())]
        better = [sum(p["smooth"][key] < p["track"][key] for p in pairs) for key in list(FIGURES)[:3]]
        means = [", ".join(f"{statistics.mean(p[c][key] for p in pairs):.{DIGITS[key]}f}" for c in ("track", "smooth"))
                 for key in FIGURES]
        rows.append([kind, len(pairs), *means, ", ".join(map(str, better))])
    return tables.table(["recordings", "n", *FIGURES.values(), "better in position, rotation, velocity"], rows)


def make(bench):
    known = ("--set", "fusion.calibration.on=false")
    shared = {r.name: bench.once(f"smooth: {r.name}", lambda: measure(bench, r, *known))
              for r in bench.peers() + ([] if bench.quick else bench.more_peers())}
    flights = bench.unseen_flights()[:1 if bench.quick else UNSEEN]
    true = {r.name: bench.once(f"smooth: {r.name}, true calibration",
                               lambda: measure(bench, r, "--calibration", r.folder / "camchain-imucam_truth.yaml"))
            for r in flights}
    given = {r.name: bench.once(f"smooth: {r.name}, calibration as handed over", lambda: measure(bench, r)) for r in flights}
    head = ["recording", *FIGURES.values()]
    return bench.write_page("smooth", {
        "summary": summary({"shared": shared, "unseen, true calibration": true, "unseen, handed over": given}),
        "shared": tables.table(head, rows_of(shared)), "true": tables.table(head, rows_of(true)),
        "given": tables.table(head, rows_of(given))})
