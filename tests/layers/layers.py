#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Holds the modules of src/evpose and the program to their layers: layers.py ROOT

A module includes and links only what stands on a lower line; so does a room of a module that has rooms. Outside
libraries, files and streams are kept to the modules that own them. Prints one line per fault; exit status 1 if there is
one.
"""
import pathlib
import re
import sys

# What each module may see besides itself.
CORE = {"core"}
SENSORS = CORE | {"camera", "imu", "event"}
MAP = SENSORS | {"map"}
SOLVERS = MAP | {"registration", "fusion"}
TRACKER = SOLVERS | {"relocalization", "tracker"}
IO = MAP | {"io"}
ALL = TRACKER | IO | {"map_build", "sim", "eval", "report", "run", "batch", "calibrate", "map_learn", "mavlink", "serve",
                      "view", "bench"}
MAY_SEE = {
    "core": set(), "camera": CORE, "imu": CORE, "event": CORE, "map": SENSORS,
    "registration": MAP, "relocalization": MAP | {"registration"}, "fusion": MAP, "tracker": SOLVERS | {"relocalization"},
    "io": MAP, "map_build": IO, "sim": IO, "eval": IO,
    "mavlink": TRACKER, "serve": TRACKER | IO | {"mavlink"}, "view": TRACKER | IO | {"report"},
    "run": TRACKER | IO | {"report"}, "batch": TRACKER | IO | {"report", "run"},
    "calibrate": TRACKER | IO | {"report", "run", "batch"},
    "map_learn": TRACKER | IO | {"report", "run", "batch"}, "report": ALL, "bench": ALL, "apps": ALL,
}
EMBEDDABLE = TRACKER

# Modules that are divided into rooms, a folder and a target each: what each room may see of its own module besides
# itself. Other modules may see every room.
ROOMS = {
    "io": {
        "files": set(),
        "hdf5": {"files"},
        "events": {"files", "hdf5"},
        "bags": {"files", "events"},
        "calibration": {"files"},
        "motion": {"files", "events", "bags"},
        "maps": {"files", "hdf5"},
        "formats": {"files", "hdf5", "events", "bags", "motion"},
        "recording": {"files", "hdf5", "events", "bags", "calibration", "motion", "maps", "formats"},
    },
    "sim": {
        "world": set(),
        "light": {"world"},
        "flight": {"world", "light"},
        "sensors": {"world", "light", "flight"},
        "recording": {"world", "light", "flight", "sensors"},
    },
}

# Headers of outside libraries, and who may use them.
FORMATS = {"io", "report", "view", "bench", "apps"}
OUTSIDE = [
    ("Ceres", r"ceres/|glog/", {"registration", "fusion"}),
    ("yaml-cpp", r"yaml-cpp/", FORMATS),
    ("HDF5", r"hdf5|H5", {"io", "bench"}),  # the bench times it against ours
    ("JSON", r"nlohmann/", FORMATS),
    ("libpng", r"png\.h", {"io"}),
    ("compressors", r"(bzlib|lz4|lz4frame|lzf|zstd|blosc|zlib)\.h", {"io"}),
    ("SQLite", r"sqlite3\.h", {"io"}),
    ("Cairo", r"cairo\.h", {"report"}),
    ("nanoflann", r"nanoflann", {"map_build"}),
    ("Embree", r"embree3/", {"sim"}),
    ("assimp", r"assimp/", {"sim"}),
    ("Boost", r"boost/", {"view"}),
    ("OpenCV", r"opencv2/", {"calibrate"}),
    ("AprilTag", r"apriltag/", {"calibrate"}),
    ("CLI11", r"CLI/", {"apps"}),
]
# Opening files and printing.
OPENS_FILES = re.compile(r"\b(fopen|freopen|ofstream|ifstream|fstream)\b")
MAY_OPEN_FILES = {"io"}
STREAMS = re.compile(r"#include <(iostream|fstream|cstdio|print)>")
MAY_PRINT_BELOW = {"src/evpose/core/log.cpp"}  # the one place of the library that writes to stderr

OURS = re.compile(r'^\s*#\s*include\s*["<]evpose/([a-z_]+)/(?:([a-z0-9_]+)/)?')
RELATIVE = re.compile(r'^\s*#\s*include\s*"(?!evpose/)([^"]+)"')
THEIRS = re.compile(r"^\s*#\s*include\s*<([^>]+)>")
LINK = re.compile(r"\bevpose(?:::|_)([a-z0-9_]+)\b")
COMMENT = re.compile(r"//.*|/\*.*?\*/", re.DOTALL)


def modules(root):
    for folder in sorted((root / "src/evpose").iterdir()):
        if folder.is_dir():
            yield folder.name, folder
    if (root / "apps").is_dir():
        yield "apps", root / "apps"


def is_test(path):
    return path.stem.endswith("_test")


def place_of(module, folder, path):
    """(module, room) in which a file stands; room None outside of rooms."""
    parts = path.relative_to(folder).parts
    return module, parts[0] if module in ROOMS and len(parts) > 1 else None


def target_of(name):
    """(module, room) of a library by its name, as evpose::map or evpose::io_maps; None for others."""
    if name in MAY_SEE:
        return name, None
    for module, rooms in ROOMS.items():
        if name.startswith(module + "_") and name.removeprefix(module + "_") in rooms:
            return module, name.removeprefix(module + "_")
    return None


def may_see(place, other):
    """Whether what stands in `place` may use what stands in `other`, each a (module, room)."""
    (module, room), (other_module, other_room) = place, other
    if module != other_module:
        return other_module in MAY_SEE[module]
    return room is None or room == other_room or other_room in ROOMS[module].get(room, ())


def name_of(place):
    return "/".join(part for part in place if part)


def check_line(place, path, line):
    """What is wrong with one line of a source, in words."""
    module = place[0]
    if match := OURS.match(line):
        other = match[1], match[2] if match[1] in ROOMS else None
        if not may_see(place, other):
            yield f"{name_of(place)} must not see {name_of(other)}"
    if (match := RELATIVE.match(line)) and module != "apps":
        yield f'write "evpose/{name_of(place)}/..." instead of "{match[1]}"'
    if match := THEIRS.match(line):
        for name, pattern, users in OUTSIDE:
            if re.match(pattern, match[1]) and module not in users:
                yield f"{module} must not use {name}"
    if is_test(path):
        return
    if OPENS_FILES.search(COMMENT.sub("", line)) and module not in MAY_OPEN_FILES:
        yield f"{module} must not open files: that is io's work"
    if module in EMBEDDABLE and STREAMS.search(line):
        yield f"{module} must not print or read streams"


def check_sources(root, module, folder):
    for path in sorted(folder.rglob("*")):
        if path.suffix not in (".h", ".cpp"):
            continue
        name = path.relative_to(root).as_posix()
        if name in MAY_PRINT_BELOW:
            continue
        place = place_of(module, folder, path)
        if module in ROOMS and place[1] not in ROOMS[module]:
            yield f"{name}: {module} has rooms, and this file stands in none: give it one, or a new room its line in tests/layers/layers.py"
            continue
        for number, line in enumerate(path.read_text().splitlines(), 1):
            for fault in check_line(place, path, line):
                yield f"{name}:{number}: {fault}"


def check_links(root, module, folder):
    for path in sorted(folder.rglob("CMakeLists.txt")):
        place = place_of(module, folder, path)
        for number, line in enumerate(path.read_text().splitlines(), 1):
            for other in filter(None, map(target_of, LINK.findall(line.split("#")[0]))):
                if not may_see(place, other):
                    yield f"{path.relative_to(root)}:{number}: {name_of(place)} must not link {name_of(other)}"


def check(root):
    """All faults of the tree below `root`, as lines of text."""
    faults = []
    for module, folder in modules(root):
        if module not in MAY_SEE:
            faults.append(f"{folder.relative_to(root)}: unknown module: give it a line in tests/layers/layers.py")
            continue
        faults += check_sources(root, module, folder)
        faults += check_links(root, module, folder)
    return faults


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    found = check(pathlib.Path(sys.argv[1]).resolve())
    print("\n".join(found) or "every module keeps to its layer")
    sys.exit(1 if found else 0)
