# SPDX-License-Identifier: BSD-3-Clause
"""Where contours that flights have told stand, beside the true ones of the simulators and beside what is printed there."""
import statistics

import numpy as np

import tables
from changed_map import MARKING, Contours

SEGMENT_M, NEAR_M = 0.12, 0.01  # of a contour, as `map learn` cuts it; between a contour that is about right and the true one
FAR_M = 0.03  # between a contour and the true one, if there is one
BOUNDARY = 2  # kind

# The landing pad's top (src/evpose/sim/world): squares about its middle, half a side each.
PAD_TOP_M, SQUARES_M = 0.3, (0.6, 0.45, 0.3, 0.15)
NEAR_PLANE_M, NEAR_PRINT_M, STEP_M = 0.02, 0.02, 0.01


def of_flight(bench, learnt, built, true, scratch):
    """Of the built contours that the flight has told: distance across from the true ones, before and after, mm; of what it
    has found anew: metres, and the same distance."""
    bench.run("map", "import", true, "-o", scratch / "true.h5")
    before, after, true = Contours(built), Contours(learnt), Contours(scratch / "true.h5")
    told = after.part(after.told_in_place())
    partner = told.beside(before, FAR_M)
    was = before.part(partner[partner >= 0])
    every = Contours(learnt)
    found = {"built": was, "learnt": told, "markings": every.part((every.looks > 0) & (every.kinds == MARKING)),
             "depth edges": every.part((every.looks > 0) & (every.kinds == BOUNDARY) & (every.beside(before, FAR_M) < 0))}
    stand = {kind: {"m": float(contours.lengths.sum()), **distances(contours.across_mm(true, FAR_M))}
             for kind, contours in found.items()}
    return {"correlation": correlation(before, true), **stand}


def correlation(built, true):
    """Of the errors across a contour, of two of its segments, as far as these are within a centimetre; nan without two."""
    partner = built.beside(true, NEAR_M)
    ways = true.places[partner] - built.places
    ways -= (ways * built.tangents).sum(1)[:, None] * built.tangents
    off = (ways * built.normals).sum(1)
    good = (partner >= 0) & (built.kinds <= BOUNDARY)
    contours = []
    for number in np.unique(built.contour[good]):
        own = np.flatnonzero((built.contour == number) & good)
        segment = (np.cumsum(built.lengths[own]) / SEGMENT_M).astype(int)
        contours.append(np.array([off[own[segment == k]].mean() for k in np.unique(segment)]))
    pairs = sum(len(c) * (len(c) - 1) for c in contours)
    if not pairs:
        return float("nan")
    every = np.concatenate(contours)
    contours = [c - every.mean() for c in contours]
    return float(sum(c.sum() ** 2 - (c ** 2).sum() for c in contours) / pairs / every.var())


def distances(values_mm):
    found = sorted(v for v in values_mm if v is not None)
    if not found:
        return {"none": 1}
    return {"mean": statistics.mean(found), "median": statistics.median(found), "p95": found[int(0.95 * len(found))],
            "none": 1 - len(found) / len(values_mm)}


def beside_prints(learnt):
    """Markings on the pad: distance across from the nearest printed line, and above the pad, mm; of the printed metres, the
    share that was found."""
    contours = Contours(learnt)
    on_pad = (contours.kinds == MARKING) & (contours.looks > 0) & (abs(contours.places[:, 2] - PAD_TOP_M) < NEAR_PLANE_M)
    on_pad &= abs(contours.places[:, :2]).max(1) < max(SQUARES_M) + 2 * NEAR_PRINT_M
    pad = contours.part(on_pad)
    lines = [(axis, sign * half, half) for half in SQUARES_M for axis in (0, 1) for sign in (-1, 1)]
    off, sigmas, beside = [], [], {line: [] for line in lines}
    for place, tangent, sigma in zip(pad.places, pad.tangents, pad.sigmas):
        near = [(abs(place[axis] - at), (axis, at, half)) for axis, at, half in lines
                if abs(tangent[axis]) < 0.2 and abs(place[1 - axis]) < half]
        if near and min(near)[0] < NEAR_PRINT_M:
            distance, line = min(near)
            off.append(1e3 * distance), sigmas.append(1e3 * float(sigma)), beside[line].append(place[1 - line[0]])
    steps = [(line, along) for line in lines for along in np.arange(-line[2] + STEP_M, line[2], STEP_M)]
    seen = sum(any(abs(along - a) < 1.5 * STEP_M for a in beside[line]) for line, along in steps)
    return {"m": float(pad.lengths.sum()), "other": 1 - len(off) / max(1, len(pad.places)), "found": seen / len(steps),
            "above_mm": statistics.mean(abs(1e3 * (pad.places[:, 2] - PAD_TOP_M)).tolist()), "nees": statistics.mean(
                (d / s) ** 2 for d, s in zip(off, sigmas)), **distances(off)}


def words(m):
    return f"{m['mean']:.2f}, {m['median']:.2f}, {m['p95']:.1f}" if "mean" in m else "-"


def moved_table(places):
    rows = [[name, words(m["built"]), words(m["learnt"]), f"{100 * m['built']['none']:.0f}, {100 * m['learnt']['none']:.0f}",
             f"{m['correlation']:.2f}"] if m else [name, "refused", "-", "-", "-"] for name, m in places.items()]
    return tables.table(["flight", "built: mean, median, p95 mm", "learnt", "none within 3 cm, built and learnt, %",
                         "correlation of a built contour's segments"], rows)


def new_table(places):
    def cells(m):
        return [f"{m['m']:.1f}", f"{100 * m['none']:.0f}" if m["m"] else "-", words(m)]
    rows = [[name, *cells(m["markings"]), *cells(m["depth edges"])] for name, m in places.items() if m]
    return tables.table(["flight", "markings m", "none within 3 cm %", "mean, median, p95 mm", "depth edges m",
                         "none within 3 cm %", "mean, median, p95 mm"], rows)


def prints_table(m):
    if "refused" in m:
        return [m["refused"]]
    return tables.table(["markings on the pad m", "beside no print %", "from the print: mean, median, p95 mm", "(error / sigma)^2",
                         "above the pad mm", "of the printed metres found %"],
                        [[f"{m['m']:.1f}", f"{100 * m['other']:.0f}", words(m), f"{m['nees']:.2f}", f"{m['above_mm']:.2f}",
                          f"{100 * m['found']:.0f}"]])
