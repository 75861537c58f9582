# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/latency.md: where the time of an update goes, on one core; for a machine that does nothing else.

What passes between the newest event and the pose, by stage, with the share of a core and the peak of memory; and the
same at high rates of events, beside the form that associates at the update (`evpose bench realtime`).
"""
import csv

import harness
import tables

RUNS = [("room_spiral", 300), ("room_spiral", 1000), ("room_720p", 300), ("room_720p", 1000)]
STAGES = ["predict", "register", "fuse"]  # after the newest event
BEFORE = ["choose", "events"]
REALTIME = {"room_spiral": [1, 10], "room_720p": [1, 10, 20]}  # million events a second
BUDGET = "events.most_mev_s=6"     # of serve
OVER_BUDGET = [20, 50, 100]
BURST_MEV_S = 300
RUNS_OF_EACH = 5  # their medians


def at(values, share):
    values = sorted(values)
    return values[min(len(values) - 1, int(share * len(values)))]


def measure(bench, recording, rate_hz):
    with bench.folder() as scratch:
        summary = bench.track(recording.folder, recording.contours, scratch / "run", "--occluders", recording.mesh,
                              "--set", f"rate_hz={rate_hz}", "--set", "overlays=0")
        with open(scratch / "run/latency.csv") as file:
            updates = [{k: float(v) for k, v in u.items()} for u in csv.DictReader(file)]
    stages = [[u[f"{s}_ms"] for u in updates] for s in STAGES]
    total = [sum(times) for times in zip(*stages)]
    resources = summary["resources"]
    return [recording.name, rate_hz, *(f"{at(s, 0.5):.2f} / {at(s, 0.99):.2f}" for s in [*stages, total]),
            *(f"{at([u[f'{s}_ms'] for u in updates], 0.5):.2f} / {at([u[f'{s}_ms'] for u in updates], 0.99):.2f}"
              for s in BEFORE),
            f"{100 * resources['cpu_share']:.0f} %", f"{resources['peak_memory_mb']:.0f}",
            f"{summary['accuracy']['ate_mean_mm']:.2f}"]


def realtime(bench, name, rates, *words, all_updates=True):
    """Rows of `evpose bench realtime`, as it prints them; without a search, as live."""
    printed = bench.run("bench", "realtime", bench.shared / "data/peer", "--only", name, "--set", "relocalization.on=false",
                        *words, "--mev-s", ",".join(map(str, rates)),
                        *(["--updates", 300] if bench.quick or not all_updates else []))
    return tables.read(printed)[""]


def make(bench):
    rows = [bench.once(f"latency: {name} at {rate} Hz", lambda: measure(bench, bench.peer(name), rate))
            for name, rate in (RUNS[2:3] if bench.quick else RUNS)]
    heads = ["recording", "updates a second", "predict", "register", "fuse", "newest event to pose",
             "before it: points and bands", "before it: events", "share of a core", "peak memory MB", "ATE mm"]
    loads = {"room_720p": [5]} if bench.quick else REALTIME
    under_load = [row for name, rates in loads.items()
                  for row in bench.once(f"realtime: {name}, {rates}, beside batch",
                                        lambda: realtime(bench, name, rates, "--beside-batch", "--runs", RUNS_OF_EACH))]
    name, rates, budget = "room_720p", OVER_BUDGET[:1] if bench.quick else OVER_BUDGET, ("--set", BUDGET)

    def within_budget(what, rates, *words):
        return bench.once(f"realtime: {name}, {rates}, {BUDGET}, {what}",
                          lambda: realtime(bench, name, rates, *budget, *words, all_updates=False))

    over = within_budget("one core", rates)
    two_cores = within_budget("two cores", rates, "--two-cores")
    burst = within_budget("burst", [1, 10], "--burst", BURST_MEV_S)

    def as_table(measured):
        return tables.table(list(measured[0]), [list(row.values()) for row in measured])

    figures = {"stages": tables.table(heads, rows), "realtime": as_table(under_load), "budget": as_table(over),
               "two cores": as_table(two_cores), "burst": as_table(burst)}
    return bench.write_page("latency", figures, harness.machine())
