# SPDX-License-Identifier: BSD-3-Clause
"""A section of docs/results/paper.md: frameworks and early stage of the paper's form where more is asked of them than the
recordings do: a noisy IMU, fewer updates, a noisy sensor."""
import dataclasses
import re
import shutil

import experiments
import h5py
import numpy as np
import tables

IMU_FACTOR = 20          # of the white noise that imu.yaml states
NOISE_HZ = 10            # events a second of each pixel, at random
SEED = 1
FRAMEWORKS = ["paper: particle filter", "paper: EKF", "paper"]
EARLY = ["paper: both polarities everywhere", "paper: no noise filter", "paper: no early stage", "paper"]


def copy(bench, recording, name):
    """A folder with the recording's files, to be changed; and whether it has to be."""
    folder = bench.scratch / "recordings" / f"{recording.name}_{name}"
    made = folder.exists()
    if not made:
        part = folder.with_suffix(".part")
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        for file in recording.folder.iterdir():
            if file.is_file():
                shutil.copyfile(file, part / file.name)
        folder = part
    return dataclasses.replace(recording, folder=folder, name=recording.name), made


def finished(recording):
    folder = recording.folder.with_suffix("")
    recording.folder.rename(folder)
    return dataclasses.replace(recording, folder=folder)


def with_noisy_imu(bench, recording):
    out, made = copy(bench, recording, f"imu_x{IMU_FACTOR}")
    if made:
        return out
    stated = (out.folder / "imu.yaml").read_text()
    density = {key: float(re.search(key + r":\s*(\S+)", stated)[1]) for key in
               ("gyroscope_noise_density", "accelerometer_noise_density", "update_rate")}
    rows = np.loadtxt(out.folder / "imu.csv", delimiter=",")
    random = np.random.default_rng(SEED)
    added = np.sqrt((IMU_FACTOR ** 2 - 1) * density["update_rate"])
    rows[:, 1:4] += random.normal(0, added * density["gyroscope_noise_density"], rows[:, 1:4].shape)
    rows[:, 4:7] += random.normal(0, added * density["accelerometer_noise_density"], rows[:, 4:7].shape)
    with open(out.folder / "imu.csv", "w") as file:
        file.write("#timestamp_ns,wx,wy,wz,ax,ay,az\n")
        for row in rows:
            file.write(f"{int(row[0])}," + ",".join(f"{v:.7f}" for v in row[1:]) + "\n")
    for key in ("gyroscope_noise_density", "accelerometer_noise_density"):
        stated = re.sub(key + r":.*", f"{key}: {IMU_FACTOR * density[key]}", stated)
    (out.folder / "imu.yaml").write_text(stated)
    return finished(out)


def with_noisy_events(bench, recording):
    out, made = copy(bench, recording, f"events_{NOISE_HZ}hz")
    if made:
        return out
    calibration = (out.folder / "camchain-imucam.yaml").read_text()
    width, height = (int(v) for v in re.search(r"resolution:\s*\[(\d+),\s*(\d+)\]", calibration).groups())
    random = np.random.default_rng(SEED)
    with h5py.File(out.folder / "events.h5", "r+") as file:
        columns = {name: file["events/" + name][:] for name in "txyp"}
        begin, end = int(columns["t"][0]), int(columns["t"][-1])
        count = random.poisson(1e-6 * (end - begin) * NOISE_HZ * width * height)
        noise = {"t": random.integers(begin, end, count), "x": random.integers(0, width, count),
                 "y": random.integers(0, height, count), "p": random.integers(0, 2, count)}
        order = np.argsort(np.concatenate([columns["t"], noise["t"]]), kind="stable")
        for name, column in columns.items():
            both = np.concatenate([column, noise[name].astype(column.dtype)])[order]
            del file["events/" + name]
            file.create_dataset("events/" + name, data=both)
        for name in [n for n in file if n.startswith("ms_to_idx")]:
            del file[name]
    return finished(out)


CONDITIONS = {"as recorded": (lambda bench, recording: recording, ()),
              f"IMU {IMU_FACTOR} times as noisy": (with_noisy_imu, ()),
              "100 updates a second": (lambda bench, recording: recording, ("--set", "rate_hz=100")),
              f"{NOISE_HZ} events of noise a pixel and second": (with_noisy_events, ())}


def measure(bench, recording, condition, words, names):
    """Rows of `evpose bench paper` by variant."""
    def run():
        begins = [w for name in names for w in ("--variant", name)]
        return bench.run("bench", "paper", "--recording", recording.folder, "--map", recording.contours, "--occluders",
                         recording.mesh, *begins, *words)
    printed = bench.once(f"paper order: {recording.name}, {condition}", run)
    (rows,) = tables.read(printed).values()
    return {row["variant"]: row for row in rows if row["variant"] in names}


def section(bench):
    peers, names = bench.peers(), list(dict.fromkeys([*EARLY, *FRAMEWORKS]))
    rows = []
    for condition, (change, words) in list(CONDITIONS.items())[:1 if bench.quick else None]:
        measured = [measure(bench, change(bench, r), condition, words, names) for r in peers]
        for name in names:
            found = [m[name] for m in measured if name in m]
            ate = [float(row["ATE mean mm"]) for row in found]
            rows.append([condition, name, f"{np.mean(ate):.2f}", f"{np.median(ate):.2f}",
                         f"{np.mean([float(row['ARE mean deg']) for row in found]):.3f}",
                         f"{np.mean([float(row['tracked %']) for row in found]):.0f}",
                         *(f"{np.mean([float(row[key]) for row in found]):.1f}" for key in ("noise %", "wrong polarity %"))])
    head = ["condition", "variant", "mean ATE mm", "median of the recordings", "mean ARE deg", "tracking %",
            "events dropped by the filter %", "left out for polarity %"]
    return tables.table(head, rows)
