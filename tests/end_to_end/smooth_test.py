#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The trajectory from past and future data. smooth_test.py EVPOSE"""
import json
import pathlib
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


class SmoothTest(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.root = pathlib.Path(scratch.name)

    def run_on(self, command, recording, name, *settings):
        words = [EVPOSE, "-q", command, recording, "--map", recording / "contours.ply", "-o", self.root / name]
        for setting in settings:
            words += ["--set", setting]
        return subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=120,
                              stdin=subprocess.DEVNULL)

    def accuracy(self, command, recording):
        done = self.run_on(command, recording, command)
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads((self.root / command / "summary.json").read_text())["accuracy"]

    def test_it_is_closer_to_the_truth_than_the_filter_and_smoother(self):
        recording = Recording().write(self.root / "recording")
        filtered, smoothed = (self.accuracy(command, recording) for command in ("track", "smooth"))
        for figure in ("ate_mean_mm", "are_mean_deg", "velocity_rmse_mm_s", "jitter_mm"):
            self.assertLess(smoothed[figure], filtered[figure], figure)

    def test_any_packets_and_threads_give_the_same_bytes(self):
        recording = Recording()
        recording.calibration = CALIBRATION  # states nothing of its errors: they are estimated, too
        folder = recording.write(self.root / "recording")
        written = []
        for name, *settings in (("a",), ("b", "packet_ms=7", "threads=3")):
            done = self.run_on("smooth", folder, name, *settings)
            self.assertIn(done.returncode, (0, 1), done.stderr)
            written.append((self.root / name / "states.csv").read_bytes())
        self.assertTrue(written[0] == written[1])
        self.assertTrue((self.root / "a/calibration.yaml").exists())

    def test_what_cannot_be_smoothed_is_said(self):
        recording = Recording()
        recording.contours = recording.contours - [100, 0, 0, 0, 0, 0]  # behind the camera, far away
        done = self.run_on("smooth", recording.write(self.root / "recording"), "run")
        self.assertEqual(done.returncode, 2)
        self.assertEqual(len(done.stderr.strip().splitlines()), 1, done.stderr)
        self.assertFalse((self.root / "run").exists())


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    EVPOSE = sys.argv.pop(1)
    unittest.main()
