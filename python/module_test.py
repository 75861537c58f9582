#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The Python module: module_test.py FOLDER_OF_MODULE SOURCE"""
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy as np

MODULE, SOURCE = pathlib.Path(sys.argv.pop(1)), pathlib.Path(sys.argv.pop(1))
sys.path[:0] = [str(MODULE), str(SOURCE / "tests/end_to_end")]
import evpose  # noqa: E402
from recording import Recording, position  # noqa: E402


class ModuleTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.recording = Recording()
        cls.folder = cls.recording.write(pathlib.Path(scratch.name) / "recording")

    def tracker(self, **changes):
        start = np.eye(4)
        start[:3, 3] = position(0)
        arguments = {"map": str(self.folder / "contours.ply"), "calibration": str(self.folder / "camchain-imucam.yaml"),
                     "T_map_body": start, "t_ns": 0, "velocity": np.array([0, 0.6, 0.5])}
        return evpose.Tracker(**{**arguments, **changes})

    def feed(self, tracker, step_us):
        r, out = self.recording, []
        for begin in range(0, 600_000, step_us):
            samples = (r.imu_t_ns >= begin * 1000) & (r.imu_t_ns < (begin + step_us) * 1000)
            out += tracker.add_imu(r.imu_t_ns[samples], r.imu[samples])
            part = (r.t >= begin) & (r.t < begin + step_us)
            out += tracker.add_events(r.t[part], r.x[part], r.y[part], r.p[part])
        return out

    def test_poses_come_back_and_do_not_depend_on_pieces(self):
        called = []
        tracker = self.tracker()
        tracker.on_update(called.append)
        updates = self.feed(tracker, 10_000)
        self.assertEqual(len(called), len(updates))
        self.assertGreater(len(updates), 170)
        other = self.feed(self.tracker(), 3_000)
        for a, b in zip(updates, other):
            self.assertEqual(a.t_ns, b.t_ns)
            np.testing.assert_array_equal(a.T_map_body, b.T_map_body)
        last = updates[-1]
        self.assertEqual(last.covariance.shape, (6, 6))
        np.testing.assert_allclose(last.T_map_body[:3, 3], last.position)
        self.assertIn(last.health, ("tracking", "degraded", "lost"))
        errors = [np.linalg.norm(u.position - position(u.t_ns * 1e-9)) for u in updates]
        self.assertLess(np.median(errors), 0.05)

    def test_settings_are_those_of_the_program(self):
        updates = self.feed(self.tracker(settings={"rate_hz": 100}), 10_000)
        self.assertAlmostEqual(len(updates), 59, delta=1)
        with self.assertRaisesRegex(ValueError, "rate_hz"):
            self.tracker(settings={"rate_hertz": 100})

    def test_what_is_wrong_is_a_value_error(self):
        with self.assertRaisesRegex(ValueError, "nowhere.ply"):
            self.tracker(map="nowhere.ply")
        with self.assertRaisesRegex(ValueError, "rigid"):
            self.tracker(T_map_body=2 * np.eye(4))
        tracker = self.tracker()
        with self.assertRaisesRegex(ValueError, "equally long"):
            tracker.add_events([1, 2], [3], [4], [1])
        with self.assertRaisesRegex(ValueError, "outside"):
            tracker.add_events([1], [1000], [4], [1])
        with self.assertRaisesRegex(ValueError, "back in time"):
            tracker.add_events([5, 4], [1, 1], [4, 4], [1, 1])
        with self.assertRaisesRegex(ValueError, "n, 6"):
            tracker.add_imu([1], [[1, 2, 3]])
        with self.assertRaisesRegex(ValueError, "not finite"):
            tracker.add_imu([1], [[1, 2, 3, 4, 5, np.nan]])

    def test_the_example_runs(self):
        out = self.folder / "out.tum"
        done = subprocess.run([sys.executable, SOURCE / "python/example.py", self.folder, self.folder / "contours.ply", out],
                              env={"PYTHONPATH": str(MODULE)}, capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertGreater(len(np.loadtxt(out)), 100)


if __name__ == "__main__":
    unittest.main()
