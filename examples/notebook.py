# SPDX-License-Identifier: BSD-3-Clause
# %% [markdown]
# # A flight in a notebook
# Reads a recording and its map, tracks it, looks at the result, finds its pose from a poor start, smooths it,
# and feeds a tracker piece by piece. Jupytext, VS Code and Spyder open this file as a notebook; it also runs as it is:
# `EVPOSE_RECORDING=flight python3 examples/notebook.py`. Needs numpy, matplotlib and the module `evpose`.

# %%
import os
import pathlib

import matplotlib.pyplot as plt
import numpy as np

import evpose

RECORDING = pathlib.Path(os.environ.get("EVPOSE_RECORDING", "flight"))
MAP = os.environ.get("EVPOSE_MAP", "")  # empty: the recording's own
OUTPUT = pathlib.Path(os.environ.get("EVPOSE_OUTPUT", "notebook"))
OUTPUT.mkdir(exist_ok=True)


def show(name):
    """Keeps the figure, too."""
    plt.tight_layout()
    plt.savefig(OUTPUT / f"{name}.png", dpi=100)
    plt.show()


# %% [markdown]
# ## The recording
# Events as columns, IMU samples as rows, ground truth as 4x4 matrices; all on the IMU's clock.

# %%
recording = evpose.Recording(RECORDING)
t_us, x, y, p = recording.events()
imu_ns, imu = recording.imu()
print(f"{recording.name}: {len(t_us)} events of {recording.width}x{recording.height} px, {len(imu_ns)} IMU samples")

figure, (rate, picture) = plt.subplots(1, 2, figsize=(11, 4))
bins = np.arange(t_us[0], t_us[-1] + 10_000, 10_000)
rate.plot(1e-6 * bins[:-1], np.histogram(t_us, bins)[0] / 1e4)
rate.set(xlabel="time [s]", ylabel="events [million / s]")
middle = slice(*np.searchsorted(t_us, [t_us[len(t_us) // 2], t_us[len(t_us) // 2] + 20_000]))
picture.scatter(x[middle], y[middle], s=0.3, c=np.where(p[middle] == 1, "tab:red", "tab:blue"))
picture.set(xlim=(0, recording.width), ylim=(recording.height, 0), aspect="equal", title="events of 20 ms")
show("recording")

# %% [markdown]
# ## The map
# From a point cloud: `evpose.build_map("hall.ply", "hall.h5")`.

# %%
map_path = MAP or recording.map
contours = evpose.Map(map_path)
print(f"{len(contours.points)} contour points; kinds: {', '.join(sorted(set(contours.kind)))}")

# %% [markdown]
# ## Tracking
# `track` does what the program's `evpose track` does and leaves the same run folder, `report.html` in it.
# `evpose.Run(folder)` reads it again.

# %%
run = evpose.track(RECORDING, OUTPUT / "run", map=map_path, replace=True)
seconds = 1e-9 * (run.t_ns - run.t_ns[0])
position = run.T_map_body[:, :3, 3]
sigma = np.sqrt(run.covariance[:, [0, 1, 2], [0, 1, 2]])
print(f"{run.summary['status']}, {100 * run.valid.mean():.0f} % of the updates have a pose")

truth_ns, truth = recording.groundtruth()
figure, (above, error) = plt.subplots(1, 2, figsize=(11, 4))
above.scatter(*contours.points[:, :2].T, s=0.2, color="0.7", label="map")
above.plot(*truth[:, :2, 3].T, color="0.4", linewidth=4, label="ground truth")
above.plot(*position[run.valid, :2].T, label="estimate")
above.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
above.legend(loc="upper left")
for axis, name in enumerate("xyz"):
    true_one = np.interp(run.t_ns, truth_ns, truth[:, axis, 3])
    error.plot(seconds[run.valid], 1e3 * (position[run.valid, axis] - true_one[run.valid]), label=name)
    error.fill_between(seconds, -3e3 * sigma[:, axis], 3e3 * sigma[:, axis], alpha=0.1)
error.set(xlabel="time [s]", ylabel="error [mm], shaded: 3 sigma")
error.legend(loc="upper left")
show("track")

# %% [markdown]
# Every column of `states.csv`, `latency.csv` and `calibration.csv` is an array, too.

# %%
states = run.table("states.csv")
for name in "xyz":
    plt.plot(seconds, states[f"gyro_bias_{name}_rad_s"], label=name)
plt.xlabel("time [s]")
plt.ylabel("gyroscope's bias [rad/s]")
plt.legend(loc="upper left")
show("biases")

# %% [markdown]
# ## A poor start
# A pose that is known to a few centimetres and a degree or two per axis is searched before it is tracked.

# %%
at = recording.first_ns
first = np.searchsorted(truth_ns, at)
start = truth[first].copy()
start[:3, 3] = [np.interp(at, truth_ns, truth[:, axis, 3]) for axis in range(3)]


def quaternion(T):
    """x y z w of a turn of less than half a circle."""
    w = 0.5 * np.sqrt(1 + np.trace(T[:3, :3]))
    return [*(np.array([T[2, 1] - T[1, 2], T[0, 2] - T[2, 0], T[1, 0] - T[0, 1]]) / (4 * w)), w]


beside = np.array([0.02, -0.02, 0.01])
words = ",".join(f"{v:.6f}" for v in (*(start[:3, 3] + beside), *quaternion(start))) + f"@{1e-9 * at:.6f}"
found = evpose.relocalise(RECORDING, words, (0.03, 1), map=map_path)
off = found.position - [np.interp(found.t_ns, truth_ns, truth[:, axis, 3]) for axis in range(3)]
print(f"from {1e3 * np.linalg.norm(beside):.0f} mm beside: {found.health} after {1e-6 * (found.t_ns - at):.0f} ms, "
      f"{1e3 * np.linalg.norm(off):.1f} mm off")

# %% [markdown]
# ## Afterwards: all data at once
# `smooth` estimates the whole trajectory from past and future data.

# %%
smoothed = evpose.smooth(RECORDING, OUTPUT / "smoothed", map=map_path, replace=True)
for name, judged in (("tracked", run), ("smoothed", smoothed)):
    truth_at = np.stack([np.interp(judged.t_ns, truth_ns, truth[:, axis, 3]) for axis in range(3)], 1)
    error_m = np.linalg.norm(judged.T_map_body[judged.valid, :3, 3] - truth_at[judged.valid], axis=1)
    print(f"{name}: {1e3 * error_m.mean():.1f} mm in the mean")

# %% [markdown]
# ## Piece by piece
# The same tracker, fed as data come. An update is handed back as soon as it is made.

# %%
velocity = np.gradient(truth[:, :3, 3], 1e-9 * truth_ns, axis=0)[first]
tracker = evpose.Tracker(map_path, recording.calibration, start, at, velocity=velocity, imu_model=recording.imu_model)
updates, sent = [], 0
for begin in range(int(t_us[0]), int(t_us[-1]), 5000):  # 5 ms at a time
    until = np.searchsorted(imu_ns, 1000 * (begin + 5000))
    updates += tracker.add_imu(imu_ns[sent:until], imu[sent:until])
    sent = until
    part = slice(*np.searchsorted(t_us, [begin, begin + 5000]))
    updates += tracker.add_events(t_us[part], x[part], y[part], p[part])
print(f"{len(updates)} updates; the last is {updates[-1].health} at {np.round(updates[-1].position, 3)} m")
