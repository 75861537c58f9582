#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`evpose map learn` with input that it cannot learn from: one line, exit status 2, nothing written. learn_test.py EVPOSE"""
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

try:
    import h5py  # noqa: F401: the recordings need it
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)

from recording import Recording

EVPOSE = None


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

    def test_a_map_without_planes(self):
        self.assertIn("has no planes", self.refused(self.root / "recording/contours.ply", self.root / "recording"))

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
