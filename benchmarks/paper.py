# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/paper.md: from the paper's form to the defaults, one replacement at a time, on the shared
recordings; and the pages beside it."""
import experiments
import paper_evaluation
import paper_flights
import paper_maps
import paper_order
import tables

OF_MAP = "paper: signs of the map alone"
QUICK = ["paper: both"]
# The paper's comparison of its parts and of frameworks.
PARTS = ["paper: STPE alone", "paper: STPE and early stage", "paper: particle filter", "paper: EKF", "paper"]
EARLY_STAGE = ["paper", OF_MAP, "paper: both polarities everywhere", "paper: no buffer zone", "paper: eta 30 ms"]


def measure(bench, recording):
    """Rows of `evpose bench paper` by variant. The signs of the map are those that the defaults learn on the same flight:
    their maps state none."""
    rows = experiments.variants(bench, "paper", recording, *(QUICK if bench.quick else []))
    if bench.quick:
        return rows

    def with_signs():
        with bench.folder() as scratch:
            learnt = scratch / "learnt.h5"
            bench.track(recording.folder, recording.contours, scratch / "run", "--occluders", recording.mesh,
                        "--learn-map", learnt)
            return bench.run("bench", "paper", "--recording", recording.folder, "--map", learnt, "--occluders",
                             recording.mesh, "--variant", OF_MAP)

    printed = bench.once(f"paper: {recording.name}, signs of the map", with_signs)
    (signed,) = tables.read(printed).values()
    return rows | {OF_MAP: signed[0]}


def errors(row):
    return f"{row['ATE mean mm']}, {row['ARE mean deg']}, {row['tracked %']}"


def filtered(row):
    return f"{row['noise %']}, {row['wrong polarity %']}"


def mean(measured, names, column):
    """Over the recordings, of each variant."""
    values = {name: [float(rows[name][column]) for rows in measured.values() if name in rows] for name in names}
    return {name: sum(v) / len(v) for name, v in values.items() if v}


def section(measured, names):
    part = {recording: {n: rows[n] for n in names if n in rows} for recording, rows in measured.items()}
    if not any(part.values()):
        return ["-"]
    ate, are = mean(measured, names, "ATE mean mm"), mean(measured, names, "ARE mean deg")
    lines = tables.pivot(part, errors)
    lines[0] += " mean |"
    lines[1] += "---|"
    for i, line in enumerate(lines[2:], 2):
        name = tables.cells_of(line)[0]
        lines[i] += f" {ate[name]:.2f}, {are[name]:.3f} |"
    return ["Mean ATE mm, mean ARE deg, % of updates called `tracking`:", "", *lines, "",
            "% of events that the noise filter drops, % of those at contours left out for polarity:", "",
            *tables.pivot(part, filtered)]


def make(bench):
    measured = {recording.name: measure(bench, recording) for recording in bench.peers()}
    return bench.write_page("paper", {"steps": section(measured, steps_of(measured)), "parts": section(measured, PARTS),
                                      "early stage": section(measured, EARLY_STAGE), "order": paper_order.section(bench)})


def steps_of(measured):
    names = dict.fromkeys(name for rows in measured.values() for name in rows)
    return ["paper", *(name for name in names if name[0].isdigit())]


def make_flights(bench):
    """docs/results/paper-flights.md"""
    measured = {flight.name: measure(bench, flight) for flight in paper_flights.hard(bench)}
    return bench.write_page("paper-flights", {"steps": section(measured, steps_of(measured)),
                                              "parts": section(measured, PARTS),
                                              "early stage": section(measured, EARLY_STAGE)})


def make_classes(bench):
    """docs/results/paper-classes.md"""
    return bench.write_page("paper-classes", {"classes": paper_flights.classes(bench)})


def make_map(bench):
    """docs/results/paper-map.md"""
    return bench.write_page("paper-map", paper_maps.sections(bench))


def make_corners(bench):
    """docs/results/paper-corners.md"""
    only = ",".join(recording.name for recording in bench.peers())
    printed = bench.once("paper corners",
                         lambda: bench.run("bench", "corners", bench.shared / "data/peer", "--only", only))
    return bench.write_page("paper-corners", {"corners": printed.strip().splitlines()})


def make_evaluation(bench):
    """docs/results/paper-evaluation.md: distributions, relative errors, rates."""
    return bench.write_page("paper-evaluation", paper_evaluation.sections(bench))
