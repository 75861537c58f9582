#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A run that goes wrong says why, and its exit status is 1. bad_run_test.py EVPOSE"""
import json
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest

try:
    import h5py  # noqa: F401: the recordings need it
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)

from recording import Recording

EVPOSE = None


class BadRunTest(unittest.TestCase):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.addCleanup(self.scratch.cleanup)
        self.root = pathlib.Path(self.scratch.name)
        self.recording = Recording()

    def track(self, *more):
        folder = self.root / "recording"
        if not folder.exists():
            self.recording.write(folder)
        command = [EVPOSE, "track", folder, "-o", self.root / "run", *more]
        return subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=60,
                              stdin=subprocess.DEVNULL)

    def summary(self):
        return json.loads((self.root / "run/summary.json").read_text())

    def bad_run(self, *more):
        result = self.track(*more)
        self.assertEqual(result.returncode, 1, result.stderr + result.stdout)
        self.assertIn("less than 90 %", result.stdout)
        summary = self.summary()
        self.assertLess(summary["tracking_share"], 0.9)
        for problem in summary["problems"]:
            self.assertTrue(problem["cause"] and problem["remedy"], problem)
        # What the longest was stands on the terminal, too.
        for key in ("reason", "cause", "remedy"):
            self.assertIn(summary["problems"][0][key], result.stdout)
        return result.stdout, summary

    def test_a_good_run_says_where_it_started_and_nothing_else(self):
        result = self.track()
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("started from ground truth", result.stdout)
        self.assertIn("tracking in 100.0 % of the updates", result.stdout)
        summary = self.summary()
        self.assertEqual((summary["problems"], summary["findings"]), ([], []))
        self.assertEqual(summary["start"], "started from ground truth")

    def test_a_wrong_start(self):
        said, _ = self.bad_run("--init", "0.5,0.6,1.4,0,0,0.1,0.995")
        self.assertIn("started from --init", said)

    def test_a_start_that_is_not_upright(self):
        said, summary = self.bad_run("--init", "0,0.3,1,0.7071068,0,0,0.7071068")
        self.assertRegex(said, r"imu\.csv: at the start the accelerometer's up lies (9|10)\d deg off the map's z")
        self.assertIn("off the map's z", summary["findings"][0]["what"])

    def test_contours_of_another_place(self):
        self.recording.contours[:, 1:3] = self.recording.contours[:, 1:3] * 1.3 + 0.17
        self.bad_run()

    def test_axes_of_the_imu_that_are_mixed_up(self):
        self.recording = Recording(duration_s=2)
        self.recording.imu[:, 3:] = self.recording.imu[:, [5, 4, 3]] * [1, 1, -1]
        said = self.track()
        self.assertRegex(said.stderr, r"warning: .*imu\.csv: the accelerometer's axes do not fit the ground truth's .*"
                                      r"y were y, z were x; rename the columns")
        told = subprocess.run([EVPOSE, "info", self.root / "recording"], capture_output=True, text=True, timeout=60)
        self.assertIn("y were y, z were x", told.stdout)

    def test_a_cloud_is_no_map(self):
        a, b = np.meshgrid(np.arange(-1.5, 1.5, 0.02), np.arange(-1.5, 1.5, 0.02))
        wall = np.stack([np.full(a.size, 3.0), a.ravel(), b.ravel() + 1], axis=1)
        cloud = self.root / "wall.pcd"
        header = (f"VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {len(wall)}\nHEIGHT 1\n"
                  f"POINTS {len(wall)}\nDATA binary\n")
        cloud.write_bytes(header.encode() + wall.astype("<f4").tobytes())
        result = self.track("--map", cloud)
        self.assertEqual(result.returncode, 2, result.stdout)
        self.assertRegex(result.stderr, r"^evpose: .*wall\.pcd: is a cloud.*; run `evpose map build .*`.*\n$")
        told = subprocess.run([EVPOSE, "info", cloud], capture_output=True, text=True, timeout=60)
        self.assertEqual(told.returncode, 0, told.stderr)
        self.assertIn("evpose map build", told.stdout)

    def test_an_interrupted_run_is_complete_up_to_there(self):
        self.recording = Recording(duration_s=8)
        self.recording.write(self.root / "recording")
        command = [EVPOSE, "track", self.root / "recording", "-o", self.root / "run", "--set", "packet_ms=0.01",
                   "--set", "rate_hz=2000"]
        process = subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                   text=True, stdin=subprocess.DEVNULL)
        states = None
        while not states and process.poll() is None:  # until some of it is tracked
            time.sleep(0.01)
            states = [path for path in self.root.glob(".run.partial-*/*") if path.stat().st_size > 100_000]
        self.assertIsNone(process.poll(), "ended before it could be interrupted: give it more to do")
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130, err)
        self.assertIn("; interrupted", out)
        for name in ("trajectory.tum", "states.csv", "summary.json", "report.html", "config.yaml"):
            self.assertGreater((self.root / "run" / name).stat().st_size, 0, name)
        self.assertTrue(self.summary()["interrupted"])
        last_s = np.loadtxt(self.root / "run/trajectory.tum")[-1, 0]
        self.assertTrue(0 < last_s < 7.9, last_s)
        self.assertEqual({path.name for path in self.root.iterdir()}, {"recording", "run"})

    def test_events_without_contours(self):
        rows = len(self.recording.contours)
        self.recording.contours = self.recording.contours[np.arange(rows) % 600 < 3]  # a few dots of each line
        said, summary = self.bad_run()
        self.assertIn("state", summary["problems"][0], said)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    EVPOSE = sys.argv.pop(1)
    unittest.main()
