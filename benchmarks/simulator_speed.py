# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/simulator-speed.md: processor time of the simulator per simulated second.

The difference of two flights of different length, so that what is done once per world does not count; that is given apart.
Where the time goes is sampled by perf (Debian: linux-perf), from the first block on; memory is the peak of flights of 5 and 60 s.
"""
import collections
import os
import re
import resource
import shutil
import subprocess

import harness
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


# Of functions, by the first that fits; what the compiler has put into another function counts there.
CLASSES = {
    "luminance of surfaces (texture, light)": r"Texture|luminance|baked_light|ShadeQueue|patch_view",
    "which surface each pixel shows": r"TileRaster|VisibleTriangles",
    "pixels where surfaces meet": r"TileSampler|fraction_above|border",
    "pixels without an event, knots of curves": r"StepIntegrator|SceneView",
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
    first = next(i for i, line in enumerate(lines) if "StepIntegrator" in line)
    counts = collections.Counter(next((name for name, pattern in CLASSES.items() if re.search(pattern, line)), "else")
                                 for line in lines[first:])
    return {name: f"{100 * counts[name] / counts.total():.0f}" for name in [*CLASSES, "else"]}


def peak_mib(bench, duration_s):
    """Peak resident memory of a hover."""
    with bench.folder() as scratch:
        words = ["-q", "simulate", "hover", "-o", scratch / "flight", "--duration", duration_s]
        for setting in ("size=custom", "width=160", "height=120", "focal_px=95"):
            words += ["--set", f"camera.{setting}"]
        with subprocess.Popen([str(w) for w in (bench.evpose, *words)], stdout=subprocess.DEVNULL) as child:
            _, status, usage = os.wait4(child.pid, 0)
            child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode != 0:
            raise harness.Failure(f"evpose simulate hover ended with {child.returncode}")
        return usage.ru_maxrss / 1024


def make(bench):
    rows = [bench.once(f"simulator speed: {scenario}, {size}", lambda: measure(bench, scenario, size))
            for scenario in (SCENARIOS[:1] if bench.quick else SCENARIOS)
            for size in (list(SIZES)[:1] if bench.quick else SIZES)]
    heads = ["scenario", "size", "Mev/s", "CPU s per simulated second", "CPU s for the world"]
    shares = {size: bench.once(f"simulator profile: {size}", lambda: profile(bench, size))
              for size in (list(SIZES)[:1] if bench.quick else SIZES)}
    parts = [[name, *(share[name] for share in shares.values())] for name in [*CLASSES, "else"]]
    memory = [[f"{length} s", f"{bench.once(f'simulator memory: {length} s', lambda: peak_mib(bench, length)):.0f}"]
              for length in ((1, 2) if bench.quick else (5, 60))]
    return bench.write_page("simulator-speed", {
        "speed": tables.table(heads, rows),
        "profile": tables.table([f"{SCENARIOS[0]}, % of CPU", *(SIZES[size] for size in shares)], parts),
        "memory": tables.table(["hover, 160x120", "peak memory, MiB"], memory)})
