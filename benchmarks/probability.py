# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/probability.md: how probable it is that a pose is right, fitted on development flights, judged on others.

Starts from the true pose with what cannot be tracked, and from poses that are 10 cm off and have to be searched
(`evpose bench relocalize --looks`). Each update's look at the contours is right or wrong; PoseProbability's weights are a
logistic regression of the clear ones.
"""
import csv
import io

import numpy as np

import harness
import starts
import tables

SEEDS = 1
FLIGHTS = 16  # quick ones, of development seeds
THINNED = 4   # updates of a start: neighbouring ones look alike
STARTS = "wrong,10"
NEAR_MM, NEAR_MRAD, FAR_MM, SIGMAS = 30, 20, 200, 3
MOST_RATIO, LEAST_RATIO = 10, 0.05
WEIGHTS = ["1", "ln ratio", "(ln ratio)^2", "ln worst ratio", "explained", "log10 pieces", "concentration"]
LIMITS = [0, 0.1, 0.5, 0.9, 0.99, 0.999, 1.0000001]


def thinned(text):
    """The looks, as rows of the file, every fourth of a start."""
    rows = list(csv.DictReader(io.StringIO(text)))
    return [row for number, row in enumerate(rows) if number % THINNED == 0]


def measure(bench, folder, names, seeds, contours=None):
    """What `bench relocalize` prints, and its looks."""
    with bench.folder() as scratch:
        file = scratch / "looks.csv"
        chosen = ["--map", contours] if contours else []
        printed = bench.run("bench", "relocalize", folder, "--only", ",".join(names), "--seeds", seeds, "--starts", STARTS,
                            "--looks", file, *chosen)
        return {"printed": printed, "looks": thinned(file.read_text())}


def of_flights(bench, flights, seeds, built):
    """With their true calibration; one at a time with the maps of their clouds, all at once with their true contours."""
    with bench.folder() as scratch:
        names = [starts.linked(scratch, flight) for flight in flights]
        if not built:
            return measure(bench, scratch, names, seeds)
        parts = [measure(bench, scratch, [name], seeds, flight.folder / "map.h5")
                 for name, flight in zip(names, flights) if (flight.folder / "map.h5").exists()]
        return {"printed": "".join(part["printed"] for part in parts), "looks": [row for part in parts for row in part["looks"]]}


def development(bench):
    """Quick flights of development seeds, made if they are not there."""
    folder, count = bench.scratch / "recordings/development", 1 if bench.quick else FLIGHTS
    if len(list(folder.glob("quick_flight_*/flight.json"))) < count:
        with bench.folder() as scratch:
            bench.run("bench", "unseen", "--quick", "--seeds", count, "--keep", folder, "-o", scratch / "results")
    return [harness.Recording(f.name, f, f / "contours.ply", f / "mesh.ply")
            for f in sorted(folder.glob("quick_flight_*"))[:count]]


def is_right(row):
    near = float(row["error_mm"]) < NEAR_MM and float(row["error_mrad"]) < NEAR_MRAD
    return near or float(row["sigmas"]) < SIGMAS


def is_mirrored(row):
    return row["start"] == "mirrored map"


def features(row):
    ratio = np.log(max(float(row["ratio"]), LEAST_RATIO))
    worst = np.log(np.clip(float(row["worst_ratio"]), LEAST_RATIO, MOST_RATIO))
    return [1, ratio, ratio * ratio, worst, float(row["explained"]), np.log10(max(float(row["pieces"]), 1)),
            float(row["gate_concentration"])]


def fitted(rows):
    """Weights of a logistic regression, right and wrong looks counting alike, and how many there are of each. In a mirrored map
    some of what is in view is right; what is neither near nor far is left out, too."""
    clear = []
    for row in rows:
        error_mm, nothing_to_find = float(row["error_mm"]), row["start"] in ("map of another place", "white noise for events")
        if row["accepted"] == "1" and not is_mirrored(row) and (nothing_to_find or not NEAR_MM < error_mm < FAR_MM):
            clear.append((row, error_mm < NEAR_MM and not nothing_to_find))
    A = np.array([features(row) for row, _ in clear])
    right = np.array([float(near) for _, near in clear])
    weight = np.where(right == 1, 0.5 / right.mean(), 0.5 / (1 - right.mean()))
    scale = A.std(axis=0)
    scale[0] = 1
    Z, b = A / scale, np.zeros(A.shape[1])
    for _ in range(100):
        p = 1 / (1 + np.exp(-np.clip(Z @ b, -30, 30)))
        curvature = (Z * (weight * p * (1 - p) + 1e-9)[:, None]).T @ Z + 1e-5 * len(right) * np.eye(len(b))
        b += np.linalg.solve(curvature, Z.T @ (weight * (right - p)) - 1e-5 * len(right) * b)
    return b / scale, int(right.sum()), int(len(right) - right.sum())


def reliability(kinds):
    """By the probability that was told: looks, and how many of them are right."""
    lines = []
    for low, high in zip(LIMITS, LIMITS[1:]):
        cells = []
        for rows in kinds.values():
            told = [is_right(row) for row in rows if low <= float(row["probability"]) < high]
            cells += [len(told), f"{100 * sum(told) / len(told):.1f} %" if told else "-"]
        lines.append([f"{low:g} to {min(high, 1):g}", *cells])
    return tables.table(["probability", *(f"{kind}: {what}" for kind in kinds for what in ("looks", "right"))], lines)


def called_tracking(kinds):
    """Starts with an update that is called `tracking` and is wrong."""
    lines = []
    for kind, rows in kinds.items():
        tracking = [row for row in rows if row["health"] == "tracking"]
        wrong = [row for row in tracking if not is_right(row)]
        of = {(row["recording"], row["start"], row["seed"]) for row in wrong}
        everything = {(row["recording"], row["start"], row["seed"]) for row in rows}
        lines.append([kind, len(everything), len(tracking), len(wrong), len(of)])
    return tables.table(["starts", "number", "looks called `tracking`", "of these wrong", "in so many starts"], lines)


def without_mirrors(rows):
    return [row for row in rows if not is_mirrored(row)]


def make(bench):
    seeds = 1 if bench.quick else SEEDS
    flights = development(bench)
    learnt = [bench.once(f"probability: development, built {built}, {seeds}",
                         lambda b=built: of_flights(bench, flights, seeds, b)) for built in (False, True)]
    weights, right, wrong = fitted([row for part in learnt for row in part["looks"]])
    judged = {}
    unseen = starts.unseen(bench)
    for kind, built in (("true contours", False), ("built maps", True)):
        judged[kind] = bench.once(f"probability: unseen, {kind}, {seeds}", lambda b=built: of_flights(bench, unseen, seeds, b))["looks"]
    shared = bench.once(f"probability: shared, {seeds}",
                        lambda: measure(bench, bench.shared / "data/peer", [r.name for r in bench.peers()], seeds))["looks"]
    judged["shared, true contours"] = shared
    kinds = {kind: without_mirrors(rows) for kind, rows in judged.items()}
    mirrored = {f"{kind}, mirrored": [row for row in rows if is_mirrored(row)] for kind, rows in judged.items()}
    return bench.write_page("probability", {
        "weights": [f"{right} right and {wrong} wrong looks:", "",
                    *tables.table(WEIGHTS, [[f"{w:.2f}" for w in weights]])],
        "reliability": reliability(kinds), "tracking": called_tracking(kinds | mirrored)})
