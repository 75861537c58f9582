#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Error of a run along each axis inside its stated band of three sigma: fusion_picture.py RUN groundtruth.tum OUT.svg

RUN is a folder that `evpose track` wrote, the ground truth that of the body in the map's frame. Position in the map's
axes, rotation about the body's. Prints the share of updates inside the band, of a normal distribution 99.7 %. Needs numpy.
"""
import csv
import pathlib
import sys

import numpy as np

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
    column = lambda names: np.array([[float(row[n]) for n in names] for row in rows])
    t = column(["t_s"])[:, 0]
    truth = np.loadtxt(truth_file)
    inside = (t >= truth[0, 0]) & (t <= truth[-1, 0])
    after = np.clip(np.searchsorted(truth[:, 0], t), 1, len(truth) - 1)
    share = ((t - truth[after - 1, 0]) / (truth[after, 0] - truth[after - 1, 0]))[:, None]
    between = truth[after - 1] * (1 - share) + truth[after] * share
    sign = np.sign((truth[after - 1, 4:] * truth[after, 4:]).sum(1))[:, None]
    q_truth = truth[after - 1, 4:] * (1 - share) + sign * truth[after, 4:] * share
    q_truth /= np.linalg.norm(q_truth, axis=1)[:, None]
    conjugate = q_truth * [-1, -1, -1, 1]
    turn = product(conjugate, column(["qx", "qy", "qz", "qw"]))
    turn *= np.sign(turn[:, 3])[:, None]
    error = np.column_stack([1e3 * (column(["x_m", "y_m", "z_m"]) - between[:, 1:4]), np.degrees(2 * turn[:, :3])])
    sigma = np.sqrt(np.maximum(0, column([f"cov_{a}_{a}" for a in ("x", "y", "z", "rx", "ry", "rz")])))
    sigma = np.column_stack([1e3 * sigma[:, :3], np.degrees(sigma[:, 3:])])
    return t[inside] - t[0], error[inside], sigma[inside]


def panel(left, top, title, t, error, sigma):
    every = len(t) // MOST_POINTS + 1
    t, error, sigma = t[::every], error[::every], sigma[::every]
    most = 1.15 * max(np.percentile(3 * sigma, 98), np.abs(error).max())
    x = left + WIDTH * t / t[-1]
    y = lambda values: top + HEIGHT / 2 * (1 - np.clip(values / most, -1, 1))
    points = lambda xs, ys: " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(xs, ys))
    band = points(np.concatenate([x, x[::-1]]), np.concatenate([y(3 * sigma), y(-3 * sigma)[::-1]]))
    step = 10.0 ** np.floor(np.log10(most))
    step = next(s for s in (5 * step, 2 * step, step, step / 2) if s <= 0.8 * most)
    out = [f'<polygon points="{band}" fill="#cfe3f7"/>',
           f'<rect x="{left}" y="{top}" width="{WIDTH}" height="{HEIGHT}" fill="none" stroke="#888"/>',
           f'<text x="{left + 6}" y="{top + 14}">{title}</text>']
    for value in (-step, 0, step):
        at = float(y(value))
        out.append(f'<line x1="{left}" y1="{at:.1f}" x2="{left + WIDTH}" y2="{at:.1f}" stroke="#bbb" stroke-dasharray="2,3"/>')
        out.append(f'<text x="{left - 5}" y="{at + 4:.1f}" text-anchor="end">{value:g}</text>')
    out.append(f'<polyline points="{points(x, y(error))}" fill="none" stroke="#b3261e" stroke-width="1.2"/>')
    return out


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    t, error, sigma = errors(pathlib.Path(sys.argv[1]), sys.argv[2])
    width, height = 2 * (WIDTH + LEFT) + 20, TOP + 3 * (HEIGHT + 12) + APART
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" font-family="sans-serif" font-size="12">',
           f'<rect width="{width}" height="{height}" fill="white"/>',
           f'<text x="{LEFT}" y="20">error (red) and three stated sigmas (blue)</text>']
    for i in range(6):
        left, top = LEFT + (i // 3) * (WIDTH + LEFT), TOP + (i % 3) * (HEIGHT + 12)
        title = f"position {AXES[i]}, mm" if i < 3 else f"rotation about {AXES[i - 3]}, deg"
        out += panel(left, top, title, t, error[:, i], sigma[:, i])
        if i % 3 == 2:
            for second in np.arange(0, t[-1] + 1e-9, 0.5):
                out.append(f'<text x="{left + WIDTH * second / t[-1]:.1f}" y="{top + HEIGHT + 16}" text-anchor="middle">{second:g}</text>')
            out.append(f'<text x="{left + WIDTH / 2}" y="{top + HEIGHT + 31}" text-anchor="middle">s</text>')
    pathlib.Path(sys.argv[3]).write_text("\n".join(out) + "\n</svg>\n")
    share = (np.abs(error) <= 3 * sigma).mean(0)
    print("inside three sigma: " + ", ".join(f"{100 * s:.1f} %" for s in share))


if __name__ == "__main__":
    main()
