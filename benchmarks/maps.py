# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/map.md: maps built from clouds, held to the true contours and tracked with."""
import dataclasses
import pathlib
import re
import resource

import h5py
import numpy as np

import harness
import tables

OWN_OCCLUDERS = ["room_people", "room_720p"]  # the built map's are enough
SIMULATED, SIMULATED_S = ["indoor_spiral", "outdoor_spiral"], 5
# Clouds of one place are told where it was: their own frame's origin.
REAL = {"hall_lidar_4cm": [], "campus_building_livox": ["--viewpoint", "0,0,0", "--set", "noise=0.015"],
        "street_lidar_scan": ["--viewpoint", "0,0,0"], "room_laser_scan": [], "office_rgbd": ["--viewpoint", "0,0,0"]}
NUMBER = r"([\d.]+)"
SCORE = ["cloud", "built m", "true m", "precision 5 / 10 mm", "recall 5 / 10 mm", "p50 / mean / p95 mm",
         "error / sigma: rms, bulk", "outliers"]
UNCERTAIN = "built, ordinary calibration"
# Groups of planes that belong to one surface.
SURFACE_RAD, SURFACE_M, SURFACES, LOOKED_AT = np.radians(3), 0.1, 10, 60


@dataclasses.dataclass(frozen=True)
class Scene:
    """A cloud, and recordings made in the place that it shows."""
    name: str
    cloud: pathlib.Path
    recordings: list


def scenes(bench):
    places = {}
    for name, place in {} if bench.quick else harness.PEER.items():
        places.setdefault(place, []).append(bench.peer(name))
    out = [Scene(place, bench.shared / f"data/peer/maps/{place}_map_raw.ply", recordings)
           for place, recordings in places.items()]
    for recording in [] if bench.quick else bench.more_peers():
        if recording.name == harness.OTHER_VIEW:
            out[0].recordings.append(recording)
        else:
            out.append(Scene(recording.name, recording.folder / "cloud.ply", [recording]))
    for name in SIMULATED[:1] if bench.quick else SIMULATED:
        flight = bench.simulated(name, SIMULATED_S, ["lidar.on=true", "camera.size=vga"], f"{name}_lidar")
        out.append(Scene(f"{name} (simulated)", flight.folder / "map_raw.ply", [flight]))
    return out


def track(bench, recording, contours, scratch, *extra, known=True):
    """`known`: the calibration, which is the truth; else it is taken for an ordinary one."""
    summary = bench.track(recording.folder, contours, scratch / "run", *extra, known=known)
    a = summary["accuracy"]
    mark = "" if summary["status"] == "tracking" and summary["coverage"] > 0.999 else " *"
    return f"{a['ate_mean_mm']:.2f}, {a['are_mean_deg']:.3f}, {a['nees6_mean']:.2f}{mark}"


def measure_scene(bench, scene):
    """What `map compare` says of the built map, and figures of tracking by recording and kind of map."""
    with bench.folder() as scratch:
        built = scratch / "built.h5"
        bench.run("map", "build", scene.cloud, "-o", built)
        first = scene.recordings[0]
        score = bench.run("map", "compare", built, first.contours, "--cloud", scene.cloud, "--flown", first.truth)
        tracking = {}
        for recording in scene.recordings:
            occluders = ["--occluders", recording.mesh]
            rows = {"true": track(bench, recording, recording.contours, scratch, *occluders),
                    "built": track(bench, recording, built, scratch),
                    UNCERTAIN: track(bench, recording, built, scratch, known=False)}
            if recording.name not in OWN_OCCLUDERS:
                rows["built, true occluders"] = track(bench, recording, built, scratch, *occluders)
            tracking[recording.name] = rows
    return {"score": score, "tracking": tracking}


def score_row(name, text):
    """Of the line "all": metres, precision, recall, distances, error over sigma."""
    v = re.search(r"^all\s+(.*)$", text, re.MULTILINE)[1].split()
    return [name, v[0], v[1], f"{v[2]} / {v[3]} %", f"{v[4]} / {v[5]} %", f"{v[6]} / {v[7]} / {v[8]}", f"{v[11]}, {v[12]}",
            f"{v[13]} %"]


def rival_cells(text):
    """Length and share found within 10 mm, by the distance of the nearest parallel edge."""
    line = re.search(r"by parallel edge at(.*)$", text, re.MULTILINE)[1]
    return {f"from {start}": f"{length} m: {share} %"
            for start, length, share in re.findall(r"from ([\d.]+ cm): (\d+) m, \d+, (\d+)", line)}


def surfaces(path):
    """Points in the ten largest planes, and in the ten largest groups of planes that lie in one surface."""
    with h5py.File(path) as file:
        count, normal, d = (file[f"planes/{name}"][:].astype(float) for name in ("inliers", "normal", "d"))
    grouped, left = 0, count.copy()
    for _ in range(SURFACES):
        groups = []
        for k in np.argsort(-left)[:LOOKED_AT]:
            cosine = normal @ normal[k]
            of_it = (np.abs(cosine) > np.cos(SURFACE_RAD)) & (np.abs(d * np.sign(cosine) - d[k]) < SURFACE_M)
            groups.append((left[of_it].sum(), of_it))
        most, of_it = max(groups, key=lambda group: group[0])
        grouped += most
        left[of_it] = 0
    return np.sort(count)[-SURFACES:].sum(), grouped


def measure_cloud(bench, cloud, more):
    with bench.folder() as scratch:
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        text = bench.run("map", "build", bench.shared / f"data/real/clouds/{cloud}.ply", "-o", scratch / "map.h5", *more)
        spent = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        largest, grouped = surfaces(scratch / "map.h5")
    points, noise = re.search(rf"points +(\d+),.* noise {NUMBER} mm", text).groups()
    held = re.search(rf"hold {NUMBER} %", text)[1]
    creases, boundaries = (re.search(rf"^{kind} +{NUMBER} m", text, re.MULTILINE)[1] for kind in ("creases", "boundaries"))
    shadows, cylinders, poles = re.search(rf"{NUMBER} m of shadows.* (\d+) cylinders, (\d+) poles", text).groups()
    tilt = re.search(rf"{NUMBER} deg from z", text)
    return [cloud, points, noise, f"{held} %", f"{100 * largest / int(points):.1f}, {100 * grouped / int(points):.1f} %",
            creases, boundaries, shadows, f"{cylinders}, {poles}", tilt[1] if tilt else "-", f"{spent:.1f}"]


def make(bench):
    measured = {scene.name: bench.once(f"map: {scene.name}", lambda: measure_scene(bench, scene)) for scene in scenes(bench)}
    contours = tables.table(SCORE, [score_row(name, m["score"]) for name, m in measured.items()])
    rivals = {name: {start: cell for start, cell in rival_cells(m["score"]).items()} for name, m in measured.items()}
    tracking = {name: rows for m in measured.values() for name, rows in m["tracking"].items()}
    real = [bench.once(f"map: {cloud}", lambda: measure_cloud(bench, cloud, more))
            for cloud, more in (list(REAL.items())[2:3] if bench.quick else REAL.items())]
    heads = ["cloud", "points", "noise mm", "in planes", "ten largest, as surfaces", "creases m", "boundaries m", "shadows m",
             "cylinders, poles", "tilt deg", "processor s"]
    return bench.write_page("map", {"contours": contours, "parallel edges": tables.transposed(rivals, str, "cloud"),
                                    "tracking": tables.transposed(tracking, str), "real clouds": tables.table(heads, real)})
