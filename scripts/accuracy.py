#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The table of docs/results/accuracy.md: every shared recording, tracked with the shipped defaults.

    accuracy.py EVPOSE SHARED OUT.md     about two minutes

Each row is one run from ground truth, without alignment. Figures are those of the run's summary.json over the whole
run, and, after 0.3 s, of `evpose eval --from`. Needs numpy and h5py for the real chunk.
"""
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

RECORDINGS = {"room_spiral": "room", "room_720p": "room", "room_people": "room", "room_hover": "room",
              "courtyard_landing": "courtyard"}
VARIANTS = [  # name, extra arguments, with the IMU
    ("each event once", ["--occluders"], True),
    ("each event once, no occluders", [], True),
    ("the paper's field", ["--occluders", "--set", "field=exponential"], True),
    ("the paper's field, bilinear", ["--occluders", "--set", "field=exponential", "--set", "exponential.kernel=bilinear"],
     True),
    ("the paper's field, 5 ms everywhere", ["--occluders", "--set", "field=exponential", "--set",
                                            "exponential.decay_min_s=0.005", "--set", "exponential.decay_max_s=0.005"],
     True),
    ("the paper's field, 30 ms everywhere", ["--occluders", "--set", "field=exponential", "--set",
                                             "exponential.decay_min_s=0.03", "--set", "exponential.decay_max_s=0.03"],
     True),
    ("each event once, no IMU", ["--occluders"], False),
    ("the paper's field, no IMU", ["--occluders", "--set", "field=exponential"], False),
]


def without_imu(folder, target):
    target.mkdir()
    for name in ("events.h5", "groundtruth.tum", "camchain-imucam.yaml"):
        shutil.copy(folder / name, target / name)
    return target


def run(evpose, shared, scratch, recording, extra, imu):
    source = shared / "data/peer" / recording
    if not imu:
        source = without_imu(source, scratch / "recording")
    maps = shared / "data/peer/maps"
    arguments = []
    for word in extra:
        arguments += [word, maps / f"{RECORDINGS[recording]}_mesh.ply"] if word == "--occluders" else [word]
    command = [evpose, "-q", "track", source, "--map", maps / f"{RECORDINGS[recording]}_contours.ply", "-o",
               scratch / "run", *arguments]
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    if done.returncode == 2:
        sys.exit(done.stderr)
    summary = json.loads((scratch / "run/summary.json").read_text())
    truth = source / "groundtruth.tum"
    later = subprocess.run([evpose, "eval", str(scratch / "run/trajectory.tum"), str(truth), "--from", "0.3", "--json"],
                           capture_output=True, text=True, check=True)
    return summary, json.loads(later.stdout).get("accuracy", json.loads(later.stdout))


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    evpose, shared, out = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    lines = ["Made by `scripts/accuracy.py`; do not edit.", ""]
    for name, extra, imu in VARIANTS:
        lines += [f"### {name[0].upper()}{name[1:]}", "",
                  "| recording | status | coverage | ATE mean mm | after 0.3 s | max mm | ARE mean deg | after 0.3 s | lag ms | NEES/6 |",
                  "|---|---|---|---|---|---|---|---|---|---|"]
        for recording in RECORDINGS:
            with tempfile.TemporaryDirectory() as scratch:
                summary, later = run(evpose, shared, pathlib.Path(scratch), recording, extra, imu)
            a = summary["accuracy"]
            lines.append(f"| {recording} | {summary['status']} | {summary['coverage']:.3f} | {a['ate_mean_mm']:.2f} | "
                         f"{later['ate_mean_mm']:.2f} | {a['ate_max_mm']:.1f} | {a['are_mean_deg']:.3f} | "
                         f"{later['are_mean_deg']:.3f} | {a['lag_ms']:.2f} | {a['nees6_mean']:.2f} |")
            print(lines[-1], flush=True)
        lines.append("")
    with tempfile.TemporaryDirectory() as scratch:
        chunk = subprocess.run([sys.executable, str(pathlib.Path(__file__).parent / "mvsec_chunk.py"), evpose,
                                str(shared / "data/real/mvsec_indoor_flying1_chunk"), scratch, "--json"],
                               capture_output=True, text=True, check=True)
    lines += ["### Real hexacopter, events alone (`scripts/mvsec_chunk.py`)", "", "| figure | value |", "|---|---|"]
    lines += [f"| {k} | {v} |" for k, v in json.loads(chunk.stdout).items()]
    out.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
