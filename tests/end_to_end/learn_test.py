#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`evpose map learn` with input that it cannot learn from: one line, exit status 2, nothing written. learn_test.py EVPOSE"""
import pathlib
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
