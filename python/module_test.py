#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The Python module: module_test.py FOLDER_OF_MODULE SOURCE"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

import numpy as np

MODULE, SOURCE = pathlib.Path(sys.argv.pop(1)), pathlib.Path(sys.argv.pop(1))
sys.path[:0] = [str(MODULE), str(SOURCE / "tests/end_to_end")]
import evpose  # noqa: E402
from recording import CALIBRATION, Recording, position  # noqa: E402


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

    def test_frames_alone_move_the_pose(self):
        """Fields of grey between the wall's contours, where the tracker believes to be 1 cm beside the truth."""
        r, start = self.recording, np.eye(4)
        start[:3, 3] = position(0) + [0, 0.01, 0]
        errors = {}
        for use in ("alone", "off"):
            tracker = self.tracker(T_map_body=start, settings={"frames.use": use, "fusion.start_position_sigma_m": 0.01,
                                                               "fusion.calibration.on": False})
            updates, sent = [], 0
            for t in range(0, 550_000_000, 33_000_000):
                updates += tracker.add_frame(t, r.picture(position(t * 1e-9)), 1_000_000)
                samples = (r.imu_t_ns >= sent) & (r.imu_t_ns < t + 40_000_000)
                updates += tracker.add_imu(r.imu_t_ns[samples], r.imu[samples])
                updates += tracker.events_complete_until(t + 30_000_000)
                sent = t + 40_000_000
            errors[use] = [abs(u.position[1] - position(u.t_ns * 1e-9)[1]) for u in updates]
            self.assertGreater(len(updates), 100)
        self.assertLess(errors["alone"][-1], 0.003)
        self.assertGreater(errors["off"][-1], 0.006)

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
        grey = np.zeros((120, 160), np.uint8)
        with self.assertRaisesRegex(ValueError, r"shape \(120, 160\)"):
            tracker.add_frame(1, grey.T)
        with self.assertRaisesRegex(ValueError, "exposure"):
            tracker.add_frame(1, grey, -1)
        tracker.add_frame(1, grey)
        with self.assertRaisesRegex(ValueError, "does not go on"):
            tracker.add_frame(1, grey)

    def test_recordings_are_arrays(self):
        r, read = self.recording, evpose.Recording(self.folder)
        t, x, y, p = read.events()
        for ours, theirs in ((t, r.t), (x, r.x), (y, r.y), (p, r.p)):
            np.testing.assert_array_equal(ours, theirs)
        self.assertEqual((t.dtype, x.dtype, p.dtype), (np.int64, np.uint16, np.uint8))
        part = read.events(start_s=0.1, duration_s=0.05)[0]
        inside = t[(t * 1000 >= read.first_ns + 100_000_000) & (t * 1000 < read.first_ns + 150_000_000)]
        np.testing.assert_array_equal(part, inside)
        self.assertGreater(len(part), 0)
        imu_t, imu = read.imu()
        np.testing.assert_array_equal(imu_t, r.imu_t_ns)
        np.testing.assert_allclose(imu, r.imu, atol=1e-7)
        truth_t, truth = read.groundtruth()
        np.testing.assert_allclose(truth[:, :3, 3], position(truth_t * 1e-9), atol=1e-8)
        self.assertEqual((read.width, read.height, read.has_imu), (160, 120, True))
        self.assertEqual(read.T_cam_body.shape, (4, 4))
        self.assertTrue(read.map.endswith("contours.ply"))
        with self.assertRaisesRegex(ValueError, "nowhere"):
            evpose.Recording("nowhere")

    def test_maps_are_arrays(self):
        read = evpose.Map(self.folder / "contours.ply")
        n = len(read.points)
        self.assertGreater(n, 0.9 * len(self.recording.contours))
        self.assertEqual((read.tangents.shape, read.sigma.shape, len(read.kind)), ((n, 3), (n,), n))
        np.testing.assert_allclose(np.linalg.norm(read.tangents, axis=1), 1, atol=1e-5)
        np.testing.assert_allclose(read.points[:, 0], 3, atol=1e-6)  # the wall
        self.assertEqual(read.occluders.shape, (0, 3, 3))

    def test_maps_are_built_from_clouds(self):
        random, n = np.random.default_rng(2), 12_000
        a, b = random.uniform(0, 2, (2, n))
        faces = [np.stack([a, b, 0 * a], 1), np.stack([a, 0 * a, b], 1), np.stack([0 * a, a, b], 1)]
        cloud = np.vstack(faces) + random.normal(0, 1e-3, (3 * n, 3))
        header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(cloud)}\n"
        header += "".join(f"property float {name}\n" for name in "xyz") + "end_header\n"
        (self.folder / "cloud.ply").write_bytes(header.encode() + cloud.astype("<f4").tobytes())
        built = evpose.build_map(self.folder / "cloud.ply", self.folder / "built.h5", {"point_spacing": 0.05})
        creases = built.points[np.array(built.kind) == "crease"]
        self.assertGreater(len(creases), 60)
        self.assertLess(np.median(np.sort(np.abs(creases), axis=1)[:, 1]), 0.005)  # on the axes: two numbers are 0
        again = evpose.Map(self.folder / "built.h5")
        np.testing.assert_allclose(again.points, built.points)
        with self.assertRaisesRegex(ValueError, "settings"):
            evpose.build_map(self.folder / "cloud.ply", self.folder / "built.h5", {"no_such_key": 1})

    def test_runs_are_arrays(self):
        run = evpose.track(self.folder, self.folder / "run", settings={"rate_hz": 100})
        n = len(run.t_ns)
        self.assertAlmostEqual(n, 59, delta=2)
        self.assertEqual((run.T_map_body.shape, run.covariance.shape, len(run.health)), ((n, 4, 4), (n, 6, 6), n))
        errors = np.linalg.norm(run.T_map_body[:, :3, 3] - position(run.t_ns * 1e-9), axis=1)
        self.assertLess(np.median(errors[run.valid]), 0.05)
        table = run.table()
        np.testing.assert_allclose(table["x_m"], run.T_map_body[:, 0, 3])
        self.assertEqual(len(run.table("latency.csv")["t_s"]), n)
        self.assertEqual(run.summary["updates"], n)
        again = evpose.Run(run.folder)
        np.testing.assert_array_equal(again.T_map_body, run.T_map_body)
        with self.assertRaisesRegex(ValueError, "--force|replace"):
            evpose.track(self.folder, self.folder / "run")
        with self.assertRaisesRegex(ValueError, "no run folder"):
            evpose.Run("nowhere")

    def test_a_rough_pose_is_confirmed_by_the_events(self):
        words = "0,0.01,1.01,0,0,0,1@0"
        found = evpose.relocalise(self.folder, words, (0.02, 1))
        self.assertEqual(found.health, "tracking")
        self.assertLess(found.t_ns, 500_000_000)
        self.assertLess(np.linalg.norm(found.position - position(found.t_ns * 1e-9)), 0.02)
        self.assertEqual(found.covariance.shape, (6, 6))
        early = evpose.relocalise(self.folder, words, (0.02, 1), within_s=0.01)
        self.assertNotEqual(early.health, "tracking", "so soon the events have confirmed nothing")
        self.assertLess(early.t_ns, found.t_ns)
        for wrong, says in ((("1,2,3", (0.1, 1)), "start pose"), ((words, (0.1, 1), "nowhere.h5"), "nowhere")):
            with self.assertRaisesRegex(ValueError, says):
                evpose.relocalise(self.folder, *wrong)

    def test_smoothing_is_not_worse_than_tracking(self):
        errors = {}
        for name in ("track", "smooth"):
            run = getattr(evpose, name)(self.folder, self.folder / f"run_{name}", settings={"rate_hz": 100})
            off = np.linalg.norm(run.T_map_body[:, :3, 3] - position(run.t_ns * 1e-9), axis=1)
            errors[name] = np.mean(off[run.valid])
        self.assertLess(errors["smooth"], errors["track"] + 1e-4)

    def test_a_camera_is_calibrated(self):
        file = self.folder / "found.yaml"
        given = re.sub(r"intrinsics: \[([0-9.]+)", lambda m: f"intrinsics: [{1.002 * float(m[1]):.3f}", CALIBRATION)
        (self.folder / "start.yaml").write_text(given)
        found = evpose.calibrate([self.folder], file, calibration=self.folder / "start.yaml")
        numbers = {n.name: n for n in found.numbers}
        self.assertEqual(found.correlation.shape, (len(numbers), len(numbers)))
        self.assertLess(numbers["fx"].sigma, numbers["fx"].given_sigma)
        self.assertIn("time", " ".join(found.notes), "so short a slide does not tell it")
        self.assertIn("calibration_correlation", file.read_text())
        self.assertGreater(pathlib.Path(found.report).stat().st_size, 5000)
        with self.assertRaisesRegex(ValueError, "exists"):
            evpose.calibrate([self.folder], file)

    def test_the_notebook_runs(self):
        try:
            import matplotlib  # noqa: F401
        except ImportError:
            if os.environ.get("CI") == "true":
                raise
            self.skipTest("matplotlib is missing: scripts/packages.sh test")
        out = self.folder / "notebook"
        done = subprocess.run([sys.executable, SOURCE / "examples/notebook.py"], capture_output=True, text=True,
                              env={"PYTHONPATH": str(MODULE), "MPLBACKEND": "Agg", "HOME": str(self.folder),
                                   "EVPOSE_RECORDING": str(self.folder), "EVPOSE_OUTPUT": str(out)}, timeout=100)
        self.assertEqual(done.returncode, 0, done.stderr)
        for words in ("events of 160x120 px", "tracking, 100 % of the updates", "smoothed: ", "the last is tracking"):
            self.assertIn(words, done.stdout)
        found = re.search(r"from 30 mm beside: tracking after \d+ ms, ([0-9.]+) mm off", done.stdout)
        self.assertIsNotNone(found, done.stdout)
        self.assertLess(float(found[1]), 10)
        for name in ("recording", "track", "biases"):
            self.assertGreater((out / f"{name}.png").stat().st_size, 5000)

    def test_the_example_runs(self):
        out = self.folder / "out.tum"
        done = subprocess.run([sys.executable, SOURCE / "python/example.py", self.folder, self.folder / "contours.ply", out],
                              env={"PYTHONPATH": str(MODULE)}, capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertGreater(len(np.loadtxt(out)), 100)


if __name__ == "__main__":
    unittest.main()
