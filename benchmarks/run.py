#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Makes the figures of docs/results and the pictures of docs/images.

    benchmarks/run.py list            names, what they make, how long they take
    benchmarks/run.py all             everything, one after the other
    benchmarks/run.py evaluation      the evaluation of EV-Pose: every figure and table that can be made here
    benchmarks/run.py accuracy map    these

A page keeps its words; the figures between its marks and its first line are written anew. What was measured with this
program is kept in SCRATCH/measured and not measured again, so that an interrupted run goes on where it was; recordings that
are simulated stay in SCRATCH/recordings. Needs a Python with numpy and h5py, and chromium for the pictures of maps and of
the viewer.
"""
import argparse
import importlib
import pathlib
import sys
import time

import harness

# Name, module and function, what is made, how long it takes on two cores.
BENCHMARKS = {
    "accuracy": ("accuracy", "make", "shared recordings and a real chunk, by field and IMU", "2 min"),
    "simulator": ("simulator", "make", "simulated flights", "2 h"),
    "unseen": ("experiments", "make_unseen", "flights that nobody has looked at, with all that may be wrong", "3 h"),
    "ablation": ("experiments", "make_ablation", "the tracker without one of its parts; its picture", "10 min"),
    "paper": ("paper", "make", "from the paper's form to the defaults, one replacement at a time", "25 min"),
    "paper-flights": ("paper", "make_flights", "the same on six simulated flights: hard light, moving things", "5 min"),
    "paper-classes": ("paper", "make_classes", "the paper's form and the defaults by speed and turning", "15 min"),
    "paper-long": ("paper_long", "make", "flights of 10 s, three seeds: errors, time by stage, memory", "25 min"),
    "paper-map": ("paper", "make_map", "the paper's map beside ours: errors, and tracking with both", "3 min"),
    "paper-corners": ("paper", "make_corners", "repeatability of corners in events, and of the map's contours", "1 min"),
    "paper-evaluation": ("paper", "make_evaluation", "its evaluation: distributions, rates", "5 min"),
    "frames": ("frames", "make", "frames alone, events alone and both, on simulated flights", "15 min"),
    "fusion": ("experiments", "make_fusion", "back ends side by side, on shared and simulated flights", "1 h"),
    "smooth": ("smooth", "make", "the smoother beside the filter; wants the flights of unseen", "15 min"),
    "relocalization": ("experiments", "make_relocalization", "what cannot be tracked: other maps, mirrored ones, starts 3 m off, noise", "10 min"),
    "probability": ("probability", "make", "whether poses are right: what is told and what is; wants the flights of unseen", "40 min"),
    "starts": ("starts", "make", "40 starts of each kind on shared and unseen recordings, with true contours and maps of clouds; wants the flights of unseen", "6 h"),
    "kidnapping": ("experiments", "make_kidnapping", "live sessions whose data stop while the camera moves on", "5 min"),
    "faults": ("experiments", "make_faults", "replays with faults in the streams", "10 min"),
    "events": ("experiments", "make_events", "causes of the events that are used", "10 min"),
    "real": ("paper_evaluation", "make_real", "real recordings before known contours", "1 min"),
    "light": ("light", "make", "flights in which lamps go off or the light steps", "20 min"),
    "residuals": ("residuals", "make", "events beside the contours of the true pose; wants the flights of unseen", "5 min"),
    "calibration": ("experiments", "make_calibration", "wrong calibrations, estimated online", "45 min"),
    "calibrate": ("calibrate", "make", "calibrations from flights, from starts that are far off", "90 min"),
    "boards": ("boards", "make", "calibrations before printed boards, beside frames and OpenCV; wants cv2", "20 min"),
    "map": ("maps", "make", "maps built from clouds, and tracking with them", "15 min"),
    "learn": ("learn", "make", "maps made better by flights, and tracking with them", "30 min"),
    "map-scale": ("map_scale", "make", "time and memory of map building, up to 100 million points", "2 h"),
    "map-borders": ("map_borders", "make", "a flight across the borders of a map in tiles", "10 min"),
    "latency": ("latency", "make", "stages of an update on whole recordings, and at high rates", "3 min"),
    "performance": ("performance", "make", "kernels and decoders by themselves (evpose_microbench)", "10 min"),
    "live": ("live", "make", "delay of evpose serve", "1 min"),
    "live-starts": ("live_starts", "make", "first poses of evpose serve, from starts known well, badly or not at all", "5 min"),
    "live-flights": ("live_flights", "make", "flights of a wide sensor live beside offline; wants the flights of unseen", "5 min"),
    "soak": ("live", "make_soak", "memory of evpose serve over half an hour", "30 min"),
    "simulator-speed": ("simulator_speed", "make", "processor time of the simulator", "5 min"),
    "simulator-peer": ("simulator_peer", "make", "the simulator beside an independent one; its pictures", "10 min"),
    "simulator-pictures": ("simulator_pictures", "make", "docs/images/simulator_*.png", "3 min"),
    "update-picture": ("pictures", "make_update", "docs/images/update.svg, overlay.png", "10 s"),
    "error-picture": ("error_picture", "make", "docs/images/fusion_error.svg", "10 s"),
    "landing-pictures": ("landing_pictures", "make", "docs/images/landing_*.png", "3 min"),
    "viewer-pictures": ("viewer_pictures", "make", "docs/images/viewer_*.png, report_*.png", "1 min"),
    "map-pictures": ("map_pictures", "make", "docs/images/map_*.png", "3 min"),
}

GROUPS = {"all": list(BENCHMARKS),
          "evaluation": ["paper", "paper-evaluation", "paper-classes", "paper-flights", "paper-long", "paper-map",
                         "paper-corners", "frames"]}


def parse():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="+", metavar="NAME", help="list, all, evaluation, or names of the list")
    parser.add_argument("--evpose", default=harness.ROOT / "build/release/apps/evpose/evpose", type=pathlib.Path)
    parser.add_argument("--microbench", type=pathlib.Path,
                        default=harness.ROOT / "build/bench/src/evpose/bench/micro/evpose_microbench")
    parser.add_argument("--shared", default=harness.ROOT.parent / "shared", type=pathlib.Path,
                        help="folder with the shared recordings")
    parser.add_argument("--scratch", default=harness.ROOT / "build/benchmarks", type=pathlib.Path)
    parser.add_argument("--fresh", action="store_true", help="measure again what is kept")
    parser.add_argument("--quick", action="store_true",
                        help="a little of each, to see that it works; pages and pictures go to SCRATCH/quick")
    parser.add_argument("--older", type=pathlib.Path,
                        help="of simulator-speed: an older evpose, measured beside this one")
    parser.add_argument("--minutes", type=float, default=0,
                        help="of unseen: after which no seed is begun; the same command goes on")
    options = parser.parse_args()
    unknown = set(options.names) - set(BENCHMARKS) - set(GROUPS) - {"list"}
    if unknown:
        parser.error(f"no such benchmark: {', '.join(sorted(unknown))}; see benchmarks/run.py list")
    return options


def main():
    options = parse()
    if "list" in options.names:
        for name, (_, _, what, duration) in BENCHMARKS.items():
            print(f"{name:18} {duration:>7}  {what}")
        return 0
    docs = options.scratch / "quick" if options.quick else harness.ROOT / "docs"
    bench = harness.Bench(options.evpose, options.microbench, options.shared, options.scratch, docs, options.quick,
                          options.minutes, options.older)
    if options.fresh:
        bench.forget()
    failed = []
    names = list(dict.fromkeys(name for word in options.names for name in GROUPS.get(word, [word])))
    for number, name in enumerate(names, 1):
        module, function, _, duration = BENCHMARKS[name]
        print(f"{name} ({number} of {len(names)}, {duration} where nothing is kept)", flush=True)
        start = time.monotonic()
        try:
            made = getattr(importlib.import_module(module), function)(bench)
            print(f"  {made} in {time.monotonic() - start:.0f} s", flush=True)
        except (harness.Failure, OSError) as reason:
            print(f"  failed: {reason}", flush=True)
            failed.append(name)
    if failed:
        print(f"failed: {', '.join(failed)}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
