# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/paper-flights.md: from the paper's form to the defaults on simulated flights in hard light and with moving
things; and the flights of the classes of speed and of turning."""
import dataclasses

import harness
import paper_evaluation
import tables

SECONDS = 5
SEEDS = (101, 102)  # that no default was chosen on
LAMPS = (f"lamps.off_at_s={0.4 * SECONDS}", f"lamps.on_at_s={0.7 * SECONDS}")
# Name: scenario, settings of its own.
HARD = {"hdr_window": ("hdr_window", ()), "hdr_lights_off": ("hdr_lights_off", LAMPS), "hdr_flicker": ("hdr_flicker", ()),
        "fan": ("fan", ()), "people": ("people", ()),
        "crowd": ("people", ("world.movers.people=8", "world.movers.fans=2"))}
CLASSES = ["speed_1", "speed_2", "speed_3", "turning_1", "turning_2", "turning_3"]
HEAD = ["class", "form", *(f"seed {seed}: mean ATE mm, mean ARE deg, % with a pose" for seed in SEEDS), "mean",
        "largest ATE mm"]


def flight(bench, scenario, seed, settings=()):
    seeds = harness.seeds(seed)
    return bench.simulated(scenario, SECONDS, (*harness.TINY, *settings, *seeds), f"paper_{scenario}")


def hard(bench):
    """Flights in hard light and with moving things."""
    for name in ["hdr_window"] if bench.quick else HARD:
        scenario, settings = HARD[name]
        yield dataclasses.replace(flight(bench, scenario, SEEDS[0], settings), name=name)


def mean_errors(measured):
    """Over the seeds that were scored: their means, and the largest error of all."""
    scored = [m["accuracy"] for m in measured if m["accuracy"].get("ate_mean_mm") is not None]
    if not scored:
        return ["-", "-"]
    ate, are = (sum(a[key] for a in scored) / len(scored) for key in ("ate_mean_mm", "are_mean_deg"))
    return [f"{ate:.2f}, {are:.3f}", f"{max(a['ate_max_mm'] for a in scored):.1f}"]


def classes(bench):
    """The paper's form and the defaults at three speeds and three rates of turning."""
    rows = []
    for name in CLASSES[3:4] if bench.quick else CLASSES:
        flights = [dataclasses.replace(flight(bench, name, seed), name=f"{name}, {seed}")
                   for seed in (SEEDS[:1] if bench.quick else SEEDS)]
        for form in paper_evaluation.FORMS:
            measured = [paper_evaluation.measure(bench, f, form) for f in flights]
            cells = [paper_evaluation.errors(m) for m in measured] + ["-"] * (len(SEEDS) - len(measured))
            rows.append([name, form, *cells, *mean_errors(measured)])
    return tables.table(HEAD, rows)
