# SPDX-License-Identifier: BSD-3-Clause
"""What `evpose bench edge-delay` finds for sensors, and what its parameters leave over on other recordings of the same
sensor: sections of docs/results/residuals.md."""
import dataclasses
import math
import pathlib
import re

import light
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
    if not bench.quick:  # threshold 0.25
        out["simulated hall"] = [dataclasses.replace(bench.simulated(f.scenario, f.seconds, f.settings), name=f.name)
                                 for f in light.flights()]
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


def latency_ms(fit, name):
    """That which a fit gives both polarities, by the name of its row; None where there is none."""
    row = next((r for r in fit if r["fit"] == name), None)
    return row and sum(float(row[f"latency {which} ms"].split()[0]) for which in ("on", "off")) / 2


def tracked(bench, flight, prepare, late_ms):
    """ATE mm, NEES/6 with true contours and the true calibration, of which so much is taken off the time offset."""
    with bench.folder() as scratch:
        folder = prepare(flight.folder, pathlib.Path(scratch) / "flight")
        path = folder / "camchain-imucam.yaml"
        text = re.sub(r"(timeshift_cam_imu: )(\S+)", lambda m: f"{m[1]}{float(m[2]) - 1e-3 * late_ms:.7f}", path.read_text())
        path.unlink()
        path.write_text(text)
        summary = bench.track(folder, flight.contours, scratch / "run", "--occluders", flight.mesh, "--init", "groundtruth")
        later = bench.later_accuracy(scratch / "run", flight.truth)
    return f"{later['ate_mean_mm']:.2f}, {summary.get('accuracy', {}).get('nees6_mean', float('nan')):.2f}"


def latency_rows(bench, found, prepare):
    flights = {} if bench.quick else {f.folder.name: f for f in bench.unseen_flights()}
    rows = []
    for group, recordings in found.items():
        for name in [name for name in recordings if name in flights]:
            fit = recordings[name]["fit"]
            late = [0, latency_ms(fit, "its own"), latency_ms(fit, "of the others, handed on")]
            rows.append([group, name, *(bench.once(f"edge delay: {name} tracked, {ms} ms",
                                                   lambda ms=ms: tracked(bench, flights[name], prepare, ms)) for ms in late)])
    return rows


def sections(bench, prepare):
    found = groups(bench, prepare)
    return {"latency": tables.table(["sensor", "flight", "as it is", "less its own latency", "less that of the others"],
                                    latency_rows(bench, found, prepare)),
            "edge delay": tables.table(["sensor", "recording", "threshold", "latency on ms", "latency off ms", *FITS.values()],
                                       fit_rows(found)),
            "edge delay by class": tables.table(["class", "polarity", *found], class_rows(found))}
