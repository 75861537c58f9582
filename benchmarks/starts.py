# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/starts.md: starts from wrong poses on shared and unseen recordings, with true contours and with maps of clouds."""
import json
import shutil
import statistics

import harness
import learn
import tables

CLASSES = {"5 cm, 0.5 deg": 99, "10 cm, 2 deg": 98, "30 cm, 5 deg": 97, "50 cm, 10 deg": 95, "GPS-like": 90, "anywhere": 80}
BUILT_LESS = 5  # per cent
SEEDS = 40
FLIGHTS, MOST_MEV_S, WIDTH = 6, 15, 640
FOLDER_FILES = ("events.h5", "imu.csv", "imu.yaml", "groundtruth.tum", "contours.ply", "mesh.ply")


def unseen(bench):
    """The first flights of the reporting seeds at VGA and up to 15 Mev/s."""
    def fits(flight):
        told = json.loads((flight.folder / "flight.json").read_text())
        camera = (flight.folder / "camchain-imucam_truth.yaml").read_text()
        return f"[{WIDTH}, " in camera and told["mev_s"] <= MOST_MEV_S
    return [flight for flight in bench.unseen_flights() if fits(flight)][:FLIGHTS]


def starts(bench, folder, name, seeds, contours=None):
    """Rows of `evpose bench relocalize`, by class."""
    classes = [name.split(",")[0].split("-")[0].split(" ")[0] for name in CLASSES]
    chosen = ["--map", contours] if contours else []
    printed = bench.run("bench", "relocalize", folder, "--only", name, "--seeds", seeds, "--starts", ",".join(classes),
                        "--threads", 1, *chosen)
    return {row["start off by"]: row for row in tables.read(printed)[""]}


def linked(scratch, flight):
    """Name of a folder in `scratch` with the flight and its true calibration."""
    folder = scratch / flight.folder.name
    folder.mkdir()
    for name in FOLDER_FILES:
        (folder / name).symlink_to((flight.folder / name).resolve())
    shutil.copy(flight.folder / "camchain-imucam_truth.yaml", folder / "camchain-imucam.yaml")
    return folder.name


def in_true_map(bench, recording, seeds):
    return starts(bench, recording.folder.parent, recording.name, seeds)


def of_flight(bench, flight, seeds, contours=None):
    with bench.folder() as scratch:
        return starts(bench, scratch, linked(scratch, flight), seeds, contours)


def in_built_map(bench, recording, seeds):
    with bench.folder() as scratch:
        bench.run("map", "build", learn.cloud_of(bench, recording), "-o", scratch / "built.h5")
        return starts(bench, recording.folder.parent, recording.name, seeds, scratch / "built.h5")


def shown(row):
    wrong, beyond = row["wrong called tracking"], row["ever tracking and beyond 3 sigma"]
    return f"{row['locked']}, {wrong}, {row['not found']}, {beyond}"


def cells(measured):
    return tables.table(["recording", *CLASSES], [[name, *(shown(rows[c]) for c in CLASSES)] for name, rows in measured.items()])


def summary(measured, seeds, less=0):
    lines = []
    for name, goal in CLASSES.items():
        rows = [rows[name] for rows in measured.values()]

        def total(column):
            return sum(int(row[column]) for row in rows)
        lines.append([name, len(rows) * seeds, f"{100 * total('locked') / (len(rows) * seeds):.0f} %", f"{goal - less} %",
                      total("wrong called tracking"), total("ever tracking and beyond 3 sigma"), total("not found"),
                      f"{statistics.median(float(row['search ms p50']) for row in rows):.0f}",
                      f"{max(float(row['p95']) for row in rows):.0f}"])
    return tables.table(["start off by", "starts", "locked", "goal", "wrong called `tracking`", "ever `tracking` beyond 3 sigma",
                         "not found", "search ms: median of p50", "largest p95"], lines)


def make(bench):
    seeds = 1 if bench.quick else SEEDS

    def once(recording, kind, measure, *more):
        return bench.once(f"starts: {recording.name}, {kind}, {seeds}", lambda: measure(bench, recording, seeds, *more))

    flights = unseen(bench)
    true = {r.name: once(r, "true", in_true_map) for r in bench.peers()}
    true |= {f.name: once(f, "true", of_flight) for f in flights}
    built = {r.name: once(r, "built", in_built_map) for r in bench.peers()}
    maps = {f: f.folder / "map.h5" for f in flights}
    built |= {f.name: once(f, "built", of_flight, path) for f, path in maps.items() if path.exists()}
    return bench.write_page("starts", {
        "recordings": cells(true), "together": summary(true, seeds),
        "built": cells(built), "built together": summary(built, seeds, BUILT_LESS)}, harness.machine())
