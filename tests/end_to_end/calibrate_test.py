#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Calibrating from recordings before a known map. calibrate_test.py EVPOSE"""
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

try:
    import h5py  # noqa: F401: the recordings need it
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)

from recording import CALIBRATION, Recording

EVPOSE = None


def numbers(chain, key):
    """Of a list on one line of a camera chain."""
    return [float(word) for word in re.search(rf"^  {key}: \[(.*)\]$", chain, re.MULTILINE).group(1).split(",")]


class CalibrateTest(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.root = pathlib.Path(scratch.name)

    def evpose(self, *words):
        return subprocess.run([str(word) for word in (EVPOSE, "-q", *words)], capture_output=True, text=True, timeout=280,
                              stdin=subprocess.DEVNULL)

    def calibrate(self, recording, start, *words):
        path = self.root / "start.yaml"
        path.write_text(start)
        return self.evpose("calibrate", recording, "--map", recording / "contours.ply", "--start", path, "-o",
                           self.root / "found.yaml", *words)

    def test_a_wrong_focal_length_is_found_and_every_command_reads_it(self):
        recording = Recording().write(self.root / "recording")
        true = numbers(CALIBRATION, "intrinsics")
        start = re.sub(r"intrinsics: \[.*\]", f"intrinsics: [{1.01 * true[0]}, {1.01 * true[1]}, {true[2]}, {true[3]}]",
                       CALIBRATION)
        done = self.calibrate(recording, start)
        self.assertIn(done.returncode, (0, 1), done.stderr)
        chain = (self.root / "found.yaml").read_text()
        for found, sigma, number in zip(numbers(chain, "intrinsics"), numbers(chain, "intrinsics_sigma"), true):
            self.assertLess(abs(found - number), 5 * sigma)
        self.assertLess(abs(numbers(chain, "intrinsics")[0] / true[0] - 1), 0.005)
        self.assertIn("calibration_correlation", chain)
        self.assertIn("<svg", (self.root / "found.html").read_text())
        self.assertEqual(self.evpose("info", self.root / "found.yaml").returncode, 0)
        again = self.calibrate(recording, start)
        self.assertEqual(again.returncode, 2)
        self.assertIn("found.yaml: exists", again.stderr)

    def test_what_cannot_be_calibrated_is_said_in_one_line(self):
        data = Recording()
        recording = data.write(self.root / "recording")
        zero = re.sub(r"intrinsics: \[[^,]*", "intrinsics: [0.0", CALIBRATION)
        negative = CALIBRATION + "  intrinsics_sigma: [1, 1, -1, 1]\n"
        for start, said in ((zero, "focal"), (negative, "is no standard deviation")):
            done = self.calibrate(recording, start)
            self.assertEqual(done.returncode, 2, done.stdout)
            self.assertIn(said, done.stderr)
            self.assertEqual(len(done.stderr.strip().splitlines()), 1, done.stderr)
            self.assertFalse((self.root / "found.yaml").exists())

    def test_a_board_that_is_not_there_is_said(self):
        recording = Recording().write(self.root / "recording")
        board = self.root / "board.h5"
        self.assertEqual(self.evpose("map", "board", "--checkerboard", "9x7", "--square", 0.08, "-o", board).returncode, 0)
        done = self.evpose("calibrate", recording, "--map", board, "--init", "board", "-o", self.root / "found.yaml")
        self.assertEqual(done.returncode, 2, done.stdout)
        self.assertIn("the board was not found", done.stderr)
        self.assertEqual(len(done.stderr.strip().splitlines()), 1, done.stderr)

    def test_boards_that_are_none_are_refused(self):
        for words in ((), ("--checkerboard", "9"), ("--checkerboard", "9x7"), ("--checkerboard", "1x7", "--square", 0.1),
                      ("--checkerboard", "9x7", "--square", -1), ("--checkerboard", "9x7", "--circles", "4x11"),
                      ("--circles", "4x11", "--distance", 0.02, "--diameter", 0.03)):
            done = self.evpose("map", "board", *words, "-o", self.root / "board.h5")
            self.assertEqual(done.returncode, 2, words)
            self.assertEqual(len(done.stderr.strip().splitlines()), 1, done.stderr)
            self.assertFalse((self.root / "board.h5").exists())


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    EVPOSE = sys.argv.pop(1)
    unittest.main()
