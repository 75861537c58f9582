#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Trajectories keep every bit: trajectories_test.py EVPOSE SOURCE_FOLDER [--write]

Tracks the five shared recordings and two simulated flights and compares the SHA-256 of what is
written with trajectories.json. A change that is meant to leave the estimate alone leaves these alone; one that is not
says why, shows the table of accuracy beside it and writes the new ones with --write. The shared recordings need the
shared data folder (EVPOSE_SHARED, or beside the source folder); that part is skipped by name without it. The ray caster
of the simulator rounds as the widest vector instructions of the processor do; that part is skipped by name on others.
"""
import hashlib
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

HASHES = pathlib.Path(__file__).with_name("trajectories.json")
MAPS = {"room_spiral": "room", "room_720p": "room", "room_people": "room", "room_hover": "room",
        "courtyard_landing": "courtyard"}
SHARED_RUNS = [*MAPS, "room_people, calibration uncertain"]
SIMULATED = {"indoor_spiral": [], "landing": []}
SMALL = ["duration_s=0.4", "camera.size=custom", "camera.width=240", "camera.height=180", "camera.focal_px=160"]


def vector_instructions():
    return "avx512" if " avx512f " in pathlib.Path("/proc/cpuinfo").read_text() else "avx2"


def run(*command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=600,
                          stdin=subprocess.DEVNULL)
    if done.returncode not in (0, 1):  # 1: not tracked well, of small flights
        raise AssertionError(f"{command[:3]}: status {done.returncode}: {done.stderr}{done.stdout}")


def track(folder, recording, contours, mesh, *settings):
    run(EVPOSE, "-q", "track", recording, "--map", contours, "--occluders", mesh, "-o", folder / "run", *settings)
    return {name: hashlib.sha256((folder / "run" / name).read_bytes()).hexdigest()
            for name in ("trajectory.tum", "states.csv")}


def shared_recording(folder, name):
    """With its calibration, which is the truth, known; "NAME, calibration uncertain": as it states to be."""
    data, (name, *uncertain) = SHARED / "data/peer", name.split(", ")
    known = [] if uncertain else ["--set", "fusion.calibration.on=false"]
    return track(folder, data / name, data / f"maps/{MAPS[name]}_contours.ply", data / f"maps/{MAPS[name]}_mesh.ply", *known)


def simulated_flight(folder, name):
    sets = [word for setting in SMALL + SIMULATED[name] for word in ("--set", setting)]
    run(EVPOSE, "-q", "simulate", SOURCE / f"scenarios/{name}.yaml", "-o", folder / "recording", *sets)
    recording = folder / "recording"
    hashes = {"events.h5": hashlib.sha256((recording / "events.h5").read_bytes()).hexdigest()}
    return hashes | track(folder, recording, recording / "contours.ply", recording / "mesh.ply")


def in_scratch(make, name):
    with tempfile.TemporaryDirectory() as folder:
        return make(pathlib.Path(folder), name)


class Trajectories(unittest.TestCase):
    def compare(self, make, names):
        known = json.loads(HASHES.read_text())
        for name in names:
            with self.subTest(name):
                self.assertEqual(in_scratch(make, name), known[name])

    def test_shared_recordings(self):
        if not SHARED.is_dir():
            self.skipTest("the shared data folder is not there")
        self.compare(shared_recording, SHARED_RUNS)

    def test_simulated_flights(self):
        known = json.loads(HASHES.read_text())["vector_instructions"]
        if vector_instructions() != known:
            self.skipTest(f"the hashes were made on a processor with {known}")
        self.compare(simulated_flight, SIMULATED)


if __name__ == "__main__":
    write = "--write" in sys.argv and not sys.argv.remove("--write")
    EVPOSE, SOURCE = sys.argv.pop(1), pathlib.Path(sys.argv.pop(1))
    SHARED = pathlib.Path(os.environ.get("EVPOSE_SHARED", SOURCE.parent / "shared"))
    if not write:
        unittest.main()
    hashes = {name: in_scratch(shared_recording, name) for name in SHARED_RUNS}
    hashes |= {name: in_scratch(simulated_flight, name) for name in SIMULATED}
    hashes["vector_instructions"] = vector_instructions()
    HASHES.write_text(json.dumps(hashes, indent=1) + "\n")
