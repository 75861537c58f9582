#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Draws docs/architecture.svg from the includes of the sources: architecture.py [--check]

Boxes are modules, and the rooms of the large ones. A thin line is an import that no other path implies. Rows are layers:
an import that does not lead to a lower row, or a module without a place here, is a fault. With --check nothing is
written, and a picture that is not the one in the repository is a fault, too.
"""
import collections
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
INCLUDE = re.compile(r'^\s*#\s*include\s*["<]evpose/([a-z_]+)/(?:([a-z0-9_]+)/)?', re.MULTILINE)
WIDTH, HEIGHT, ROW, TOP = 1200, 906, 80, 24

# Module: row (0 is the lowest), left, width, what it does. Blue boxes are the embeddable part, yellow ones the roof.
PLACES = {
    "core": (0, 20, 1160, "time, pose, errors, configuration, ordered parallel loops"),
    "event": (1, 640, 170, "noise filter, time surface"),
    "camera": (1, 825, 170, "projection, distortion"),
    "imu": (1, 1010, 170, "samples, strapdown"),
    "map": (2, 640, 540, "contours, spatial index, occlusion, visible set"),
    "registration": (3, 640, 265, "events and contours to pose information"),
    "fusion": (3, 915, 265, "prediction, filter, graph, calibration"),
    "relocalization": (4, 640, 540, "a pose anywhere in the map"),
    "tracker": (5, 640, 540, "predict, choose, measure, gate, fuse, judge"),
    "io": (3, 20, 580, "every reader and writer of files"),
    "map_build": (4, 20, 140, "clouds to contours"),
    "sim": (4, 175, 285, "recordings of made-up flights"),
    "eval": (4, 475, 125, "errors, lag, NEES"),
    "report": (6, 290, 310, "run folder, report.html, pictures"),
    "serve": (6, 640, 265, "live sources, queue, session"),
    "mavlink": (6, 915, 265, "frames, messages, link"),
    "run": (7, 290, 310, "a recording through the tracker"),
    "view": (7, 640, 265, "browser: server and pages"),
    "batch": (8, 290, 310, "all data at once: smoother"),
    "calibrate": (9, 610, 295, "cameras from flights before a map"),
    "map_learn": (9, 290, 310, "maps made better by flights"),
    "bench": (8, 20, 240, "what the figures are made with"),
    "apps": (10, 290, 490, "the program: one file per command"),
    "ros": (10, 800, 180, "ROS 1 node"),
    "python": (10, 1000, 180, "Python module"),
}
EMBEDDABLE = {"core", "event", "camera", "imu", "map", "registration", "relocalization", "fusion",
              "tracker"}
ROOF = {"apps", "ros", "python", "bench"}

# The flow of the data: corners as (module, x share, side) or plain points, and a label with its place.
FLOW = [
    ([(300, 684), ("io", 0.483, "bottom")], "recordings, clouds, maps", (312, 678)),
    ([("io", 1.0, "right"), (622, 613), (622, 453), ("tracker", 0.0, "left")], "", None),
    ([("serve", 0.15, "bottom"), ("tracker", 0.0736, "top")], "packets", (687, 418)),
    ([("tracker", 0.206, "top"), ("serve", 0.42, "bottom")], "poses", (758, 418)),
    ([("tracker", 0.77, "top"), ("mavlink", 0.531, "bottom")], "poses", (1063, 418)),
    ([("tracker", 0.03, "top"), (656, 413), (612, 413), (612, 293), ("run", 1.0, "right")], "", None),
]


def includes():
    """Modules (and rooms as module/room) that each module includes, tests left out."""
    found = collections.defaultdict(set)
    for base in ("src/evpose", "apps", "ros", "python"):
        for path in sorted((ROOT / base).rglob("*")):
            if path.suffix not in (".h", ".cpp") or path.stem.endswith("_test") or path.name.startswith("test_"):
                continue
            parts = path.relative_to(ROOT).parts
            module = parts[2] if parts[0] == "src" else parts[0]
            rooms = module in rooms_of() and len(parts) > 4
            for other, room in INCLUDE.findall(path.read_text()):
                if other != module:
                    found[module].add(other)
                elif rooms and room and room != parts[3]:
                    found[f"{module}/{parts[3]}"].add(f"{module}/{room}")
    return found


def rooms_of():
    """Folders with a target each, of the modules that are divided."""
    rooms = {}
    for module in sorted((ROOT / "src/evpose").iterdir()):
        if not module.is_dir():
            continue
        inner = [room.name for room in sorted(module.iterdir()) if (room / "CMakeLists.txt").exists()]
        if inner:
            rooms[module.name] = inner
    return rooms


def in_order(rooms, imports, module):
    """Rooms from those that import nothing to those that import most."""
    def depth(room):
        return 1 + max((depth(other.split("/")[1]) for other in imports[f"{module}/{room}"]), default=-1)
    return sorted(rooms, key=lambda room: (depth(room), room))


def reachable(imports, start):
    seen, left = set(), [start]
    while left:
        for other in imports[left.pop()]:
            if other not in seen:
                seen.add(other)
                left.append(other)
    return seen


def reduced(imports):
    """Imports that no longer path implies."""
    for module in [m for m in imports if "/" not in m]:
        for other in sorted(imports[module]):
            if not any(other in reachable(imports, via) for via in imports[module] - {other}):
                yield module, other


def faults(imports):
    modules = {p.name for p in (ROOT / "src/evpose").iterdir() if p.is_dir()} | {"apps", "ros", "python"}
    for module in sorted(modules - PLACES.keys()):
        yield f"{module} has no place in docs/architecture.py"
    for module in sorted(PLACES.keys() - modules):
        yield f"{module} has a place in docs/architecture.py and does not exist"
    for module, others in sorted(imports.items()):
        for other in sorted(others):
            if "/" not in module and {module, other} <= PLACES.keys() and PLACES[other][0] >= PLACES[module][0]:
                yield f"{module} imports {other}, which does not stand on a lower row"


def box_of(module):
    row, x, width, _ = PLACES[module]
    return x, TOP + (9 - row) * ROW, width, 58


def corner(point):
    if len(point) == 2:
        return point
    module, share, side = point
    x, y, width, height = box_of(module)
    if side in ("left", "right"):
        return (x + width * share, y + height / 2)
    return (x + width * share, y if side == "top" else y + height)


def draw(imports, rooms):
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif">',
           "<style>", ".box{fill:#f4f6f8;stroke:#5b6b7b}.core{fill:#e3edf7;stroke:#2f6ea8}"
           ".roof{fill:#fbf1e0;stroke:#b07a1e}.room{fill:#ffffff;stroke:#9aa7b3}",
           ".name{font-size:15px;font-weight:bold;text-anchor:middle;fill:#1c2733}"
           ".does{font-size:12px;text-anchor:middle;fill:#465462}.small{font-size:10.5px;text-anchor:middle;fill:#1c2733}",
           ".import{stroke:#b4bec8;stroke-width:1;fill:none}"
           ".flow{stroke:#b3402f;stroke-width:2;fill:none;marker-end:url(#tip)}"
           ".key{font-size:12px;fill:#465462}.data{font-size:12px;fill:#b3402f}",
           "</style>", '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" '
           'orient="auto"><path d="M0 0 L8 4 L0 8 z" fill="#b3402f"/></marker></defs>',
           f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#ffffff"/>']
    for module, other in reduced(imports):
        x, y, width, height = box_of(module)
        ox, oy, owidth, _ = box_of(other)
        middle = min(max(ox + owidth / 2, x + 12), x + width - 12)
        target = min(max(middle, ox + 12), ox + owidth - 12)
        out.append(f'<path class="import" d="M{middle:.0f} {y + height} L{target:.0f} {oy}"/>')
    for module, (row, _, _, does) in PLACES.items():
        x, y, width, height = box_of(module)
        kind = "core" if module in EMBEDDABLE else "roof" if module in ROOF else "box"
        out.append(f'<rect class="{kind}" x="{x}" y="{y}" width="{width}" height="{height}" rx="6"/>')
        inner = in_order(rooms.get(module, []), imports, module)
        out.append(f'<text class="name" x="{x + width / 2}" y="{y + (17 if inner else 25)}">{module}</text>')
        out.append(f'<text class="does" x="{x + width / 2}" y="{y + (31 if inner else 43)}">{does}</text>')
        step = (width - 8) / max(1, len(inner))
        for k, room in enumerate(inner):
            left = x + 4 + k * step
            out.append(f'<rect class="room" x="{left + 2:.1f}" y="{y + 36}" width="{step - 4:.1f}" height="18" rx="3"/>')
            out.append(f'<text class="small" x="{left + step / 2:.1f}" y="{y + 49}">{room}</text>')
    for points, label, place in FLOW:
        out.append('<path class="flow" d="' + " ".join(
            f"{'M' if k == 0 else 'L'}{x:.0f} {y:.0f}" for k, (x, y) in enumerate(map(corner, points))) + '"/>')
        if label:
            out.append(f'<text class="data" x="{place[0]}" y="{place[1]}">{label}</text>')
    y = 652
    out += [f'<rect class="core" x="20" y="{y}" width="26" height="16" rx="3"/>',
            f'<text class="key" x="56" y="{y + 13}">embeddable: Eigen alone; no files, sockets or wall clock</text>',
            f'<path class="import" d="M20 {y + 33} L46 {y + 33}"/>',
            f'<text class="key" x="56" y="{y + 37}">imports, always downwards; those that others imply are left out</text>',
            f'<path class="flow" d="M20 {y + 57} L46 {y + 57}"/>',
            f'<text class="key" x="56" y="{y + 61}">data: events, IMU samples and maps in, poses out</text>']
    return "\n".join(out) + "\n</svg>\n"


def main():
    if sys.argv[1:] not in ([], ["--check"]):
        sys.exit(__doc__)
    imports = includes()
    wrong = list(faults(imports))
    picture, path = draw(imports, rooms_of()), ROOT / "docs/architecture.svg"
    if sys.argv[1:] and not wrong and path.read_text() != picture:
        wrong = ["docs/architecture.svg is not what the includes say: python3 docs/architecture.py draws it"]
    if wrong:
        sys.exit("\n".join(wrong))
    if not sys.argv[1:]:
        path.write_text(picture)


if __name__ == "__main__":
    main()
