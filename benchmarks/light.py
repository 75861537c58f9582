# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/light.md: flights in which lamps go off and on, or the light steps; of the scenario's seed and of seeds that
no default was chosen on."""
import harness
import simulator
import tables

SEEDS = (101, 102)
STEP = ("lamps.off_factor=0.3", "lamps.fade_ms=20")


def flights():
    changes = {"lamps off and on": (), "step to 30 % and back": STEP}
    return [simulator.Flight(f"{name}, {who}", "hdr_lights_off", (*simulator.SMALL, *simulator.LAMPS, *settings, *seeds))
            for name, settings in changes.items()
            for who, seeds in [("the scenario's seed", ()), *((f"seed {s}", harness.seeds(s)) for s in SEEDS)]]


def make(bench):
    rows = [simulator.row(flight.name, bench.once(f"light: {flight}", lambda: simulator.measure(bench, flight)))
            for flight in (flights()[:1] if bench.quick else flights())]
    heads = ["flight", "status", "coverage", "ATE mean mm", "max mm", "ARE mean deg", "NEES/6"]
    return bench.write_page("light", {"flights": tables.table(heads, rows)})
