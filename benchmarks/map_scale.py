# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/map-scale.md: time and memory of map building by the size of the cloud; the first steps by PCL beside it.

Clouds are the shared hall (1.2 million points, 30 x 40 m), cut to size or repeated side by side in a square. PCL's program
(libpcl-dev, pkg-config and a compiler; left out by name without them) does normals and region growing, with as many
neighbours and threads as ours. One thread.

The large clouds are a city of halls, each turned by quarters and blurred by 2 mm from its own seed, planned by `evpose map
build --plan`, built by GNU parallel (examples/map_tiles_parallel.sh, one job for each core) and merged. The largest takes
most of an hour and 6 GB of disk.
"""
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import time

import numpy as np

import files
import harness
import tables

MILLIONS = [0.1, 1, 10]
PCL_MILLIONS = 1  # and no more: it has no tiles
CITY_MILLIONS = [1, 10, 100]
CITY_PITCH_M = 44
PCL_MODULES = ["pcl_features", "pcl_segmentation", "pcl_io", "pcl_search"]


def repeated(points, count):
    """Arrays of points that make `count` together."""
    side = int(np.ceil(np.sqrt(max(1.0, count / len(points)))))
    size = points.max(0) - points.min(0)
    for k in range(side * side):
        part = points
        if count < len(points):  # a slice of the hall, as dense as the whole
            part = points[np.argsort(points[:, 1], kind="stable")[:count]]
        yield part + np.array([k % side * (size[0] + 1), k // side * (size[1] + 1), 0], "<f4")
        count -= len(part)
        if count <= 0:
            return


def city(points, count):
    """Arrays of points that make `count` together: the same hall in a square of many, none exactly like another."""
    side = int(np.ceil(np.sqrt(count / len(points))))
    points = points - points.mean(0)
    for seed in range(side * side):
        random = np.random.default_rng(seed)
        c, s = [(1, 0), (0, 1), (-1, 0), (0, -1)][random.integers(4)]
        turned = points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + random.normal(0, 0.002, points.shape)
        part = (turned + np.array([seed % side, seed // side, 0]) * CITY_PITCH_M)[:count]
        yield part.astype("<f4")
        count -= len(part)
        if count <= 0:
            return


def measured(command, path=None):
    """Output, processor seconds, elapsed seconds and peak bytes of a command; the peak is that of the largest of its
    processes. `path`: folder of programs that it may call."""
    start = time.monotonic()
    environment = dict(os.environ, PATH=f"{path}:{os.environ['PATH']}") if path else None
    with tempfile.TemporaryFile("w+") as output:
        process = subprocess.Popen([str(word) for word in command], stdout=output, env=environment)
        _, status, usage = os.wait4(process.pid, 0)
        elapsed = time.monotonic() - start
        if status != 0:
            raise harness.Failure(f"{command[0]} failed")
        output.seek(0)
        return output.read(), usage.ru_utime + usage.ru_stime, elapsed, usage.ru_maxrss * 1024


def compiled_peer(folder):
    """The program of PCL's steps; None where it cannot be made."""
    if not shutil.which("pkg-config") or subprocess.run(["pkg-config", "--exists", *PCL_MODULES]).returncode != 0:
        return None
    flags = subprocess.run(["pkg-config", "--cflags", "--libs", *PCL_MODULES], capture_output=True, text=True).stdout.split()
    source = pathlib.Path(__file__).with_name("pcl_planes.cpp")
    subprocess.run(["c++", "-std=c++17", "-O3", "-march=x86-64-v3", "-fopenmp", source, "-o", folder / "pcl", *flags],
                   check=True)
    return folder / "pcl"


def measure(bench, million):
    """A row of ours, and one beside PCL or None."""
    count = int(million * 1e6)
    with bench.folder() as scratch:
        cloud = scratch / "cloud.ply"
        hall = files.Ply(bench.shared / "data/real/clouds/hall_lidar_4cm.ply").points().astype("<f4")
        files.write_points(cloud, repeated(hall, count), count)
        said, spent, elapsed, peak = measured([bench.evpose, "-q", "map", "build", cloud, "-o", scratch / "map.h5",
                                               "--threads", 1])
        neighbours, tiles, normals, planes = re.search(
            r"patches of (\d+)(?:, (\d+) tiles)?\n.*normals ([\d.]+), planes ([\d.]+)", said, re.DOTALL).groups()
        ours = [count, tiles or 1, f"{spent:.1f}", f"{spent / million:.1f}", f"{elapsed:.1f}", f"{peak / 1e6:.0f}",
                f"{peak / count:.0f}"]
        program = compiled_peer(scratch) if million <= PCL_MILLIONS else None
        if program is None:
            return {"ours": ours, "beside": None}
        of_peer, _, _, peer_peak = measured([program, cloud, neighbours, 1])
    _, peer_normals, growing, regions, share = of_peer.split()
    return {"ours": ours, "beside": [count, neighbours, normals, planes, f"{peak / 1e6:.0f}", peer_normals, growing,
                                     f"{peer_peak / 1e6:.0f}", f"{regions}, {100 * float(share):.0f} %"]}


def measure_city(bench, million):
    """A row of a city that is built tile by tile."""
    count = int(million * 1e6)
    with bench.folder() as scratch:
        cloud, tiles, merged = scratch / "city.ply", scratch / "tiles", scratch / "city.h5"
        hall = files.Ply(bench.shared / "data/real/clouds/hall_lidar_4cm.ply").points().astype("<f4")
        files.write_points(cloud, city(hall, count), count)
        said, plan_s, _, plan_peak = measured([bench.evpose, "-q", "map", "build", cloud, "--plan", tiles])
        number, largest = re.search(r"tiles +(\d+) of up to (\d+) points", said).groups()
        script = harness.ROOT / "examples/map_tiles_parallel.sh"
        _, spent, elapsed, peak = measured(["bash", script, cloud, tiles, merged], path=bench.evpose.parent)
        _, merge_s, _, merge_peak = measured([bench.evpose, "-q", "map", "merge", tiles, "-o", merged])
        jobs = [line.split("\t") for line in (tiles / "jobs.log").read_text().splitlines()[1:]]
        slowest = max(float(job[3]) for job in jobs)
        return [count, number, f"{float(largest) / 1e6:.1f}", f"{plan_s:.0f}", f"{plan_peak / 1e6:.0f}", f"{spent:.0f}",
                f"{spent / million:.1f}", f"{elapsed:.0f}", f"{slowest:.0f}", f"{peak / 1e6:.0f}", f"{merge_s:.0f}",
                f"{merge_peak / 1e6:.0f}", f"{merged.stat().st_size / 1e6:.0f}"]


def dated(table):
    """Each table says of itself when it was made, since they are made one by one."""
    return [f"At commit {harness.commit()}{harness.machine()}:", "", *table]


def cities(bench):
    """The table's rows, each a figure of its own that is kept; yields the table as far as it is made."""
    if not shutil.which("parallel"):
        yield ["GNU parallel was not there."]
        return
    rows = []
    for million in CITY_MILLIONS[:1] if bench.quick else CITY_MILLIONS:
        rows.append(bench.once(f"map-scale: city of {million} million", lambda: measure_city(bench, million)))
        yield tables.table(
            ["points", "tiles", "largest, million points", "plan: processor s", "MB", "jobs and merge: processor s", "s per million",
             "elapsed s", "slowest job s", "largest job MB", "merge: processor s", "MB", "map MB"], rows)


def make(bench):
    for table in cities(bench):  # the largest takes most of an hour: the page has the others by then
        page = bench.write_page("map-scale", {"city": dated(table)})
        print(f"  {page}: {len(table) - 2} cities", flush=True)
    rows = [bench.once(f"map-scale: {million} million", lambda: measure(bench, million))
            for million in (MILLIONS[:1] if bench.quick else MILLIONS)]
    ours = tables.table(["points", "tiles", "processor s", "s per million", "elapsed s", "peak memory MB", "bytes per point"],
                        [row["ours"] for row in rows])
    beside = [row["beside"] for row in rows if row["beside"]]
    peer = tables.table(["points", "neighbours", "ours: normals s", "planes s", "peak MB, whole build", "PCL: normals s",
                         "regions s", "peak MB", "regions, share of the points"], beside)
    made = {"ours": dated(ours), **({"PCL": dated(peer)} if beside else {})}  # without PCL its old figures stay
    return bench.write_page("map-scale", made)
