#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Tracks a recording folder through the Python module: example.py RECORDING MAP OUT.tum"""
import pathlib
import sys

import h5py
import numpy as np

import evpose

folder, map_path, out_path = pathlib.Path(sys.argv[1]), sys.argv[2], sys.argv[3]
imu = np.loadtxt(folder / "imu.csv", delimiter=",", skiprows=1)
imu_t = np.loadtxt(folder / "imu.csv", delimiter=",", skiprows=1, usecols=0, dtype=np.int64)
truth = np.loadtxt(folder / "groundtruth.tum")

# Where it starts: the first true pose, at the speed of the first two.
x, y, z, w = truth[0, 4:]
start = np.eye(4)
start[:3, :3] = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                 [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                 [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
start[:3, 3] = truth[0, 1:4]
velocity = (truth[1, 1:4] - truth[0, 1:4]) / (truth[1, 0] - truth[0, 0])

tracker = evpose.Tracker(map=map_path, calibration=str(folder / "camchain-imucam.yaml"), T_map_body=start,
                         t_ns=round(truth[0, 0] * 1e9), velocity=velocity, imu_model=str(folder / "imu.yaml"))
rows = []


def keep(update):
    if update.health not in ("waiting", "lost"):
        rows.append((update.t_ns * 1e-9, *update.position, *update.quaternion))


tracker.on_update(keep)

with h5py.File(folder / "events.h5") as file:
    t, px, py, p = (file["events/" + name][:] for name in ("t", "x", "y", "p"))
sent = 0
for begin in range(int(t[0]), int(t[-1]), 5000):  # as they would come: 5 ms at a time
    until = np.searchsorted(imu_t, (begin + 5000) * 1000)
    tracker.add_imu(imu_t[sent:until], imu[sent:until, 1:])
    sent = until
    part = slice(*np.searchsorted(t, [begin, begin + 5000]))
    tracker.add_events(t[part], px[part], py[part], p[part])

np.savetxt(out_path, rows, fmt="%.9f")
print(f"{len(rows)} poses")
