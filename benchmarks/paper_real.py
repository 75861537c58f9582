# SPDX-License-Identifier: BSD-3-Clause
"""Real recordings before known contours, in the paper's form and with the defaults: sections of
docs/results/real.md."""
import json

import files
import numpy as np
import tables

FORMS = {"paper": ("--preset", "paper"), "defaults": ()}

BOARD = "data/real/davis240b_checkerboard"
STAR = "data/real/davis240c_rotating_star"
MAPS = {"board": "contours.ply", "board and desk": "contours_scene.ply"}
MOST_GAP_S = 0.3  # the board's truth has a pose for each frame, 20 a second
HEAD = ["recording", "map", "form", "at the end", "tracking %", "of its truth with a pose %", "mean ATE mm", "mean ARE deg",
        "board in the image px"]
STAR_HEAD = ["form", "at the end", "tracking %", "with a pose until s", "roll off the star's, deg rms", "largest deg"]


def share(value):
    return f"{100 * value:.0f}"


def offsets_px(camera, points, pose, other):
    """Distances in the image between points seen from two poses of the camera."""
    seen = []
    for p, q in (pose, other):
        pixels, front = camera.project((points - p) @ files.rotation(q))
        seen.append((pixels, front))
    both = seen[0][1] & seen[1][1]
    return np.linalg.norm(seen[0][0] - seen[1][0], axis=1)[both]


def board_px(folder, run):
    """Mean distance of the board's contours from where the truth sees them."""
    truth = np.loadtxt(folder / "groundtruth.tum")
    rows = np.loadtxt(run / "trajectory.tum", ndmin=2)
    camera = files.Camera(folder / "camchain-imucam.yaml")
    text = (folder / "contours.ply").read_text()
    points = np.loadtxt(text[text.index("end_header") + len("end_header"):].splitlines()[1:])[:, :3]
    found = files.Trajectory(rows)
    within = truth[(truth[:, 0] >= rows[0, 0]) & (truth[:, 0] <= rows[-1, 0])]
    if not len(within):
        return None
    return float(np.mean([np.mean(offsets_px(camera, points, found.at(t[0]), (t[1:4], t[4:8]))) for t in within]))


def track_board(bench, folder, contours, words):
    with bench.folder() as scratch:
        run = scratch / "run"
        summary = bench.track(folder, contours, run, "--init", "groundtruth", "--set", "overlays=0", *words, known=False)
        rows = np.loadtxt(run / "trajectory.tum", ndmin=2)
        truth = np.loadtxt(folder / "groundtruth.tum")
        out = {"status": summary["status"], "tracking": summary["tracking_share"], "accuracy": None, "px": None,
               "with a pose": (min(rows[-1, 0], truth[-1, 0]) - truth[0, 0]) / (truth[-1, 0] - truth[0, 0]) if len(rows) else 0}
        if len(rows) > 1 and rows[-1, 0] > truth[1, 0]:
            scored = json.loads(bench.run("eval", run / "trajectory.tum", folder / "groundtruth.tum", "--max-gap", MOST_GAP_S,
                                          "--json"))
            out["accuracy"], out["px"] = scored.get("accuracy", scored), board_px(folder, run)
    return out


def boards(bench):
    rows = []
    for sequence in ("seq_0001", "seq_0002"):
        folder = bench.shared / BOARD / sequence
        for place, contours in MAPS.items():
            for form, words in FORMS.items():
                m = bench.once(f"paper real: {sequence}, {place}, {form}, the lens not known",
                               lambda: track_board(bench, folder, folder / contours, words))
                a = m["accuracy"]
                figures = [f"{a['ate_mean_mm']:.1f}", f"{a['are_mean_deg']:.2f}", f"{m['px']:.2f}"] if a else ["-"] * 3
                rows.append([f"checkerboard {sequence[-1]}", place, form, m["status"], share(m["tracking"]),
                             share(m["with a pose"]), *figures])
    return tables.table(HEAD, rows)


def roll_deg(q):
    """About the camera's axis, which looks along the map's z."""
    r = files.rotation(q)
    return np.degrees(np.unwrap(np.arctan2(r[:, 1, 0], r[:, 0, 0])))


def track_star(bench, words):
    folder = bench.shared / STAR
    gravity = (folder / "gravity.txt").read_text().split()
    settings = [w for axis, value in zip("xyz", gravity[-3:]) for w in ("--set", f"fusion.gravity_{axis}={value}")]
    with bench.folder() as scratch:
        run = scratch / "run"
        summary = bench.track(folder, folder / "contours.ply", run, "--init", folder / "init.tum", "--set", "overlays=0",
                              *settings, *words)
        rows = np.loadtxt(run / "trajectory.tum", ndmin=2)
    out = {"status": summary["status"], "tracking": summary["tracking_share"], "until": None, "off": None}
    if not len(rows):
        return out
    star = np.loadtxt(folder / "reference_image_fit.tum")
    star = star[(star[:, 0] >= rows[0, 0]) & (star[:, 0] <= rows[-1, 0])]
    out["until"] = float(rows[-1, 0])
    if len(star):
        _, q = files.Trajectory(rows).at(star[:, 0])
        off = roll_deg(q) - roll_deg(star[:, 4:8])
        off = (off + 180) % 360 - 180
        out["off"] = [float(np.sqrt(np.mean(off ** 2))), float(np.max(np.abs(off)))]
    return out


def star(bench):
    rows = []
    for form, words in FORMS.items():
        m = bench.once(f"paper real: star, {form}", lambda: track_star(bench, words))
        off = [f"{v:.2f}" for v in m["off"]] if m["off"] else ["-", "-"]
        until = "-" if m["until"] is None else f"{m['until']:.2f}"
        rows.append([form, m["status"], share(m["tracking"]), until, *off])
    return tables.table(STAR_HEAD, rows)
