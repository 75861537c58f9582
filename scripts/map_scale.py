#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Time and memory of map building against the size of the cloud.

    map_scale.py EVPOSE SHARED [MILLIONS...]     default 0.1 1 10; 50 takes the better part of an hour

Clouds are the shared hall (1.2 million points, 30 x 40 m), cut to size or repeated side by side in a square.
Prints a table.
"""
import os
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np

HEADER = """ply
format binary_little_endian 1.0
element vertex {:<12}
property float x
property float y
property float z
end_header
"""


def hall(path):
    content = path.read_bytes()
    start = content.index(b"end_header\n") + len(b"end_header\n")
    words = content[:start].decode().split("\n")
    count = next(int(line.split()[2]) for line in words if line.startswith("element vertex"))
    names = [line.split()[2] for line in words if line.startswith("property float")]
    rows = np.frombuffer(content, "<f4", count * len(names), start).reshape(count, len(names))
    return rows[:, [names.index(axis) for axis in "xyz"]]


def write_repeated(path, points, count):
    side = int(np.ceil(np.sqrt(max(1.0, count / len(points)))))
    size = points.max(0) - points.min(0)
    left = count
    with open(path, "wb") as file:
        file.write(HEADER.format(count).encode())
        for k in range(side * side):
            part = points
            if left < len(points):  # a slice of the hall, as dense as the whole
                part = points[np.argsort(points[:, 1], kind="stable")[:left]]
            shift = np.array([k % side * (size[0] + 1), k // side * (size[1] + 1), 0], "<f4")
            file.write((part + shift).astype("<f4").tobytes())
            left -= len(part)
            if left <= 0:
                break


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    evpose, shared = sys.argv[1], pathlib.Path(sys.argv[2])
    millions = [float(word) for word in sys.argv[3:]] or [0.1, 1, 10]
    points = hall(shared / "data/real/clouds/hall_lidar_4cm.ply")
    print("| points | processor s | s per million | elapsed s | peak memory MB | bytes per point |\n|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        cloud, built = pathlib.Path(name) / "cloud.ply", pathlib.Path(name) / "map.h5"
        for million in millions:
            count = int(million * 1e6)
            write_repeated(cloud, points, count)
            start = time.monotonic()
            process = subprocess.Popen([evpose, "-q", "map", "build", cloud, "-o", built], stdout=subprocess.DEVNULL)
            _, status, usage = os.wait4(process.pid, 0)
            if status != 0:
                sys.exit(f"map build failed at {count} points")
            spent = usage.ru_utime + usage.ru_stime
            print(f"| {count} | {spent:.1f} | {spent / million:.1f} | {time.monotonic() - start:.1f} | "
                  f"{usage.ru_maxrss / 1024:.0f} | {usage.ru_maxrss * 1024 / count:.0f} |", flush=True)


if __name__ == "__main__":
    main()
