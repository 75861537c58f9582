#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Whether a change of the simulator changes what it makes: flights of two programs side by side.

    benchmarks/compare_simulators.py OLD NEW [--seeds 10] [--scenarios indoor_spiral ...] [--duration 1.5]

OLD and NEW are evpose programs; flights of both are tracked by NEW. Prints a line per scenario and seed, and how the means
of NEW lie to those of OLD. Exit status 1 where the events differ by more than 1 % or the mean error by more than 5 %.
"""
import argparse
import json
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile


def run(program, *words):
    done = subprocess.run([str(w) for w in (program, "-q", *words)], capture_output=True, text=True,
                          stdin=subprocess.DEVNULL)
    if done.returncode not in (0, 1):
        sys.exit(f"{program} {' '.join(str(w) for w in words)}: {done.stderr.strip()}")
    return done.stdout


def fly(program, tracker, scenario, seed, options):
    """Million events and mean position error in mm."""
    with tempfile.TemporaryDirectory() as scratch:
        flight, out = pathlib.Path(scratch) / "flight", pathlib.Path(scratch) / "run"
        said = run(program, "simulate", scenario, "-o", flight, "--seed", seed, "--duration", options.duration, "--set",
                   f"camera.size={options.size}")
        run(tracker, "track", flight, "--map", flight / "contours.ply", "--occluders", flight / "mesh.ply", "-o", out, "--set",
            "fusion.calibration.on=false")  # some programs state that their calibration is exact, others nothing
        accuracy = json.loads((out / "summary.json").read_text())["accuracy"]
        return float(re.search(r"([\d.]+) million events", said).group(1)), accuracy["ate_mean_mm"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", type=pathlib.Path)
    parser.add_argument("new", type=pathlib.Path)
    parser.add_argument("--scenarios", nargs="+", default=["indoor_spiral", "outdoor_spiral", "landing", "speed_2"])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--duration", type=float, default=1.5)
    parser.add_argument("--size", default="vga")
    options = parser.parse_args()
    flights = {"old": [], "new": []}
    for scenario in options.scenarios:
        for seed in range(1, options.seeds + 1):
            for name, program in (("old", options.old), ("new", options.new)):
                flights[name].append(fly(program, options.new, scenario, seed, options))
            (old_events, old_mm), (new_events, new_mm) = flights["old"][-1], flights["new"][-1]
            print(f"{scenario} {seed}: {old_events:.3f} -> {new_events:.3f} million events, ATE {old_mm:.2f} -> "
                  f"{new_mm:.2f} mm", flush=True)
    change = [statistics.mean(new) / statistics.mean(old) - 1
              for old, new in zip(zip(*flights["old"]), zip(*flights["new"]))]
    print(f"events {100 * change[0]:+.2f} %, mean ATE {100 * change[1]:+.1f} %")
    return int(abs(change[0]) > 0.01 or abs(change[1]) > 0.05)


if __name__ == "__main__":
    sys.exit(main())
