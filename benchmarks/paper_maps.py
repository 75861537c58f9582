# SPDX-License-Identifier: BSD-3-Clause
"""The paper's map (`evpose map build --preset paper`) beside ours, docs/results/paper-map.md: errors, and tracking with both;
of LiDAR clouds, and of the images of a depth camera."""
import dataclasses
import re
import shutil

import drawing
import harness
import maps
import numpy as np
import tables

KINDS = {"paper": ("--preset", "paper"), "ours": ()}
FORMS = {"paper": ("--preset", "paper"), "defaults": ()}
HEADS = ["recording", *(f"map: {kind}, form: {form}" for kind in KINDS for form in FORMS)]
DEPTH_S, DEPTH_HZ, DEPTH_SEEDS = 5, 4, (101, 102)  # seeds that no default was chosen on
DEPTH_NOISE = (0.0015, 0.0025)                     # m, and m for each square metre: an ordinary depth camera's


def measure(bench, place, recordings):
    """Of each kind of map: what `map compare` says, and figures of tracking by form and recording."""
    out = {}
    cloud = bench.shared / f"data/peer/maps/{place}_map_raw.ply"
    with bench.folder() as scratch:
        for kind, words in KINDS.items():
            built = scratch / f"{kind}.h5"
            bench.run("map", "build", cloud, "-o", built, *words)
            score = bench.run("map", "compare", built, recordings[0].contours, "--cloud", cloud)
            tracking = {r.name: {form: maps.track(bench, r, built, scratch, "--set", "overlays=0", *settings)
                                 for form, settings in FORMS.items()} for r in recordings}
            out[kind] = {"score": score, "tracking": tracking}
    return out


def depth_flight(bench, seed):
    """A flight with exact depth images."""
    seeds = harness.seeds(seed)
    made = bench.simulated("indoor_spiral", DEPTH_S, (*harness.TINY, f"depth.rate_hz={DEPTH_HZ}", *seeds), "depth_images")
    return dataclasses.replace(made, name=f"hall, seed {seed}")


def with_noise(source, folder):
    """Images as a depth camera has them: its error grows with the square of depth."""
    random = np.random.default_rng(1)
    folder.mkdir()
    shutil.copy(source / "timestamps.csv", folder)
    for path in sorted(source.glob("*.png")):
        depth = 1e-3 * drawing.read_grey_png(path).astype(float)
        noisy = depth + random.normal(size=depth.shape) * (DEPTH_NOISE[0] + DEPTH_NOISE[1] * depth ** 2)
        drawing.write_grey_png(folder / path.name, np.where(depth > 0, np.clip(1e3 * noisy, 0, 65535), 0).round().astype(np.uint16))


def measure_depth(bench, flight):
    """As `measure`, of the cloud of the flight's depth images."""
    out = {}
    with bench.folder() as scratch:
        with_noise(flight.folder / "depth", scratch / "images")
        cloud = scratch / "cloud.ply"
        said = bench.run("map", "depth", scratch / "images", "--poses", flight.folder / "groundtruth_camera.tum", "--calibration",
                         flight.folder / "camchain-imucam.yaml", "--noise", ",".join(map(str, DEPTH_NOISE)), "-o", cloud)
        viewpoints = re.findall(r"--viewpoint (\S+)", said)
        for kind, words in KINDS.items():
            built = scratch / f"{kind}.h5"
            seen_from = [w for v in viewpoints for w in ("--viewpoint", v)] if kind == "ours" else []  # the paper's asks nothing
            bench.run("map", "build", cloud, "-o", built, *words, *seen_from)
            out[kind] = {"score": bench.run("map", "compare", built, flight.contours, "--cloud", cloud),
                         "tracking": {form: maps.track(bench, flight, built, scratch, "--set", "overlays=0", *settings)
                                      for form, settings in FORMS.items()}}
    return out


def depth_sections(bench):
    flights = [depth_flight(bench, seed) for seed in DEPTH_SEEDS[:1 if bench.quick else None]]
    measured = {f.name: bench.once(f"paper maps: depth, {f.name}", lambda: measure_depth(bench, f)) for f in flights}
    errors = [maps.score_row(f"{name}, {kind}", m["score"]) for name, kinds in measured.items() for kind, m in kinds.items()]
    rows = [[name, *(kinds[kind]["tracking"][form] for kind in KINDS for form in FORMS)] for name, kinds in measured.items()]
    return {"depth errors": tables.table(maps.SCORE, errors), "depth tracking": tables.table(HEADS, rows)}


def sections(bench):
    places = {}
    for recording in bench.peers():
        places.setdefault(harness.PEER[recording.name], []).append(recording)
    measured = {place: bench.once(f"paper maps: {place}", lambda: measure(bench, place, recordings))
                for place, recordings in places.items()}
    errors = [maps.score_row(f"{place}, {kind}", m["score"]) for place, kinds in measured.items() for kind, m in kinds.items()]
    rows = [[name, *(measured[place][kind]["tracking"][name][form] for kind in KINDS for form in FORMS)]
            for place, recordings in places.items() for name in (r.name for r in recordings)]
    return {"errors": tables.table(maps.SCORE, errors), "tracking": tables.table(HEADS, rows), **depth_sections(bench)}
