# SPDX-License-Identifier: BSD-3-Clause
"""docs/images/fusion_error.svg: error of a run along each axis inside its stated band of three sigma.

Position in the map's axes, rotation about the body's. Prints the share of updates inside the band, of a normal
distribution 99.7 %.
"""
import csv

import numpy as np

import drawing
import files

RECORDING = "room_spiral"
MOST_POINTS = 400
WIDTH, HEIGHT, LEFT, TOP, APART = 370, 120, 60, 34, 34
AXES = ["x", "y", "z"]


def product(a, b):
    """Of quaternions as rows (x, y, z, w)."""
    v = a[:, 3:] * b[:, :3] + b[:, 3:] * a[:, :3] + np.cross(a[:, :3], b[:, :3])
    return np.column_stack([v, a[:, 3] * b[:, 3] - (a[:, :3] * b[:, :3]).sum(1)])


def errors(run, truth_file):
    """Times (s) after the first; errors and sigmas, a row per update: mm in the map, degrees about the body's axes."""
    with open(run / "states.csv") as file:
        rows = list(csv.DictReader(file))

    def column(*names):
        return np.array([[float(row[n]) for n in names] for row in rows])

    t = column("t_s")[:, 0]
    truth = files.Trajectory(np.loadtxt(truth_file))
    inside = (t >= truth.t[0]) & (t <= truth.t[-1])
    position, attitude = truth.at(t)
    turn = product(attitude * [-1, -1, -1, 1], column("qx", "qy", "qz", "qw"))
    turn *= np.sign(turn[:, 3])[:, None]
    error = np.column_stack([1e3 * (column("x_m", "y_m", "z_m") - position), np.degrees(2 * turn[:, :3])])
    sigma = np.sqrt(np.maximum(0, column(*(f"cov_{a}_{a}" for a in ("x", "y", "z", "rx", "ry", "rz")))))
    sigma = np.column_stack([1e3 * sigma[:, :3], np.degrees(sigma[:, 3:])])
    return t[inside] - t[0], error[inside], sigma[inside]


def draw_panel(svg, left, top, title, t, error, sigma):
    every = len(t) // MOST_POINTS + 1
    t, error, sigma = t[::every], error[::every], sigma[::every]
    most = 1.15 * max(np.percentile(3 * sigma, 98), np.abs(error).max())
    x = left + WIDTH * t / t[-1]

    def y(values):
        return top + HEIGHT / 2 * (1 - np.clip(values / most, -1, 1))

    svg.area(np.concatenate([x, x[::-1]]), np.concatenate([y(3 * sigma), y(-3 * sigma)[::-1]]), "#cfe3f7")
    svg.frame(left, top, WIDTH, HEIGHT)
    svg.text(left + 6, top + 14, title)
    decade = 10.0 ** np.floor(np.log10(most))
    step = next(s for s in (5 * decade, 2 * decade, decade, decade / 2) if s <= 0.8 * most)
    for value in (-step, 0, step):
        at = float(y(value))
        svg.line(left, at, left + WIDTH, at, dashes="2,3")
        svg.text(left - 5, at + 4, f"{value:g}", "end")
    svg.curve(x, y(error), "#b3261e", 1.2)


def draw(path, t, error, sigma):
    svg = drawing.Svg(2 * (WIDTH + LEFT) + 20, TOP + 3 * (HEIGHT + 12) + APART)
    svg.text(LEFT, 20, "error (red) and three stated sigmas (blue)")
    for i in range(6):
        left, top = LEFT + (i // 3) * (WIDTH + LEFT), TOP + (i % 3) * (HEIGHT + 12)
        title = f"position {AXES[i]}, mm" if i < 3 else f"rotation about {AXES[i - 3]}, deg"
        draw_panel(svg, left, top, title, t, error[:, i], sigma[:, i])
        if i % 3 == 2:
            for second in np.arange(0, t[-1] + 1e-9, 0.5):
                svg.text(left + WIDTH * second / t[-1], top + HEIGHT + 16, f"{second:g}", "middle")
            svg.text(left + WIDTH / 2, top + HEIGHT + 31, "s", "middle")
    svg.write(path)


def make(bench):
    recording = bench.peer("room_720p" if bench.quick else RECORDING)
    with bench.folder() as scratch:
        bench.track(recording.folder, recording.contours, scratch / "run", "--occluders", recording.mesh)
        t, error, sigma = errors(scratch / "run", recording.truth)
    picture = bench.image("fusion_error.svg")
    draw(picture, t, error, sigma)
    share = (np.abs(error) <= 3 * sigma).mean(0)
    print("  inside three sigma: " + ", ".join(f"{100 * s:.1f} %" for s in share))
    return picture
