# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/simulator-speed.md: processor time of the simulator per simulated second.

The difference of two flights of different length, so that what is done once per world does not count; that is given apart.
"""
import re
import resource

import tables

SCENARIOS = ["indoor_spiral", "landing", "outdoor_spiral"]
SIZES = {"vga": "640x480", "720p": "1280x720"}
SHORT_S, LONG_S = 0.1, 0.5


def cpu_s(bench, scenario, size, duration_s):
    """Processor seconds and events of a flight."""
    with bench.folder() as scratch:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        said = bench.run("simulate", scenario, "-o", scratch / "flight", "--duration", duration_s, "--set",
                         f"camera.size={size}")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        events = float(re.search(r"([\d.]+) million events", said).group(1))
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, events


def measure(bench, scenario, size):
    short_s, few = cpu_s(bench, scenario, size, SHORT_S)
    long_s, many = cpu_s(bench, scenario, size, LONG_S)
    per_second = (long_s - short_s) / (LONG_S - SHORT_S)
    rate = (many - few) / (LONG_S - SHORT_S)
    return [scenario, SIZES[size], f"{rate:.1f}", f"{per_second:.1f}", f"{short_s - SHORT_S * per_second:.1f}"]


def make(bench):
    rows = [bench.once(f"simulator speed: {scenario}, {size}", lambda: measure(bench, scenario, size))
            for scenario in (SCENARIOS[:1] if bench.quick else SCENARIOS)
            for size in (list(SIZES)[:1] if bench.quick else SIZES)]
    heads = ["scenario", "size", "Mev/s", "CPU s per simulated second", "CPU s for the world"]
    return bench.write_page("simulator-speed", {"speed": tables.table(heads, rows)})
