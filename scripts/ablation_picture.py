#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Mean errors of `evpose bench ablation` as bars: ablation_picture.py ABLATION.md OUT.svg"""
import pathlib
import re
import sys

INK, FAINT, LINE = "#22262b", "#a9c4e2", "#1f77d0"


class Sheet:
    """An SVG in the making."""

    def __init__(self, width, height):
        self.parts = [f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width} {height}' font-family='sans-serif' "
                      f"font-size='12' fill='{INK}'>", "<rect width='100%' height='100%' fill='white'/>"]

    def text(self, x, y, words, anchor="start", size=12):
        words = words.replace("&", "&amp;").replace("<", "&lt;")
        self.parts.append(f"<text x='{x:.1f}' y='{y:.1f}' text-anchor='{anchor}' font-size='{size}'>{words}</text>")

    def bar(self, x, y, width, height, colour):
        self.parts.append(f"<rect x='{x:.1f}' y='{y:.1f}' width='{width:.1f}' height='{height:.1f}' fill='{colour}'/>")

    def write(self, path):
        path = pathlib.Path(path)
        part = path.with_suffix(".part")
        part.write_text("\n".join(self.parts) + "\n</svg>\n")
        part.rename(path)


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
    sheet = Sheet(left + (panel + 40) * len(recordings), 60 + row * len(groups))
    sheet.text(12, 20, "Mean error, mm (bars end at 4 mm; faint: not `tracking` at the end)", size=15)
    for j, r in enumerate(recordings):
        x = left + j * (panel + 40)
        sheet.text(x, 44, r)
        for i, values in enumerate(groups.values()):
            if r not in values:
                continue
            value, state = values[r]
            y = 52 + i * row
            sheet.bar(x, y, panel * min(value, 4) / 4, row - 5, LINE if state == "tracking" else FAINT)
            sheet.text(x + panel * min(value, 4) / 4 + 4, y + row - 7, f"{value:.2f}", size=10)
    for i, variant in enumerate(groups):
        sheet.text(left - 10, 52 + i * row + row - 7, variant, "end")
    sheet.write(out)


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    draw_ablation(*sys.argv[1:])


if __name__ == "__main__":
    main()
