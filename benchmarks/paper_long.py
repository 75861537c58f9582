# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/paper-long.md: flights of ten seconds with the paper's form and with the defaults: errors over several seeds,
the last metre of landings, time by stage and system, processor and memory over time, the map's share of both."""
import csv
import dataclasses
import pathlib
import re
import statistics
import subprocess
import time

import files
import harness
import numpy as np
import paper_evaluation
import tables

SECONDS, LANDING_S = 10, 8  # a landing is over then
SEEDS = (101, 102, 103)     # that no default was chosen on
SCENARIOS = {"indoor_spiral": SECONDS, "outdoor_spiral": SECONDS, "landing": LANDING_S}
SYSTEMS = {"paper, graph": ("--preset", "paper"), "paper, EKF": ("--preset", "paper", "--set", "fusion.kind=ekf"),
           "paper, particle filter": ("--preset", "paper", "--set", "fusion.kind=particle"), "defaults": ()}
STAGES = ["choose", "events", "predict", "register", "fuse"]
MOMENTS = (10, 25, 50, 75, 100)  # per cent of a run
SAMPLE_S = 0.02
FEW = 50  # one in so many contours is left to see what the map takes
ALONE = ("--set", "overlays=0", "--set", "relocalization.on=false", "--set", "fusion.calibration.on=false")



def flights(bench, scenario):
    for seed in SEEDS[:1] if bench.quick else SEEDS:
        seeds = harness.seeds(seed)
        made = bench.simulated(scenario, SCENARIOS[scenario], (*harness.TINY, *seeds), f"paper_long_{scenario}")
        yield dataclasses.replace(made, name=f"{scenario} of {SCENARIOS[scenario]} s, seed {seed}")


def last_metre(run, truth):
    """Of the poses below a metre above where the flight ends: sideways and in height, mm, and degrees."""
    rows, true = np.loadtxt(run / "trajectory.tum", ndmin=2), np.loadtxt(truth)
    p, q = files.Trajectory(true).at(rows[:, 0])
    low = p[:, 2] < true[-1, 3] + 1
    if not low.any():
        return None
    off = rows[low, 1:4] - p[low]
    turned = paper_evaluation.angle_deg(rows[low, 4:8], q[low])
    return [float(1e3 * np.linalg.norm(off[:, :2], axis=1).mean()), float(1e3 * np.abs(off[:, 2]).mean()), float(turned.mean())]


def tracked(bench, flight, words):
    with bench.folder() as scratch:
        summary = bench.track(flight.folder, flight.contours, scratch / "run", "--occluders", flight.mesh, "--set", "overlays=0",
                              *words)
        with open(scratch / "run/latency.csv") as file:
            updates = list(csv.DictReader(file))
        times = {s: [float(u[f"{s}_ms"]) for u in updates] for s in STAGES}
        return {"accuracy": summary.get("accuracy", {}), "status": summary["status"], "coverage": summary["coverage"],
                "tracking": summary["tracking_share"], "last metre": last_metre(scratch / "run", flight.truth),
                "stages": {s: [float(v) for v in np.percentile(t, (50, 99))] for s, t in times.items()},
                "sum": [float(v) for v in np.percentile(np.sum(list(times.values()), axis=0), (50, 99))],
                "choosing": sum(times["choose"]) / max(1e-9, sum(map(sum, times.values()))),
                "cpu": summary["resources"]["cpu_share"], "memory": summary["resources"]["peak_memory_mb"]}


def measure(bench, flight, system):
    return bench.once(f"paper long: {flight.name}, {system}", lambda: tracked(bench, flight, SYSTEMS[system]))


def digits(value, count):
    return np.format_float_positional(float(f"{value:.{count}g}"), trim="-")


def spread(values):
    """Mean, and the standard deviation between the seeds."""
    values = [v for v in values if v is not None]
    if not values:
        return "-"
    apart = statistics.stdev(values) if len(values) > 1 else 0
    return f"{digits(statistics.mean(values), 3)} ± {digits(apart, 2)}"


def errors(bench):
    keys = {"ATE mm": "ate_mean_mm", "ARE deg": "are_mean_deg", "RTE 1 s mm": "rte_1s_mm", "RRE 1 s deg": "rre_1s_deg",
            "largest mm": "ate_max_mm", "NEES/6": "nees6_mean"}
    rows = []
    for scenario in list(SCENARIOS)[:1] if bench.quick else SCENARIOS:
        made = list(flights(bench, scenario))
        for system in SYSTEMS:
            runs = [measure(bench, flight, system) for flight in made]
            rows.append([scenario, system, *(spread([r["accuracy"].get(k) for r in runs]) for k in keys.values()),
                         f"{100 * statistics.mean(r['tracking'] for r in runs):.0f}",
                         f"{sum(r['status'] == 'tracking' for r in runs)} of {len(runs)}"])
    return tables.table(["scenario", "system", *keys, "tracking %", "tracking at the end"], rows)


def landings(bench):
    if bench.quick:
        return ["-"]
    rows = []
    for system in SYSTEMS:
        low = [m for m in (measure(bench, f, system)["last metre"] for f in flights(bench, "landing")) if m]
        rows.append([system, *(spread(v) for v in zip(*low))] if low else [system, "-", "-", "-"])
    return tables.table(["system", "sideways mm", "height mm", "deg"], rows)


def stages(bench):
    flight = next(flights(bench, "indoor_spiral"))
    rows = []
    for system in SYSTEMS:
        m = measure(bench, flight, system)
        rows.append([system, *(f"{m['stages'][s][0]:.2f} / {m['stages'][s][1]:.2f}" for s in STAGES),
                     f"{m['sum'][0]:.2f} / {m['sum'][1]:.2f}", f"{100 * m['choosing']:.0f} %"])
    return tables.table(["system", "points of the map", "events", "predict", "register", "fuse", "together",
                         "the map's share of the time"], rows)


def status_of(process):
    """Resident memory in MB and processor seconds of a running process; None when it has ended."""
    try:
        memory = re.search(r"VmRSS:\s+(\d+)", pathlib.Path(f"/proc/{process.pid}/status").read_text())
        ticks = pathlib.Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()[11:13]
    except (FileNotFoundError, ProcessLookupError):
        return None
    return (int(memory[1]) / 1024, sum(map(int, ticks)) / 100) if memory else None


def course(bench, flight, contours, words):
    """Samples of memory and processor time over a run."""
    with bench.folder() as scratch:
        command = [bench.evpose, "-q", "track", flight.folder, "--map", contours, "--occluders", flight.mesh, "--init",
                   "groundtruth", "-o", scratch / "run", *ALONE, *words]
        process = subprocess.Popen([str(w) for w in command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        samples = []
        while process.poll() is None:
            if (now := status_of(process)) is not None:
                samples.append(now)
            time.sleep(SAMPLE_S)
        if process.returncode not in (0, 1):
            raise harness.Failure(f"track: {harness.last_line(process.stderr.read().decode())}")
    return samples


def without_most(bench, flight, words):
    """The same with a few of the contours."""
    with bench.folder() as scratch:
        ply = files.Ply(flight.contours)
        ply.vertices = ply.vertices[ply.vertices["contour"] % FEW == 0]
        ply.header = re.sub(rb"element vertex \d+", b"element vertex %d" % len(ply.vertices), ply.header)
        ply.write(scratch / "few.ply")
        return course(bench, flight, scratch / "few.ply", words)


def resources(bench):
    flight = next(flights(bench, "indoor_spiral"))
    rows = []
    for system in ("paper, graph", "defaults"):
        whole = bench.once(f"paper long: course, {system}", lambda: course(bench, flight, flight.contours, SYSTEMS[system]))
        few = bench.once(f"paper long: few contours, {system}", lambda: without_most(bench, flight, SYSTEMS[system]))
        at = [whole[min(len(whole) - 1, round(m / 100 * (len(whole) - 1)))] for m in MOMENTS]
        typical, less = (statistics.median(memory for memory, _ in samples) for samples in (whole, few))
        rows.append([system, *(f"{memory:.0f} MB, {seconds:.1f} s" for memory, seconds in at),
                     f"{typical - less:.0f} of {typical:.0f} MB"])
    return tables.table(["system", *(f"{m} % of the run" for m in MOMENTS), "the map's share of memory"], rows)


def make(bench):
    figures = {"errors": errors(bench), "landings": landings(bench), "stages": stages(bench), "resources": resources(bench)}
    return bench.write_page("paper-long", figures, harness.machine())
