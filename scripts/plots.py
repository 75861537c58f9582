#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of docs/accuracy.md, as SVG.

    plots.py error RUN GROUNDTRUTH.tum OUT.svg [TITLE]   error of a run over time with its own 3 sigma band
    plots.py ablation ABLATION.md OUT.svg                mean errors of `evpose bench ablation`, a group a recording

RUN is a folder of `evpose track`. Needs numpy.
"""
import csv
import pathlib
import re
import sys

import numpy as np

INK, FAINT, LINE, BAND = "#22262b", "#d5d8dd", "#1f77d0", "#cfe3f8"


class Sheet:
    """An SVG in the making."""

    def __init__(self, width, height):
        self.parts = [f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width} {height}' font-family='sans-serif' "
                      f"font-size='12' fill='{INK}'>", "<rect width='100%' height='100%' fill='white'/>"]

    def text(self, x, y, words, anchor="start", size=12):
        words = words.replace("&", "&amp;").replace("<", "&lt;")
        self.parts.append(f"<text x='{x:.1f}' y='{y:.1f}' text-anchor='{anchor}' font-size='{size}'>{words}</text>")

    def line(self, x0, y0, x1, y1, colour=FAINT):
        self.parts.append(f"<line x1='{x0:.1f}' y1='{y0:.1f}' x2='{x1:.1f}' y2='{y1:.1f}' stroke='{colour}'/>")

    def path(self, x, y, colour):
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y))
        self.parts.append(f"<polyline points='{points}' fill='none' stroke='{colour}' stroke-width='1.3'/>")

    def area(self, x, low, high, colour):
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(np.r_[x, x[::-1]], np.r_[low, high[::-1]]))
        self.parts.append(f"<polygon points='{points}' fill='{colour}'/>")

    def bar(self, x, y, width, height, colour):
        self.parts.append(f"<rect x='{x:.1f}' y='{y:.1f}' width='{width:.1f}' height='{height:.1f}' fill='{colour}'/>")

    def write(self, path):
        path = pathlib.Path(path)
        part = path.with_suffix(".part")
        part.write_text("\n".join(self.parts) + "\n</svg>\n")
        part.rename(path)


def rotation(q):
    x, y, z, w = np.moveaxis(q, -1, 0)
    return np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),
                     2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
                     2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], -1).reshape(-1, 3, 3)


def errors(run, truth):
    """Time since the start, error (x, y, z in mm; rotation vector in deg) and its sigma."""
    rows = list(csv.DictReader(open(pathlib.Path(run) / "states.csv")))
    column = lambda *names: np.array([[float(r[n]) for n in names] for r in rows])
    t = column("t_s")[:, 0]
    gt = np.loadtxt(truth)
    inside = (t >= gt[0, 0]) & (t <= gt[-1, 0])
    at = np.stack([np.interp(t, gt[:, 0], gt[:, k]) for k in range(1, 8)], 1)
    signs = np.sign((gt[1:, 4:] * gt[:-1, 4:]).sum(1))
    if (signs < 0).any():
        sys.exit("the ground truth's quaternions change sign")
    at[:, 3:] /= np.linalg.norm(at[:, 3:], axis=1, keepdims=True)
    R = np.swapaxes(rotation(at[:, 3:]), 1, 2) @ rotation(column("qx", "qy", "qz", "qw"))
    turn = 0.5 * np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], 1)
    error = np.concatenate([1e3 * (column("x_m", "y_m", "z_m") - at[:, :3]), np.degrees(turn)], 1)
    sigma = np.sqrt(column("cov_x_x", "cov_y_y", "cov_z_z", "cov_rx_rx", "cov_ry_ry", "cov_rz_rz"))
    sigma *= [1e3, 1e3, 1e3, *3 * [np.degrees(1)]]
    return (t - t[0])[inside], error[inside], sigma[inside]


def draw_error(run, truth, out, title=""):
    t, error, sigma = errors(run, truth)
    width, height, left, top, gap = 900, 110, 60, 34, 14
    sheet = Sheet(width, top + 6 * (height + gap) + 30)
    sheet.text(left, 20, f"{title} error and 3 sigma as stated by the tracker".strip(), size=15)
    settled = t > 0.3
    for k, name in enumerate(["x mm", "y mm", "z mm", "roll deg", "pitch deg", "yaw deg"]):
        y0 = top + k * (height + gap)
        most = 1.1 * max(np.abs(error[settled, k]).max(), np.percentile(3 * sigma[settled, k], 99))
        px = left + (width - left - 10) * t / t[-1]
        py = lambda v: y0 + height / 2 * (1 - np.clip(v / most, -1, 1))
        sheet.area(px, py(-3 * sigma[:, k]), py(3 * sigma[:, k]), BAND)
        for tick in (-0.5, 0, 0.5):
            sheet.line(left, py(tick * most), width - 10, py(tick * most))
            sheet.text(left - 6, py(tick * most) + 4, f"{tick * most:.2g}", "end")
        sheet.path(px, py(error[:, k]), LINE)
        sheet.text(left + 6, y0 + 14, name)
    for second in range(int(t[-1]) + 1):
        x = left + (width - left - 10) * second / t[-1]
        sheet.text(x, top + 6 * (height + gap) + 12, f"{second} s", "middle")
    sheet.write(out)


def draw_ablation(table, out):
    groups, name = {}, None
    for line in pathlib.Path(table).read_text().splitlines():
        if line.startswith("### "):
            name = line[4:]
        cells = [c.strip() for c in line.strip("|").split("|")]
        if name and len(cells) > 3 and re.fullmatch(r"[0-9.]+", cells[2]):
            groups.setdefault(cells[0], {})[name] = (float(cells[2]), cells[1])
    recordings = list(dict.fromkeys(r for g in groups.values() for r in g))
    left, row, panel = 260, 18, 120
    sheet = Sheet(left + (panel + 20) * len(recordings) + 20, 60 + row * len(groups))
    sheet.text(12, 20, "Mean error, mm (bars end at 4 mm; faint: not `tracking` at the end)", size=15)
    for j, r in enumerate(recordings):
        x = left + j * (panel + 20)
        sheet.text(x, 44, r)
        for i, values in enumerate(groups.values()):
            if r not in values:
                continue
            value, state = values[r]
            y = 52 + i * row
            sheet.bar(x, y, panel * min(value, 4) / 4, row - 5, LINE if state == "tracking" else "#a9c4e2")
            sheet.text(x + panel * min(value, 4) / 4 + 4, y + row - 7, f"{value:.2f}", size=10)
    for i, variant in enumerate(groups):
        sheet.text(left - 10, 52 + i * row + row - 7, variant, "end")
    sheet.write(out)


def main():
    commands = {"error": (draw_error, 3, 4), "ablation": (draw_ablation, 2, 2)}
    if len(sys.argv) < 2 or sys.argv[1] not in commands:
        sys.exit(__doc__)
    command, least, most = commands[sys.argv[1]]
    if not least <= len(sys.argv) - 2 <= most:
        sys.exit(__doc__)
    command(*sys.argv[2:])


if __name__ == "__main__":
    main()
