# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/simulator-speed.md: processor time of the simulator per simulated second.

The difference of two flights of different length, so that what is done once per world does not count; that is given apart.
Where the time goes is sampled by perf (Debian: linux-perf), from the first block on. Memory, pace and disk are those of whole
flights. With `--older PROGRAM` that is measured as well, and flights that both programs make are tracked by this one.
"""
import argparse
import collections
import os
import re
import resource
import shutil
import statistics
import subprocess
import time

import compare_simulators
import harness
import tables

SCENARIOS = ["indoor_spiral", "landing", "outdoor_spiral"]
SIZES = {"vga": "640x480", "720p": "1280x720"}
SHORT_S, LONG_S = 0.1, 0.5
COMPARED = argparse.Namespace(duration=2, size="vga")
COMPARED_SEEDS = 10
LONG_FLIGHTS_S = (5, 60)


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


# Of functions, by the first that fits; what the compiler has put into another function counts there.
CLASSES = {
    "luminance of surfaces (texture, light)": r"Texture|luminance|baked_light|ShadeQueue|patch_view",
    "which surface each pixel shows": r"TileRaster|VisibleTriangles|RayCaster|embree|rtc[A-Z]",
    "pixels where surfaces meet": r"TileSampler|fraction_above|border",
    "pixels without an event, knots of curves": r"StepIntegrator|PixelIntegrator|SceneView",
    "events: low pass, thresholds, times": r"EventPixels|fast_log|LowPass",
    "sorting and read-out": r"collect|RowRequests|EventQueue|ReadOut|Arbiter|sort",
    "compression and writing": r"libz\.|libhdf5|Writer|Hdf5",
}


def profile(bench, size):
    """Share of each class in the processor time of a flight on one thread, once its world is made."""
    if shutil.which("perf") is None:
        raise harness.Failure("perf is not installed: install linux-perf")
    with bench.folder() as scratch:
        data = scratch / "perf.data"
        subprocess.run(["perf", "record", "-q", "-F", "300", "-o", data, bench.evpose, "-q", "simulate", SCENARIOS[0], "-o",
                        scratch / "flight", "--duration", "0.15", "--threads", "1", "--set", f"camera.size={size}"],
                       check=True, capture_output=True)
        lines = subprocess.run(["perf", "script", "-i", data, "-F", "ip,sym,dso"], capture_output=True, text=True,
                               check=True).stdout.splitlines()
    first = next(i for i, line in enumerate(lines) if re.search("StepIntegrator|PixelIntegrator", line))
    counts = collections.Counter(next((name for name, pattern in CLASSES.items() if re.search(pattern, line)), "else")
                                 for line in lines[first:])
    return {name: f"{100 * counts[name] / counts.total():.0f}" for name in [*CLASSES, "else"]}


def long_flight(bench, duration_s):
    """Peak resident memory in MiB, wall time per simulated second and MiB on the disk of a hover."""
    with bench.folder() as scratch:
        words = ["-q", "simulate", "hover", "-o", scratch / "flight", "--duration", duration_s]
        for setting in harness.TINY:
            words += ["--set", setting]
        start = time.monotonic()
        with subprocess.Popen([str(w) for w in (bench.evpose, *words)], stdout=subprocess.DEVNULL) as child:
            _, status, usage = os.wait4(child.pid, 0)
            child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode != 0:
            raise harness.Failure(f"evpose simulate hover ended with {child.returncode}")
        written = sum(path.stat().st_size for path in (scratch / "flight").rglob("*") if path.is_file())
        return [usage.ru_maxrss / 1024, (time.monotonic() - start) / duration_s, written / 2**20]


def speeds(bench):
    """A row of measure() for each scenario and size."""
    return [bench.once(f"simulator speed: {scenario}, {size}", lambda: measure(bench, scenario, size))
            for scenario in (SCENARIOS[:1] if bench.quick else SCENARIOS)
            for size in (list(SIZES)[:1] if bench.quick else SIZES)]


def profiles(bench):
    """A row for each class, a column for each size."""
    shares = {size: bench.once(f"simulator profile: {size}", lambda: profile(bench, size))
              for size in (list(SIZES)[:1] if bench.quick else SIZES)}
    parts = [[name, *(share[name] for share in shares.values())] for name in [*CLASSES, "else"]]
    return tables.table([f"{SCENARIOS[0]}, % of CPU", *(SIZES[size] for size in shares)], parts)


def beside(older, now):
    """Processor time of both programs."""
    rows = [[*row[:2], row[2], then[2], row[3], then[3], f"{float(then[3]) / float(row[3]):.1f}"]
            for row, then in zip(now, speeds(older))]
    return tables.table(["scenario", "size", "Mev/s", "older", "CPU s per simulated second", "older", "times as fast"], rows)


def films(older, bench):
    """Flights of one scenario from ten seeds, made by both programs and tracked by this one."""
    rows, all_figures = [], []
    for seed in range(1, (1 if bench.quick else COMPARED_SEEDS) + 1):
        figures = [bench.once(f"simulator film: {seed}, {harness.digest(program.read_bytes())}", lambda p=program:
                              compare_simulators.fly(p, bench.evpose, SCENARIOS[0], seed, COMPARED))
                   for program in (older.evpose, bench.evpose)]
        all_figures.append(figures)
        rows.append([str(seed), *(f"{figure:.2f}" for pair in zip(*figures) for figure in pair)])
    means = [statistics.mean(figures[program][what] for figures in all_figures) for what in (0, 1) for program in (0, 1)]
    rows.append(["mean", *(f"{mean:.2f}" for mean in means)])
    rows.append(["change, %", "", f"{100 * (means[1] / means[0] - 1):+.1f}", "", f"{100 * (means[3] / means[2] - 1):+.1f}"])
    return tables.table(["seed", "million events, older", "now", "mean ATE mm, older", "now"], rows)


def make(bench):
    rows = speeds(bench)
    heads = ["scenario", "size", "Mev/s", "CPU s per simulated second", "CPU s for the world"]
    long_flights = [[f"{length} s", *(f"{figure:.1f}" for figure in
                                      bench.once(f"simulator long: {length} s", lambda: long_flight(bench, length)))]
                    for length in ((1, 2) if bench.quick else LONG_FLIGHTS_S)]
    figures = {"speed": tables.table(heads, rows), "profile": profiles(bench),
               "long flights": tables.table(["hover, 320x240", "peak memory, MiB", "s per simulated second", "MiB on the disk"],
                                            long_flights)}
    older = bench.of_older_program()
    if older is not None:
        figures |= {"older": beside(older, rows), "older profile": profiles(older), "films": films(older, bench)}
    return bench.write_page("simulator-speed", figures)
