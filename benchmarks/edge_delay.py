# SPDX-License-Identifier: BSD-3-Clause
"""What `evpose bench edge-delay` finds for sensors, and what its parameters leave over on other recordings of the same
sensor: sections of docs/results/residuals.md."""
import math
import pathlib

import tables

# Flights of development seeds (`evpose bench unseen --from SEED --seeds 1 --keep`) by kind of sensor. Their thresholds are
# drawn, their bandwidth and its fall in the dark are those of the kind.
FLIGHTS = {"dvxplorer, halls": (26, 39, 50, 55), "dvxplorer, outside": (22, 51, 52), "davis346": (41, 48)}
FITS = {"as it is px": "as it is", "own fit px": "own fit", "others' fit px": "fit of the others",
        "others' fit, handed on px": "that fit, as settings take it"}


def sections_of(markdown):
    """Name of a recording: its tables as rows by their first column's name."""
    found = {}
    for section in ("\n" + markdown).split("\n### ")[1:]:
        name, _, rest = section.partition("\n")
        found[pathlib.Path(name).name] = {}
        for block in rest.split("\n\n"):
            lines = [line for line in block.splitlines() if line.startswith("|")]
            if len(lines) > 2:
                head = tables.cells_of(lines[0])
                found[pathlib.Path(name).name][head[0]] = [dict(zip(head, tables.cells_of(line))) for line in lines[2:]]
    return found


def measure(bench, recordings, prepare):
    with bench.folder() as scratch:
        words = [word for r in recordings for word in ("--map", r.contours, "--occluders", r.mesh)]
        folders = [prepare(r.folder, pathlib.Path(scratch) / r.folder.name) for r in recordings]
        return sections_of(bench.run("bench", "edge-delay", *folders, *words))


def groups(bench, prepare):
    out = {"shared": bench.peers()}
    flights = {} if bench.quick else {int(f.folder.name[-4:]): f for f in bench.unseen_flights()}
    for name, seeds in FLIGHTS.items():
        there = [flights[seed] for seed in seeds if seed in flights]
        if len(there) > 1:
            out[name] = there
    return {name: bench.once(f"edge delay: {name}", lambda of=of: measure(bench, of, prepare)) for name, of in out.items()}


def fit_rows(found):
    rows = []
    for group, recordings in found.items():
        for name, one in recordings.items():
            own = one["fit"][0]
            left = next((row for row in one.get("class", []) if row["class"] == "root mean square"), {})
            rows.append([group, name, *(own[k].replace("+-", "±") for k in ("threshold", "latency on ms", "latency off ms")),
                         *(left.get(k, "-") for k in FITS)])
    return rows


def class_rows(found):
    """Root mean square over a group's recordings, as it is and with the fit of the others."""
    def cell(recordings, which):
        rows = [row for one in recordings.values() for row in one.get("class", [])
                if (row["class"], row["polarity"]) == which and int(row["events"]) >= 500]
        if not rows or "others' fit px" not in rows[0]:
            return "-"
        return ", ".join(f"{math.sqrt(sum(float(r[k]) ** 2 for r in rows) / len(rows)):.3f}" for k in
                         ("as it is px", "others' fit px")) + f" ({len(rows)})"

    first = next(iter(next(iter(found.values())).values()))
    classes = [(r["class"], r["polarity"]) for r in first["class"] if r["class"] != "root mean square"]
    return [[*which, *(cell(recordings, which) for recordings in found.values())] for which in classes]


def sections(bench, prepare):
    found = groups(bench, prepare)
    return {"edge delay": tables.table(["sensor", "recording", "threshold", "latency on ms", "latency off ms", *FITS.values()],
                                       fit_rows(found)),
            "edge delay by class": tables.table(["class", "polarity", *found], class_rows(found))}
