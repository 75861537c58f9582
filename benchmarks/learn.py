# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/learn.md: maps that flights have made better, beside the built and the true ones."""
import json
import re
import shutil
import statistics

import numpy as np

import harness
import tables
import learnt_edges
from changed_map import Contours, move_contours

# One flight learns, others of the same place are tracked.
LEARNS, TRACKED = "room_spiral", ["room_hover", "room_people", "room_720p"]
# Several flights learn, one after the other.
IN_A_ROW = [["room_spiral", "room_720p"], ["room_spiral", "room_720p", "room_people"]]
# The first part learns, the rest is tracked: seconds of the first.
SPLIT = {"courtyard_landing": 2.4, "room_other_view": 1.5, "room_c": 0.65, "room_e": 0.65, "courtyard_b": 0.65}


# A changed scene: a fifth of the contours of the map that LEARNS has made are moved; then another flight learns. The
# limits of silence were chosen with the first seed on the first flight.
CHANGED_SHARE, CHANGED = 0.2, [("room_people", 1), ("room_people", 2), ("room_720p", 3), ("room_720p", 4)]

# One landing learns; another one in the same place is tracked from a height of so much until it touches down.
LANDING_PLACE, LANDING_S, HEIGHT_M, DOWN_M = 421, 5, 1.5, 0.01

# A flight before a landing pad with nested squares.
PRINTS_PLACE, PRINTS_S = 423, 6
PRINTS = ("world.pad_mark=squares", "trajectory.centre_z_m=2.5", "trajectory.size_forward_m=2", "trajectory.size_left_m=2",
          "trajectory.size_up_m=1", "trajectory.speed_m_s=1")

# A real board and desk, without an IMU.
BOARD = "data/real/davis240b_checkerboard"
BOARD_GAP_S = 0.1  # its truth has 20 poses a second

# Simulated places that nobody has looked at: one flight learns, another with motion and noise of its own is tracked.
FRESH, LEARNING_S, TRACKED_S = {"indoor_spiral": range(401, 406), "outdoor_spiral": range(406, 411)}, 10, 4


def cell(row):
    if "ate_mean_mm" not in row:
        return row.get("why", "-")
    mark = "" if row["tracking"] > 0.995 else f", tracking {100 * row['tracking']:.0f} %"
    return f"{row['ate_mean_mm']:.2f}, {row['are_mean_deg']:.3f}, {row['nees']:.2f}{mark}"


def track(bench, folder, truth, contours, scratch, *extra):
    """After 0.3 s, but for NEES/6, which is of the whole run."""
    summary = bench.track(folder, contours, scratch / "run", "--init", "groundtruth", *extra)
    later = bench.later_accuracy(scratch / "run", truth) or {}
    nees = (summary.get("accuracy") or {}).get("nees6_mean")
    return {**later, "nees": nees, "tracking": summary["tracking_share"]}


def learn(bench, built, folder, truth, scratch, known=True):
    """The learnt map, or none; what the flight told; how good its own trajectory became. `known`: its calibration is right."""
    learnt = scratch / "learnt.h5"
    believed = ["--set", "fusion.calibration.on=false"] if known else []
    try:
        bench.run("map", "learn", built, folder, "-o", learnt, "--trajectories", scratch / "flights", "--init", "groundtruth",
                  *believed)
    except harness.Failure as why:
        return None, {"refused": re.sub(r"^\S+: ", "", str(why).split(": ", 2)[-1])}  # without the recording's folder
    told = json.loads((scratch / "learnt.h5.json").read_text())
    own = json.loads(bench.run("eval", scratch / "flights/flight_0.tum", truth, "--from", harness.START_S, "--json"))
    return learnt, {**told["flights"][0], "own": own.get("accuracy", own), "processor_s": told["processor_s"],
                    "memory_mb": told["peak_memory_mb"]}


def compare(bench, folder, recording, built, learnt, scratch):
    return {"built": track(bench, folder, recording.truth, built, scratch),
            "learnt": track(bench, folder, recording.truth, learnt, scratch) if learnt else {"why": "refused"},
            "true": track(bench, folder, recording.truth, recording.contours, scratch, "--occluders", recording.mesh)}


def cloud_of(bench, recording):
    own = recording.folder / "cloud.ply"
    return own if own.exists() else recording.mesh.with_name(recording.mesh.name.replace("_mesh", "_map_raw"))


def measure_others(bench):
    with bench.folder() as scratch:
        teacher = bench.peer(LEARNS)
        bench.run("map", "build", cloud_of(bench, teacher), "-o", scratch / "built.h5")
        learnt, told = learn(bench, scratch / "built.h5", teacher.folder, teacher.truth, scratch)
        tracked = {name: compare(bench, bench.peer(name).folder, bench.peer(name), scratch / "built.h5", learnt, scratch)
                   for name in TRACKED}
        places = learnt_edges.of_flight(bench, learnt, scratch / "built.h5", teacher.contours, scratch)
    return {"told": told, "tracked": tracked, "places": places}


def measure_in_a_row(bench, names):
    """A map that flights have made better one after the other."""
    with bench.folder() as scratch:
        flights = [bench.peer(name) for name in names]
        bench.run("map", "build", cloud_of(bench, flights[0]), "-o", scratch / "built.h5")
        bench.run("map", "learn", scratch / "built.h5", *(flight.folder for flight in flights), "-o", scratch / "learnt.h5",
                  "--init", "groundtruth", "--set", "fusion.calibration.on=false")
        told = json.loads((scratch / "learnt.h5.json").read_text())
        return {"common_sigma_mm": told["flights"][-1]["common_sigma_mm"],
                "tracked": {name: track(bench, bench.peer(name).folder, bench.peer(name).truth, scratch / "learnt.h5", scratch)
                            for name in TRACKED}}


def last_metres(truth):
    """When it is HEIGHT_M, and when DOWN_M above where it ends."""
    times, heights = np.loadtxt(truth, comments="#", usecols=(0, 3)).T
    above = heights - heights[-1]
    return [float(times[np.flatnonzero(above > height)[-1]] - times[0]) for height in (HEIGHT_M, DOWN_M)]


def measure_landings(bench):
    with bench.folder() as scratch:
        teacher = fresh_flight(bench, "landing", LANDING_PLACE, LANDING_PLACE, LANDING_S)
        flight = fresh_flight(bench, "landing", LANDING_PLACE, LANDING_PLACE + 1000, LANDING_S)
        bench.run("map", "build", teacher.folder / "map_raw.ply", "-o", scratch / "built.h5")
        learnt, told = learn(bench, scratch / "built.h5", teacher.folder, teacher.truth, scratch)
        start_s, end_s = last_metres(flight.truth)
        bench.run("convert", flight.folder, scratch / "last", "--start", start_s, "--duration", end_s - start_s)
        if not (scratch / "last/groundtruth.tum").exists():
            shutil.copy(flight.truth, scratch / "last/groundtruth.tum")
        return {"told": told, "tracked": compare(bench, scratch / "last", flight, scratch / "built.h5", learnt, scratch)}


def measure_prints(bench):
    """Markings on the pad's top beside what is printed there."""
    settings = (*harness.TINY, "lidar.on=true", *harness.seeds(PRINTS_PLACE), *PRINTS)
    teacher = bench.simulated("outdoor_spiral", PRINTS_S, settings, "learn_prints")
    with bench.folder() as scratch:
        bench.run("map", "build", teacher.folder / "map_raw.ply", "-o", scratch / "built.h5")
        learnt, told = learn(bench, scratch / "built.h5", teacher.folder, teacher.truth, scratch)
        return learnt_edges.beside_prints(learnt) if learnt else told


def track_board(bench, folder, contours, scratch):
    summary = bench.track(folder, contours, scratch / "run", "--init", "groundtruth", known=False)
    scored = json.loads(bench.run("eval", scratch / "run/trajectory.tum", folder / "groundtruth.tum", "--from", harness.START_S,
                                  "--max-gap", BOARD_GAP_S, "--json"))
    scored = scored.get("accuracy", scored)
    return f"{scored['ate_mean_mm']:.1f}, {scored['are_mean_deg']:.2f}, tracking {100 * summary['tracking_share']:.0f} %"


def measure_board(bench, name, learns, tracks):
    """What a real flight told, and another one of the same desk with and without it."""
    folder = bench.shared / BOARD
    with bench.folder() as scratch:
        given = scratch / "given.h5"
        bench.run("map", "import", folder / learns / f"{name}.ply", "-o", given)
        before = track_board(bench, folder / tracks, given, scratch)
        learnt, told = learn(bench, given, folder / learns, folder / learns / "groundtruth.tum", scratch, known=False)
        return [told.get("refused", "learnt"), before, track_board(bench, folder / tracks, learnt, scratch) if learnt else "-"]


def checkerboard_rows(bench):
    rows = []
    for name, what in (("contours", "board"), ("contours_scene", "board and desk")):
        for learns, tracks in (("seq_0001", "seq_0002"), ("seq_0002", "seq_0001")):
            said, before, after = bench.once(f"learn: real board {name} {learns}",
                                             lambda n=name, a=learns, b=tracks: measure_board(bench, n, a, b))
            rows.append([what, learns, said, tracks, before, after])
    return tables.table(["map", "learnt from", "what was said", "tracked", "with the given map: mm, deg", "with what was learnt"], rows)


def measure_split(bench, recording, seconds):
    with bench.folder() as scratch:
        bench.run("map", "build", cloud_of(bench, recording), "-o", scratch / "built.h5")
        bench.run("convert", recording.folder, scratch / "first", "--duration", seconds)
        bench.run("convert", recording.folder, scratch / "second", "--start", seconds)
        for part in ("first", "second"):
            if not (scratch / part / "groundtruth.tum").exists():
                shutil.copy(recording.truth, scratch / part / "groundtruth.tum")
        learnt, told = learn(bench, scratch / "built.h5", scratch / "first", recording.truth, scratch)
        return {"told": told, "tracked": compare(bench, scratch / "second", recording, scratch / "built.h5", learnt, scratch)}


def fresh_flight(bench, scenario, place, own_seed, seconds):
    settings = (*harness.TINY, "lidar.on=true", f"seed={own_seed}", f"world.seed={place}", f"trajectory.seed={own_seed}")
    return bench.simulated(scenario, seconds, settings, f"learn_{scenario}")


def measure_fresh(bench, scenario, place):
    teacher = fresh_flight(bench, scenario, place, place, LEARNING_S)
    flight = fresh_flight(bench, scenario, place, place + 1000, TRACKED_S)
    with bench.folder() as scratch:
        bench.run("map", "build", teacher.folder / "map_raw.ply", "-o", scratch / "built.h5")
        learnt, told = learn(bench, scratch / "built.h5", teacher.folder, teacher.truth, scratch)
        return {"told": told, "tracked": compare(bench, flight.folder, flight, scratch / "built.h5", learnt, scratch),
                "places": learnt_edges.of_flight(bench, learnt, scratch / "built.h5", teacher.contours, scratch) if learnt else None}


def fresh_summary(fresh):
    """Mean and worst of what was tracked to the end with each kind of map."""
    out = {}
    for kind in ("built", "learnt", "true"):
        rows = [m["tracked"][kind] for m in fresh.values() if "ate_mean_mm" in m["tracked"][kind]]
        errors = [row["ate_mean_mm"] for row in rows]
        out[kind] = (f"{statistics.mean(errors):.2f}, worst {max(errors):.2f}, NEES/6 {statistics.mean(r['nees'] for r in rows):.2f}"
                     f" ({len(rows)} of {len(fresh)})") if rows else "-"
    return out


def changes_found(before, changed, moved, unchanged_learnt, learnt):
    """Metres: of contours that the flight sees, moved ones and those of them that left their place; the same of others."""
    before, changed, kept, found = (Contours(path) for path in (before, changed, unchanged_learnt, learnt))
    partner = before.beside(kept)
    told = (partner >= 0) & (abs(kept.sigmas[partner] - before.sigmas) > 1e-7)
    left = changed.beside(found) < 0
    return {"moved": before.length_m(moved & told), "found": before.length_m(moved & told & left),
            "unmoved": before.length_m(~moved & (told | left)), "false": before.length_m(~moved & left)}


def measure_changed(bench, name, seed):
    with bench.folder() as scratch:
        teacher, flight = bench.peer(LEARNS), bench.peer(name)
        bench.run("map", "build", cloud_of(bench, teacher), "-o", scratch / "built.h5")
        first, _ = learn(bench, scratch / "built.h5", teacher.folder, teacher.truth, scratch)
        if not first:
            raise harness.Failure(f"nothing was learnt from {LEARNS}")
        first = first.rename(scratch / "first.h5")
        moved = move_contours(first, scratch / "changed.h5", CHANGED_SHARE, seed)
        maps = {"as it was": first, "changed": scratch / "changed.h5"}
        for kind in list(maps):
            learnt, told = learn(bench, maps[kind], flight.folder, flight.truth, scratch)
            if not learnt:
                return told
            maps[f"{kind}, learnt"] = learnt.rename(scratch / f"{kind.replace(' ', '_')}_learnt.h5")
        return {"found": changes_found(first, maps["changed"], moved, maps["as it was, learnt"], maps["changed, learnt"]),
                "tracked": {kind: track(bench, flight.folder, flight.truth, path, scratch) for kind, path in maps.items()}}


def changed_row(name, seed, measured):
    if "refused" in measured:
        return [name, seed, measured["refused"], "-", "-", "-", "-", "-"]
    m = measured["found"]
    errors = [measured["tracked"][kind]["ate_mean_mm"] for kind in ("as it was", "changed", "as it was, learnt", "changed, learnt")]
    return [name, seed, f"{m['found']:.1f} of {m['moved']:.1f}", f"{m['false']:.1f} of {m['unmoved']:.1f}",
            *(f"{e:.2f}" for e in errors)]


def told_row(name, told):
    if "refused" in told:
        return [name, "-", "-", "-", "-", "refused", "-", "-", "-"]
    sigma = ", ".join(f"{v:.1f}" for v in told["common_sigma_mm"])
    own = told["own"]
    explained = ", ".join(f"{100 * told[f'explained_events_{when}']:.0f}" for when in ("before", "after"))
    return [name, f"{told['seconds']:.1f}", f"{told['view_spread_deg']:.1f}",
            f"{told['moved_m']:.0f}, {told['struck_m']:.1f}, {told['new_m']:.0f}", explained, sigma,
            f"{own['ate_mean_mm']:.2f}, {own['are_mean_deg']:.3f}", f"{told['processor_s'] / told['seconds']:.1f}",
            f"{told['memory_mb']:.0f}"]


def make(bench):
    others = bench.once("learn: other flights", lambda: measure_others(bench))
    recordings = {r.name: r for r in bench.peers() + bench.more_peers()}
    split = {name: bench.once(f"learn: {name}", lambda: measure_split(bench, recordings[name], seconds))
             for name, seconds in SPLIT.items() if name in recordings}
    changed = [changed_row(name, seed, bench.once(f"learn: changed {name} {seed}", lambda: measure_changed(bench, name, seed)))
               for name, seed in CHANGED]
    fresh = {f"{scenario}, {place}": bench.once(f"learn: fresh {scenario} {place}",
                                                lambda: measure_fresh(bench, scenario, place))
             for scenario, places in FRESH.items() for place in (places[:1] if bench.quick else places)}
    in_a_row = {", ".join(names): bench.once(f"learn: {names}", lambda n=names: measure_in_a_row(bench, n))
                for names in IN_A_ROW}
    landings = bench.once("learn: last metres", lambda: measure_landings(bench))
    places = {LEARNS: others["places"], **{name: m["places"] for name, m in fresh.items()}}
    told = [told_row(LEARNS, others["told"]), *(told_row(name, m["told"]) for name, m in split.items()),
            told_row("landing", landings["told"])]
    heads = ["flight", "s", "views deg apart", "moved, struck, new m", "events explained, before and after, %", "common sigma mm", "own trajectory mm, deg",
             "processor s per s", "memory MB"]
    return bench.write_page("learn", {
        "other flights": tables.transposed(others["tracked"], cell),
        "in a row": tables.table(["learnt from", "common sigma mm", *TRACKED],
                                 [[names, ", ".join(f"{v:.1f}" for v in m["common_sigma_mm"]),
                                   *(cell(m["tracked"][name]) for name in TRACKED)] for names, m in in_a_row.items()]),
        "landings": tables.transposed({"another landing": landings["tracked"]}, cell),
        "places": learnt_edges.moved_table(places), "new edges": learnt_edges.new_table(places),
        "prints": learnt_edges.prints_table(bench.once("learn: prints", lambda: measure_prints(bench))),
        "checkerboard": checkerboard_rows(bench),
        "second parts": tables.transposed({name: m["tracked"] for name, m in split.items()}, cell),
        "fresh places": [*tables.transposed({name: m["tracked"] for name, m in fresh.items()}, cell),
                         "| mean | " + " | ".join(fresh_summary(fresh).values()) + " |"],
        "flights": tables.table(heads, [*told, *(told_row(name, m["told"]) for name, m in fresh.items())]),
        "changed": tables.table(["flight", "seed", "moved m, found", "others m, struck", "as it was", "changed",
                                 "as it was, learnt", "changed, learnt"], changed)})
