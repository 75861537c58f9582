#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Where the time of an update goes: latency_table.py EVPOSE SHARED OUT.md

Tracks shared recordings at 300 and at 1000 updates a second on one core and writes what passes between the newest event
and the pose, by stage, with the share of a core and the peak of memory. For a machine that does nothing else, and the
`bench` build.
"""
import csv
import json
import pathlib
import subprocess
import sys
import tempfile

RECORDINGS = ["room_spiral", "room_720p"]
RATES_HZ = [300, 1000]
STAGES = ["predict", "choose", "register", "fuse"]


def at(values, share):
    values = sorted(values)
    return values[min(len(values) - 1, int(share * len(values)))]


def row(evpose, shared, name, rate_hz):
    peer = shared / "data" / "peer"
    scene = name.split("_")[0]
    with tempfile.TemporaryDirectory() as scratch:
        run = pathlib.Path(scratch) / "run"
        command = [evpose, "-q", "track", peer / name, "--map", peer / "maps" / f"{scene}_contours.ply", "--occluders",
                   peer / "maps" / f"{scene}_mesh.ply", "-o", run, "--set", f"rate_hz={rate_hz}", "--set", "overlays=0"]
        done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
        if done.returncode == 2:
            sys.exit(done.stderr)
        summary = json.loads((run / "summary.json").read_text())
        with open(run / "latency.csv") as file:
            updates = [{k: float(v) for k, v in u.items()} for u in csv.DictReader(file)]
    stages = [[u[f"{s}_ms"] for u in updates] for s in STAGES]
    total = [sum(times) for times in zip(*stages)]
    cells = [f"{at(s, 0.5):.2f} / {at(s, 0.99):.2f}" for s in [*stages, total]]
    resources, accuracy = summary["resources"], summary["accuracy"]
    events = at([u["events_ms"] for u in updates], 0.5)
    return (f"| {name} | {rate_hz} | {' | '.join(cells)} | {events:.2f} | {100 * resources['cpu_share']:.0f} % | "
            f"{resources['peak_memory_mb']:.0f} | {accuracy['ate_mean_mm']:.2f} |")


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    evpose, shared, out = (pathlib.Path(a) for a in sys.argv[1:])
    lines = ["Made by `scripts/latency_table.py`; do not edit. Milliseconds, p50 / p99.", "",
             "| recording | updates a second | predict | choose points | register | fuse | newest event to pose | "
             "events before (p50) | share of a core | peak memory MB | ATE mm |", "|" + "---|" * 11]
    lines += [row(evpose, shared, name, rate) for name in RECORDINGS for rate in RATES_HZ]
    out.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
