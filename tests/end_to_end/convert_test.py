#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""What evpose convert writes is what it read, but for what was asked to change. convert_test.py EVPOSE"""
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest

try:
    import h5py
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)

import layouts
from recording import FOCAL, HEIGHT, WIDTH, Recording

EVPOSE = None


def columns(path):
    """t x y p of an events.h5."""
    with h5py.File(path) as file:
        return np.stack([file[f"events/{name}"][:].astype(np.int64) for name in "txyp"], axis=1)


class ConvertTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.shared = pathlib.Path(scratch.name)
        cls.recording = Recording()
        cls.folder = cls.recording.write(cls.shared / "recording")
        cls.events = cls.folder / "events.h5"
        cls.known = np.stack([cls.recording.t, cls.recording.x, cls.recording.y, cls.recording.p], axis=1)

    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.addCleanup(self.scratch.cleanup)
        self.root = pathlib.Path(self.scratch.name)

    def run_convert(self, *words):
        return subprocess.run([EVPOSE, "convert", *map(str, words)], capture_output=True, text=True, timeout=60,
                              stdin=subprocess.DEVNULL)

    def convert(self, *words):
        result = self.run_convert(*words)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(result.stderr, "")
        return result.stdout

    def refused(self, says, *words):
        before = {path: path.read_bytes() for path in self.root.rglob("*") if path.is_file()}
        result = self.run_convert(*words)
        self.assertEqual(result.returncode, 2, result.stdout)
        self.assertRegex(result.stderr, r"^evpose: .+: .+; .+\n$")
        self.assertRegex(result.stderr, says)
        after = {path: path.read_bytes() for path in self.root.rglob("*") if path.is_file()}
        self.assertEqual(before, after)

    def changed(self, *options):
        self.convert(self.events, self.root / "out.h5", *options)
        return columns(self.root / "out.h5")

    def test_events_through_every_format_and_back(self):
        for name in ("a.h5", "a.raw", "a.txt", "a.csv", "a.bag", "a.mcap"):
            with self.subTest(name=name):
                self.convert(self.events, self.root / name)
                self.convert(self.root / name, self.root / "back.h5", "--size", f"{WIDTH},{HEIGHT}")
                np.testing.assert_array_equal(columns(self.root / "back.h5"), self.known)

    def test_crops_of_time(self):
        first = self.known[0, 0]
        rows = self.changed("--start", "0.1", "--end", "0.3")
        inside = (self.known[:, 0] >= first + 100_000) & (self.known[:, 0] < first + 300_000)
        np.testing.assert_array_equal(rows, self.known[inside])
        np.testing.assert_array_equal(self.changed("--start", "0.1", "--duration", "0.2"), rows)

    def test_region_and_polarity(self):
        t, x, y, p = self.known.T
        inside = (x >= 20) & (x < 100) & (y >= 10) & (y < 60)
        np.testing.assert_array_equal(self.changed("--region", "20,10,100,60"), self.known[inside])
        np.testing.assert_array_equal(self.changed("--polarity", "on"), self.known[p == 1])
        np.testing.assert_array_equal(self.changed("--polarity", "off"), self.known[p == 0])

    def test_offset(self):
        rows = self.changed("--offset", "2.5", "--start", "0.2")
        expected = self.known[self.known[:, 0] >= self.known[0, 0] + 200_000] + [2_500_000, 0, 0, 0]
        np.testing.assert_array_equal(rows, expected)

    def test_undistortion_by_the_formula(self):
        k1, k2 = -0.2, 0.05
        calibration = self.root / "c.yaml"
        calibration.write_text(self.recording.calibration.replace("distortion_coeffs: []", f"distortion_coeffs: [{k1}, {k2}, 0, 0]")
                               .replace("distortion_model: none", "distortion_model: radtan"))
        rows = self.changed("--undistort", "--calibration", calibration)
        cx, cy = (WIDTH - 1) / 2, (HEIGHT - 1) / 2
        d = (self.known[:, 1:3] - [cx, cy]) / FOCAL
        m = d.copy()
        for _ in range(100):
            r2 = (m ** 2).sum(axis=1, keepdims=True)
            m = d / (1 + k1 * r2 + k2 * r2 ** 2)
        pixels = m * FOCAL + [cx, cy]
        # Half-way cases may fall to either side.
        sure = (np.abs(pixels - np.floor(pixels) - 0.5) > 1e-6).all(axis=1)
        self.assertTrue(sure.all())
        pixels = np.rint(pixels).astype(np.int64)
        inside = ((pixels >= 0) & (pixels < [WIDTH, HEIGHT])).all(axis=1)
        expected = self.known[inside].copy()
        expected[:, 1:3] = pixels[inside]
        np.testing.assert_array_equal(rows, expected)

    def test_a_recording_of_a_data_set(self):
        source = layouts.write_tum_vie(self.root / "mocap-desk", self.recording)
        self.convert(source, self.root / "own")
        np.testing.assert_array_equal(columns(self.root / "own/events.h5"), self.known)
        own = np.loadtxt(self.root / "own/imu.csv", delimiter=",", skiprows=1)
        np.testing.assert_array_equal(own[:, 0], self.recording.imu_t_ns)
        np.testing.assert_allclose(own[:, 1:], self.recording.imu, atol=1e-7)
        truth = np.loadtxt(self.root / "own/groundtruth.tum")
        expected = np.loadtxt(self.folder / "groundtruth.tum")
        np.testing.assert_allclose(truth, expected, atol=1e-8)
        self.assertTrue((self.root / "own/contours.ply").exists())
        result = subprocess.run([EVPOSE, "track", self.root / "own", "-o", self.root / "run"], capture_output=True, timeout=60)
        self.assertEqual(result.returncode, 0, result.stderr)

    def test_a_recording_through_bags_and_back(self):
        known = np.loadtxt(self.folder / "imu.csv", delimiter=",", skiprows=1)
        truth = np.loadtxt(self.folder / "groundtruth.tum")
        (self.root / "imu.yaml").write_text((self.folder / "imu.yaml").read_text())  # no bag holds it
        for name in ("all.bag", "all.mcap"):
            with self.subTest(name=name):
                said = self.convert(self.folder, self.root / name)
                self.assertIn(f"{len(known)} IMU samples, {len(truth)} poses", said)
                back = self.root / (name[4:] + "_back")
                self.convert(self.root / name, back, "--calibration", self.folder / "camchain-imucam.yaml")
                np.testing.assert_array_equal(columns(back / "events.h5"), self.known)
                np.testing.assert_allclose(np.loadtxt(back / "imu.csv", delimiter=",", skiprows=1), known, atol=1e-9)
                np.testing.assert_allclose(np.loadtxt(back / "groundtruth.tum"), truth, atol=1e-8)

    def test_trajectories(self):
        source = self.folder / "groundtruth.tum"
        rows = np.loadtxt(source)
        self.convert(source, self.root / "a.csv")
        self.convert(self.root / "a.csv", self.root / "b.tum")
        np.testing.assert_allclose(np.loadtxt(self.root / "b.tum"), rows, atol=1e-9)
        self.convert(source, self.root / "c.tum", "--start", "0.1", "--duration", "0.2", "--offset", "-1")
        cropped = rows[(rows[:, 0] > 0.0999) & (rows[:, 0] < 0.2999)]
        np.testing.assert_allclose(np.loadtxt(self.root / "c.tum")[:, 0], cropped[:, 0] - 1, atol=1e-9)

    def test_a_trajectory_of_the_camera_becomes_that_of_the_body(self):
        source = self.folder / "groundtruth.tum"
        rows = np.loadtxt(source)
        place = layouts.transform(layouts.rotation([1, -2, 3], 0.4), [0.05, 0.02, -0.03])  # T_imu_cam
        lines = []
        for row in rows:
            T = layouts.transform(np.eye(3), row[1:4]) @ place
            lines.append(" ".join(f"{v:.12f}" for v in (row[0], *T[:3, 3], *layouts.quaternion(T[:3, :3]))))
        (self.root / "camera.tum").write_text("\n".join(lines) + "\n")
        start = self.recording.calibration.index("  T_cam_imu")
        end = self.recording.calibration.index("  timeshift")
        matrix = layouts.matrix_text(np.linalg.inv(place))
        (self.root / "c.yaml").write_text(self.recording.calibration[:start] + f"  T_cam_imu: {matrix}\n" + self.recording.calibration[end:])
        self.convert(self.root / "camera.tum", self.root / "body.tum", "--pose-of", "camera", "--calibration", self.root / "c.yaml")
        body = np.loadtxt(self.root / "body.tum")
        np.testing.assert_allclose(body[:, :4], rows[:, :4], atol=1e-8)
        np.testing.assert_allclose(np.abs(body[:, 7]), 1, atol=1e-9)

    def test_calibrations_become_kalibrs(self):
        source = layouts.write_tum_vie(self.root / "mocap-desk", self.recording)
        said = self.convert(source / "camera-calibrationA.json", self.root / "k.yaml")
        self.assertIn("cam0", said)
        self.assertIn("T_cam_imu", (self.root / "k.yaml").read_text())

    def test_refusals(self):
        copy = self.root / "copy.h5"
        copy.write_bytes(self.events.read_bytes())
        self.refused("is the input itself", copy, copy)
        (self.root / "link.h5").symlink_to(copy)
        self.refused("is the input itself", copy, self.root / "link.h5")
        self.refused("copy.abc|format", copy, self.root / "copy.abc")
        self.refused("no such", self.root / "absent.h5", self.root / "b.h5")
        self.refused("--region", copy, self.root / "b.h5", "--region", "50,10,20,60")
        self.refused("no events are left", copy, self.root / "b.h5", "--start", "100")
        self.refused("no calibration", copy, self.root / "b.h5", "--undistort")
        self.refused("exists already", copy, self.root)
        self.refused("no such|cannot", copy, self.root / "absent/b.h5")
        (self.root / "words.txt").write_text("nothing\n")
        self.refused("nothing that evpose reads", self.root / "words.txt", self.root / "b.h5")

    def test_an_interrupt_leaves_no_half_file(self):
        random = np.random.default_rng(1)
        count = 6_000_000
        with h5py.File(self.root / "long.h5", "w") as file:
            file.attrs["width"], file.attrs["height"] = np.uint32(640), np.uint32(480)
            file["events/t"] = np.arange(count)
            for name, top in (("x", 640), ("y", 480), ("p", 2)):
                file[f"events/{name}"] = random.integers(0, top, count, dtype="u2")
        before = set(self.root.iterdir())
        process = subprocess.Popen([EVPOSE, "convert", self.root / "long.h5", self.root / "out.txt"],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        deadline = time.monotonic() + 30
        while set(self.root.iterdir()) == before and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=30)
        self.assertEqual(process.returncode, 130)
        self.assertEqual(set(self.root.iterdir()), before)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    EVPOSE = sys.argv.pop(1)
    unittest.main()
