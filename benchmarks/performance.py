# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/performance.md: kernels and decoders by themselves, in processor time of one core (evpose_microbench)."""
import json
import os
import subprocess

import harness
import tables

REPETITIONS = 5
FIELDS = {0: "each event once", 1: "the paper's field"}
LAYOUTS = {"layout_packed": "packed, 8 bytes: `Event`", "layout_plain": "plain struct, 16 bytes",
           "layout_columns": "one array per field, 13 bytes"}


def measure(bench, kernels, repetitions=REPETITIONS):
    """Runs of the kernels whose names match, by name; each a list of what Google Benchmark says of a repetition."""
    if not bench.microbench.exists():
        raise harness.Failure(f"{bench.microbench} is not there; cmake --preset bench && "
                              "cmake --build --preset bench --target evpose_microbench")

    def run():
        words = [bench.microbench, f"--benchmark_filter={kernels}", "--benchmark_format=json",
                 f"--benchmark_repetitions={1 if bench.quick else repetitions}", "--benchmark_report_aggregates_only=false"]
        done = subprocess.run([str(w) for w in words], capture_output=True, text=True,
                              env={**os.environ, "EVPOSE_SHARED": str(bench.shared)})
        if done.returncode != 0:
            raise harness.Failure(f"evpose_microbench: {harness.last_line(done.stderr)}")
        return [b for b in json.loads(done.stdout)["benchmarks"] if b.get("run_type") == "iteration"]

    out = {}
    for one in bench.once(f"performance: {kernels}, {harness.digest(bench.microbench.read_bytes())[:12]}", run):
        out.setdefault(one["run_name"], []).append(one)
    return out


def arguments(name):
    """Of a kernel's name: width:640/height:480/..."""
    return {key: int(value) for key, _, value in (part.partition(":") for part in name.split("/")[1:]) if value.isdigit()}


def span(values, digits=0):
    """The least and the largest, or the one number that they are."""
    low, high = f"{min(values):.{digits}f}", f"{max(values):.{digits}f}"
    return low if low == high else f"{low}-{high}"


def of(runs, counter):
    return [run[counter] for run in runs]


def image(a):
    return f"{a['width']}x{a['height']}"


def front_table(kernels):
    rows = {}
    for name, runs in kernels.items():
        a = arguments(name)
        rows.setdefault(image(a), {})[f"{a['Mev_s_in']} Mev/s"] = f"{span(of(runs, 'Mev/s'))} Mev/s"
    return tables.transposed(rows, str, "image")


def update_table(kernels):
    rows = []
    for name, runs in kernels.items():
        a = arguments(name)

        def quantiles(stage):
            return " / ".join(span(of(runs, f"{stage}_{q}_ms"), 2) for q in ("p50", "p99"))

        rows.append([image(a), f"{a['Mev_s_in']} Mev/s", FIELDS[a["temporal_field"]], f"{runs[0]['points']:.0f}",
                     quantiles("register"), quantiles("choose"), quantiles("pose"), span(of(runs, "events_p50_ms"), 2)])
    return tables.table(["image", "load", "field", "points", "registration", "choice of points", "newest event to pose",
                         "filter and surfaces"], rows)


def choice_table(kernels):
    return tables.table(["image", "points in the map", "points chosen", "one choice, ms"],
                        [[image(arguments(name)), f"{runs[0]['map_points']:.0f}", f"{runs[0]['points']:.0f}",
                          span(of(runs, "cpu_time"), 1)] for name, runs in kernels.items()])


def decode_table(kernels):
    rows = [[name.removeprefix("decode/"), f"{runs[0]['bytes/event']:.1f}" if "bytes/event" in runs[0] else "-",
             span(of(runs, "Mev/s")), span(of(runs, "MB/s"))] for name, runs in kernels.items()]
    return tables.table(["what", "bytes an event", "Mev/s", "MB/s"], rows)


def make(bench):
    dense = measure(bench, "^dense_surface")
    layouts = measure(bench, "^layout_")
    kinds = "^decode/(memory_copy|synthetic DAT)" if bench.quick else "^decode/"
    figures = {
        "front": front_table(measure(bench, "^front/")),
        "dense surface": tables.table(["image", "ms"], [[image(arguments(name)), span(of(runs, "cpu_time"), 1)]
                                                        for name, runs in dense.items()]),
        "layouts": tables.table(["layout", "Mev/s"], [[LAYOUTS[name], span(of(runs, "Mev/s"))]
                                                      for name, runs in layouts.items()]),
        "update": update_table(measure(bench, "^update/", 2)),
        "choice": choice_table(measure(bench, "^visible_refresh/", 2)),
        "decoding": decode_table(measure(bench, kinds)),
    }
    return bench.write_page("performance", figures, harness.machine())
