#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`evpose map learn` from a short simulated flight: from a run, interrupted, with a map that is wrong; and with input that it
cannot learn from: one line, exit status 2, nothing written. learn_test.py EVPOSE
"""
import json
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import zlib

try:
    import h5py
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)

from corridor import corridor
from recording import Recording

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / "benchmarks"))
from changed_map import MARKING, file_checksum

EVPOSE = None
FLIGHT = """
scene_file: scene.yaml
duration_s: 1
camera: {size: custom, width: 240, height: 180, focal_px: 170}
trajectory: {kind: traverse, centre_x_m: 6, centre_y_m: 0, centre_z_m: 1.4, size_forward_m: %s, size_left_m: %s, size_up_m: %s,
  speed_m_s: %s}
lidar: {on: true, flight: {kind: traverse, duration_s: 1, centre_x_m: 9, centre_y_m: 0, centre_z_m: 1.4, size_forward_m: 14,
  size_left_m: 0.6, size_up_m: 0.4, speed_m_s: 14}}
"""


def write_box(path):
    """A cloud of two walls and a floor around the recording's place."""
    a, b = np.meshgrid(np.arange(-2, 2, 0.02), np.arange(-2, 2, 0.02))
    a, b = a.ravel(), b.ravel()
    walls = [np.stack([np.full(a.size, 3.0), a, b + 1], axis=1), np.stack([a + 1, np.full(a.size, 2.0), b + 1], axis=1),
             np.stack([a + 1, b, np.full(a.size, -1.0)], axis=1)]
    points = np.concatenate(walls) + np.random.default_rng(1).normal(0, 0.005, (3 * a.size, 3))
    header = (f"VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {len(points)}\nHEIGHT 1\n"
              f"POINTS {len(points)}\nDATA binary\n")
    path.write_bytes(header.encode() + points.astype("<f4").tobytes())


def points(path):
    with h5py.File(path) as file:
        return {row.tobytes() for row in file["points/xyz"][:]}


class FlightTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.root = pathlib.Path(scratch.name)
        (cls.root / "scene.yaml").write_text(corridor(20))
        for name, motion in (("flight", (4, 1, 0.6, 3)), ("hover", (0.04, 0.02, 0.02, 0.1))):
            (cls.root / f"{name}.yaml").write_text(FLIGHT % motion)
            cls.run_program("simulate", cls.root / f"{name}.yaml", "-o", cls.root / name)
        cls.run_program("map", "build", cls.root / "flight/map_raw.ply", "-o", cls.root / "map.h5")

    @classmethod
    def run_program(cls, *words, statuses=(0,)):
        done = subprocess.run([EVPOSE, "-q", *map(str, words)], capture_output=True, text=True, timeout=200)
        if done.returncode not in statuses:
            raise AssertionError(f"status {done.returncode}: {done.stdout}{done.stderr}")
        return done

    def learn(self, output, *words, map_file="map.h5", statuses=(0,)):
        return self.run_program("map", "learn", self.root / map_file, *words, "-o", self.root / output, statuses=statuses)

    def report(self, name):
        return json.loads((self.root / f"{name}.json").read_text())

    def test_a_run_is_taken_and_what_was_not_seen_stays(self):
        self.run_program("track", self.root / "flight", "--map", self.root / "map.h5", "-o", self.root / "run", statuses=(0, 1))
        for name, words in (("tracked", []), ("taken", ["--run", self.root / "run"])):
            self.learn(f"{name}.h5", self.root / "flight", *words)
            flight = self.report(f"{name}.h5")["flights"][0]
            self.assertGreater(flight["tracking_share"], 0.6)
            self.assertGreater(flight["moved_m"], 5)
            before, after = points(self.root / "map.h5"), points(self.root / f"{name}.h5")
            self.assertGreater(len(before & after), 0.5 * len(before), "the flight sees less than half of the map")
            self.assertLess(len(before & after), len(before))
        changes = json.loads(self.run_program("map", "changes", self.root / "map.h5", self.root / "tracked.h5", "--json").stdout)
        self.assertEqual(changes, self.report("tracked.h5")["changes"])
        self.assertLess(changes["gone"]["m"] + changes["moved"]["m"], 0.1 * changes["same_m"])

    def test_an_interrupted_learning_goes_on_to_the_same_bytes(self):
        shutil.copytree(self.root / "flight", self.root / "again")
        flights = [self.root / "flight", self.root / "again"]
        self.learn("whole.h5", *flights)
        words = [EVPOSE, "-q", "map", "learn", self.root / "map.h5", *flights, "-o", self.root / "cut.h5"]
        process = subprocess.Popen([str(word) for word in words], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        done, until = self.root / "cut.h5.partial/flight_0.json", time.monotonic() + 100
        while not done.exists() and process.poll() is None and time.monotonic() < until:
            time.sleep(0.005)
        process.send_signal(signal.SIGINT)
        self.assertIn("interrupted", process.communicate(timeout=100)[1])
        self.assertEqual(process.returncode, 130)
        self.assertEqual([path.name for path in self.root.glob("cut*")], ["cut.h5.partial"])
        self.assertIn("done before", self.learn("cut.h5", *flights).stdout)
        self.assertEqual((self.root / "whole.h5").read_bytes(), (self.root / "cut.h5").read_bytes())
        self.assertEqual(self.report("whole.h5")["flights"], self.report("cut.h5")["flights"])
        self.assertEqual(sorted(path.name for path in self.root.glob("cut*")), ["cut.h5", "cut.h5.json"])

    def test_hovering_tells_nothing_and_that_is_said(self):
        done = self.learn("new.h5", self.root / "hover", statuses=(2,))
        self.assertRegex(done.stderr, r"^evpose: [^\n]*hover[^\n]*tells nothing[^\n]*\n$")
        self.assertFalse(list(self.root.glob("new*")))

    def test_without_planes_and_without_an_imu_there_are_no_markings(self):
        self.run_program("convert", self.root / "flight", self.root / "no_imu")
        for name in ("imu.csv", "imu.yaml"):
            (self.root / "no_imu" / name).unlink()
        for flight in ("flight", "no_imu"):
            with self.subTest(flight):
                self.learn(f"of_{flight}.h5", self.root / flight, "--init", "groundtruth", map_file="flight/contours.ply")
                self.assertGreater(self.report(f"of_{flight}.h5")["flights"][0]["moved_m"], 5)
                with h5py.File(self.root / f"of_{flight}.h5") as file:
                    self.assertNotIn(MARKING, file["contours/kind"][:])

    def test_planes_that_are_off_by_a_centimetre_move_no_contour_with_them(self):
        shutil.copy(self.root / "map.h5", self.root / "off.h5")
        with h5py.File(self.root / "off.h5", "r+") as file:
            d = file["planes/d"][:] + 0.01
            file["planes/d"][:] = d
            file["planes/d"].attrs.modify("crc32", np.uint32(zlib.crc32(d.tobytes())))
            file["meta"].attrs.modify("crc", np.uint32(file_checksum(file)))
        self.learn("of_off.h5", self.root / "flight", map_file="off.h5")
        self.learn("of_right.h5", self.root / "flight")
        changes = json.loads(self.run_program("map", "changes", self.root / "of_right.h5", self.root / "of_off.h5", "--json").stdout)
        changed = sum(changes[kind]["m"] for kind in ("moved", "gone", "new"))
        self.assertLess(changed, 0.05 * changes["same_m"])


class LearnTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.root = pathlib.Path(scratch.name)
        Recording().write(cls.root / "recording")
        write_box(cls.root / "box.pcd")
        subprocess.run([EVPOSE, "-q", "map", "build", cls.root / "box.pcd", "-o", cls.root / "map.h5"], check=True,
                       capture_output=True, timeout=120)

        subprocess.run([EVPOSE, "-q", "track", cls.root / "recording", "--map", cls.root / "recording/contours.ply", "-o",
                        cls.root / "run"], check=True, capture_output=True, timeout=120)

    def run_with(self, name, health=lambda row, word: word, **summary):
        """A copy of the run, as if it had been tracked with the box's map; `health` of each row."""
        shutil.copytree(self.root / "run", self.root / name)
        told = json.loads((self.root / name / "summary.json").read_text())
        told["input"]["map"] = str(self.root / "map.h5")
        (self.root / name / "summary.json").write_text(json.dumps({**told, **summary}))
        head, *rows = (self.root / name / "states.csv").read_text().splitlines()
        column = head.split(",").index("health")
        for number, row in enumerate(rows):
            cells = row.split(",")
            cells[column] = health(number / len(rows), cells[column])
            rows[number] = ",".join(cells)
        (self.root / name / "states.csv").write_text("\n".join([head, *rows]) + "\n")
        return self.root / name

    def refused(self, *words):
        result = subprocess.run([EVPOSE, "-q", "map", "learn", *words, "-o", self.root / "better.h5"], capture_output=True,
                                text=True, timeout=120)
        self.assertEqual(result.returncode, 2, result.stderr + result.stdout)
        self.assertRegex(result.stderr, r"^evpose: [^\n]*; [^\n]*\n$")
        self.assertFalse((self.root / "better.h5").exists())
        self.assertFalse((self.root / "better.h5.json").exists())
        return result.stderr

    def test_a_flight_of_another_place(self):
        self.assertRegex(self.refused(self.root / "map.h5", self.root / "recording"), "recording: was tracked in|comes into view")

    def test_a_recording_that_is_not_there(self):
        self.assertIn("none", self.refused(self.root / "map.h5", self.root / "none"))

    def test_runs_that_it_cannot_begin_with(self):
        flight = [self.root / "map.h5", self.root / "recording", "--run"]
        shutil.copytree(self.root / "recording", self.root / "other")
        for run, why in (
                (self.root / "recording", "is no run folder"),
                (self.root / "run", "was tracked with .*contours.ply, not with"),
                (self.run_with("lost", lambda at, word: "lost"), "was tracking in 0 %"),
                (self.run_with("lost_at_its_end", lambda at, word: "lost" if at > 0.9 else "tracking"), "lost at its end"),
                (self.run_with("broken_off", interrupted=True), "broken off")):
            with self.subTest(run.name):
                self.assertRegex(self.refused(*flight, run), why)
        self.assertIn("not from", self.refused(flight[0], self.root / "other", "--run", self.root / "lost"))
        self.assertIn("names 1 runs of 2", self.refused(*flight[:2], *flight[1:], self.root / "lost"))

    def test_the_map_itself_is_not_replaced(self):
        before = (self.root / "map.h5").read_bytes()
        result = subprocess.run([EVPOSE, "-q", "map", "learn", self.root / "map.h5", self.root / "recording", "-o",
                                 self.root / "map.h5"], capture_output=True, text=True, timeout=120)
        self.assertEqual(result.returncode, 2)
        self.assertIn("is the map that is learnt from", result.stderr)
        self.assertEqual(before, (self.root / "map.h5").read_bytes())


if __name__ == "__main__":
    EVPOSE = sys.argv.pop(1)
    unittest.main()
