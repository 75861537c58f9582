#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Time and memory of map building against the size of the cloud, and the first steps by PCL beside it.

    map_scale.py EVPOSE SHARED [--threads N] [--pcl MILLIONS] [MILLIONS...]     default 0.1 1 10; 50 takes half an hour

Clouds are the shared hall (1.2 million points, 30 x 40 m), cut to size or repeated side by side in a square.
Prints two tables. PCL's (libpcl-dev, pkg-config and a compiler; left out by name without them) does normals and
region growing for clouds of up to --pcl million points, with as many neighbours and threads as ours.
"""
import argparse
import os
import pathlib
import re
import shutil
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


def measured(command):
    """Output, processor seconds, elapsed seconds and peak bytes of a command."""
    start = time.monotonic()
    with tempfile.TemporaryFile("w+") as output:
        process = subprocess.Popen([str(word) for word in command], stdout=output)
        _, status, usage = os.wait4(process.pid, 0)
        elapsed = time.monotonic() - start
        if status != 0:
            sys.exit(f"{command[0]} failed")
        output.seek(0)
        return output.read(), usage.ru_utime + usage.ru_stime, elapsed, usage.ru_maxrss * 1024


def compiled_peer(folder):
    """The program of PCL's steps; None, and why, where it cannot be made."""
    modules = ["pcl_features", "pcl_segmentation", "pcl_io", "pcl_search"]
    if not shutil.which("pkg-config") or subprocess.run(["pkg-config", "--exists", *modules]).returncode != 0:
        print("PCL is not there (libpcl-dev); its table is left out")
        return None
    flags = subprocess.run(["pkg-config", "--cflags", "--libs", *modules], capture_output=True, text=True).stdout.split()
    source = pathlib.Path(__file__).with_name("pcl_planes.cpp")
    subprocess.run(["c++", "-std=c++17", "-O3", "-march=x86-64-v3", "-fopenmp", source, "-o", folder / "pcl", *flags],
                   check=True)
    return folder / "pcl"


def main():
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("evpose")
    parser.add_argument("shared", type=pathlib.Path)
    parser.add_argument("millions", type=float, nargs="*", default=[0.1, 1, 10])
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--pcl", type=float, default=1)
    wanted = parser.parse_intermixed_args()
    points = hall(wanted.shared / "data/real/clouds/hall_lidar_4cm.ply")
    print("| points | tiles | processor s | s per million | elapsed s | peak memory MB | bytes per point |")
    print("|---|---|---|---|---|---|---|")
    beside = []
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        cloud, built = folder / "cloud.ply", folder / "map.h5"
        peer = compiled_peer(folder) if wanted.pcl > 0 else None
        for million in wanted.millions:
            count = int(million * 1e6)
            write_repeated(cloud, points, count)
            said, spent, elapsed, peak = measured(
                [wanted.evpose, "-q", "map", "build", cloud, "-o", built, "--threads", wanted.threads])
            figures = re.search(r"patches of (\d+)(?:, (\d+) tiles)?\n.*normals ([\d.]+), planes ([\d.]+)", said, re.S)
            print(f"| {count} | {figures[2] or 1} | {spent:.1f} | {spent / million:.1f} | {elapsed:.1f} | "
                  f"{peak / 1e6:.0f} | {peak / count:.0f} |", flush=True)
            if peer and million <= wanted.pcl:
                of_peer, _, _, peer_peak = measured([peer, cloud, figures[1], wanted.threads])
                _, normals, growing, regions, share = of_peer.split()
                beside.append(f"| {count} | {figures[1]} | {figures[3]} | {figures[4]} | {peak / 1e6:.0f} | {normals} | "
                              f"{growing} | {peer_peak / 1e6:.0f} | {regions}, {100 * float(share):.0f} % |")
    if beside:
        print("\n| points | neighbours | ours: normals s | planes s | peak MB, whole build | PCL: normals s | regions s | "
              "peak MB | regions, share of the points |\n|---|---|---|---|---|---|---|---|---|")
        print("\n".join(beside))


if __name__ == "__main__":
    main()
