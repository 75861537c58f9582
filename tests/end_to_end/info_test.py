#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""What evpose info tells is what was put in, and what is wrong is named. info_test.py EVPOSE SOURCE"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

try:
    import h5py
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)

from recording import HEIGHT, WIDTH, Recording

EVPOSE = SHARED = None


def run(*words):
    return subprocess.run([EVPOSE, *map(str, words)], capture_output=True, text=True, timeout=120,
                          stdin=subprocess.DEVNULL)


def info(path):
    result = run("info", path, "--json")
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


def findings(told):
    return "\n".join(f"{finding['where']}: {finding['what']}; {finding['fix']}" for finding in told["findings"])


def write_events(path, t, x, y, p):
    with h5py.File(path, "w") as file:
        for name, values, kind in (("t", t, "i8"), ("x", x, "u2"), ("y", y, "u2"), ("p", p, "u1")):
            file[f"events/{name}"] = np.asarray(values).astype(kind)
        file.attrs["width"], file.attrs["height"] = np.uint32(64), np.uint32(48)


class InfoTest(unittest.TestCase):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.addCleanup(self.scratch.cleanup)
        self.root = pathlib.Path(self.scratch.name)

    def test_a_healthy_recording(self):
        recording = Recording()
        folder = recording.write(self.root / "recording")
        told = info(folder)
        self.assertTrue(told["recording"]["ready"])
        events = told["events"]
        self.assertEqual(events["count"], len(recording.t))
        self.assertEqual(events["on"], int(recording.p.sum()))
        self.assertEqual(events["resolution"], [WIDTH, HEIGHT])
        self.assertEqual((events["first_ns"], events["last_ns"]), (1000 * recording.t[0], 1000 * recording.t[-1]))
        self.assertAlmostEqual(sum(events["rate_over_time_ev_s"]) * events["rate_over_time_step_s"], len(recording.t),
                               delta=1e-6 * len(recording.t))
        self.assertAlmostEqual(told["imu"]["rate_hz"], 500, places=6)
        self.assertEqual(told["imu"]["count"], len(recording.imu_t_ns))
        self.assertEqual(told["ground truth"]["count"], len(recording.groundtruth_t_s))
        self.assertIn("looks forward, upright", told["camera cam0"]["placement"])
        text = run("info", folder).stdout
        self.assertIn("▁", text + "▁")
        self.assertIn("looks forward", text)

    def test_a_map(self):
        folder = Recording().write(self.root / "recording")
        told = info(folder / "contours.ply")
        self.assertEqual(told["map"]["points"], len(Recording().contours))
        by_map = run("map", "info", folder / "contours.ply").stdout
        self.assertIn(str(told["map"]["points"]), by_map)

    def test_a_trajectory(self):
        path = self.root / "a.tum"
        path.write_text("".join(f"{i / 10:.1f} {i / 20} 0 0 0 0 0 1\n" for i in range(21)))
        told = info(path)["trajectory"]
        self.assertEqual(told["count"], 21)
        self.assertAlmostEqual(told["length_m"], 1)
        self.assertAlmostEqual(told["mean_speed_m_s"], 0.5)
        self.assertAlmostEqual(told["duration_s"], 2)

    def test_a_calibration_says_where_the_camera_sits(self):
        path = self.root / "c.yaml"
        # 12 mm ahead, 3 mm left, 40 mm above, turned 33 deg down.
        c, s = np.cos(np.radians(33)), np.sin(np.radians(33))
        T = np.eye(4)
        T[:3, :3] = [[0, -s, c], [-1, 0, 0], [0, -c, -s]]
        T[:3, 3] = [0.012, 0.003, 0.04]
        rows = "\n".join("  - [" + ", ".join(map(repr, map(float, row))) + "]" for row in np.linalg.inv(T))
        path.write_text("cam0:\n  camera_model: pinhole\n  distortion_model: none\n  distortion_coeffs: []\n"
                        f"  intrinsics: [100, 100, 50, 40]\n  resolution: [101, 81]\n  T_cam_imu:\n{rows}\n")
        self.assertIn("12 mm ahead, 3 mm left, 40 mm above; looks forward, 33 deg down", run("info", path).stdout)

    def test_what_is_wrong_with_events_is_found(self):
        random = np.random.default_rng(3)
        t = np.sort(random.integers(0, 2_000_000, 40_000))
        t[t > 1_000_000] += 300_000
        x, y, p = random.integers(0, 64, 40_000), random.integers(0, 48, 40_000), np.ones(40_000)
        x[::20], y[::20] = 17, 23
        write_events(self.root / "e.h5", t, x, y, p)
        told = info(self.root / "e.h5")
        for words in ("100.0 % of the events are on", "no events for up to 300", "1 hot pixels make 5"):
            self.assertIn(words, findings(told))
        self.assertEqual([(h["x"], h["y"]) for h in told["events"]["hot_pixels"]], [(17, 23)])

    def test_events_that_go_back_are_told_up_to_there(self):
        t = np.arange(400_000) * 10
        t[390_000] = 5
        write_events(self.root / "e.h5", t, t % 64, t % 48, t // 10 % 2)
        told = info(self.root / "e.h5")
        self.assertGreater(told["events"]["count"], 0)
        self.assertIn("event 390000", findings(told))
        self.assertIn("sort the events by time", findings(told))
        t[3] = 5
        write_events(self.root / "e.h5", t, t % 64, t % 48, t // 10 % 2)
        result = run("info", self.root / "e.h5")
        self.assertEqual(result.returncode, 2)
        self.assertIn("event 3 ", result.stderr)

    def test_what_is_wrong_with_an_imu_is_found(self):
        t = np.arange(0, 4000) * 5_000_000
        rows = np.hstack([np.zeros((4000, 3)), np.tile([0, 0, 1.0], (4000, 1))])
        keep = np.r_[0:1000, 1100:4000]
        (self.root / "imu.csv").write_text("#timestamp_ns,wx,wy,wz,ax,ay,az\n" + "".join(
            f"{t[i]}," + ",".join(map(str, rows[i])) + "\n" for i in keep))
        told = findings(info(self.root / "imu.csv"))
        self.assertIn("1 gaps of more than 2.5 intervals, the longest 505.0 ms at 4.995 s", told)
        self.assertRegex(told, "imu.accel_unit: g|accel_unit")

    def test_streams_that_do_not_overlap(self):
        recording = Recording()
        recording.imu_t_ns = recording.imu_t_ns + 5_000_000_000
        told = info(recording.write(self.root / "recording"))
        self.assertFalse(told["recording"]["ready"])
        self.assertIn("do not overlap", findings(told))

    def test_missing_parts_are_named_with_their_places(self):
        folder = Recording().write(self.root / "recording")
        (folder / "events.h5").unlink()
        (folder / "camchain-imucam.yaml").unlink()
        told = info(folder)
        self.assertFalse(told["recording"]["ready"])
        self.assertIn("events.h5: no such file", findings(told))
        self.assertIn("camchain-imucam.yaml: no such file", findings(told))

    def test_nothing_known(self):
        (self.root / "a.bin").write_bytes(bytes(range(256)) * 8)
        (self.root / "empty").write_bytes(b"")
        (self.root / "words.txt").write_text("nothing of interest\n" * 3)
        (self.root / "a.yaml").write_text("a: 1\n")
        for name in ("a.bin", "empty", "words.txt", "a.yaml", "absent", "absent.h5"):
            with self.subTest(name=name):
                result = run("info", self.root / name)
                self.assertEqual(result.returncode, 2, result.stdout)
                self.assertRegex(result.stderr, r"^evpose: .+: .+; .+\n$")

    # Real files, whose READMEs state what must come out.

    def shared(self, path):
        if not (SHARED / path).exists():
            self.skipTest(f"no {SHARED / path}")
        return SHARED / path

    def test_hexacopter_chunk(self):
        folder = self.shared("data/real/mvsec_indoor_flying1_chunk")
        told = info(folder)
        events = told["events"]
        self.assertEqual(events["count"], 37187)
        self.assertEqual((events["first_ns"], events["last_ns"]), (24_000_000_000, 24_224_350_000))
        self.assertAlmostEqual(events["on_percent"], 68, delta=0.5)
        self.assertLessEqual(events["largest_pixel"][0], 329)
        self.assertEqual(events["largest_pixel"][1], 259)
        self.assertEqual(told["camera cam0"]["resolution"], [346, 260])
        self.assertEqual(told["camera cam0"]["distortion_model"], "equidistant")
        self.assertNotIn("imu", told, "there is none in this chunk")
        truth = info(folder / "groundtruth.txt")["trajectory"]
        self.assertEqual(truth["count"], 105)
        self.assertAlmostEqual(truth["rate_hz"], 85, delta=3)
        self.assertAlmostEqual(truth["longest_gap_s"], 0.030, delta=0.001)

    def test_drone_imus(self):
        euroc = info(self.shared("data/real/drone_imu_mocap/euroc_v1_02_medium/imu.csv"))["imu"]
        self.assertAlmostEqual(euroc["rate_hz"], 200, delta=0.5)
        self.assertAlmostEqual(euroc["duration_s"], 60, delta=0.1)
        self.assertAlmostEqual(euroc["rest_accel_m_s2"], 9.800, delta=0.01)
        for value, known in zip(euroc["gyro_bias_rad_s"], (-0.0021, 0.0204, 0.0761)):
            self.assertAlmostEqual(value, known, delta=0.002)
        for name in ("a", "b"):
            flight = info(self.shared(f"data/real/drone_imu_mocap/blackbird_clover_5mps_{name}/imu.csv"))["imu"]
            self.assertAlmostEqual(flight["rate_hz"], 100, delta=0.1)
            self.assertAlmostEqual(flight["duration_s"], 30, delta=0.05)
            self.assertEqual(flight["at_rest_s"], 0, "never at rest")
            self.assertEqual(flight["up"], "-z", "the IMU's z points down")
        for name, count, speed in (("euroc_v1_02_medium", None, 2.0), ("blackbird_clover_5mps_a", 3000, 5.0),
                                   ("blackbird_clover_5mps_b", 3000, 5.0)):
            told = info(self.shared(f"data/real/drone_imu_mocap/{name}"))
            self.assertAlmostEqual(told["ground truth"]["largest_speed_m_s"], speed, delta=0.3, msg=name)
            if count:
                self.assertEqual(told["ground truth"]["count"], count)
                self.assertAlmostEqual(told["ground truth"]["rate_hz"], 100, delta=0.1)

    def test_calibrations(self):
        for path in sorted(self.shared("data/real/formats/calibrations").glob("*.[yj]*")):
            if path.name == "known_values.json":
                continue
            with self.subTest(path=path.name):
                self.assertTrue(info(path)["calibration"]["kind"])


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    SOURCE = pathlib.Path(sys.argv.pop())
    EVPOSE = sys.argv.pop()
    SHARED = pathlib.Path(os.environ.get("EVPOSE_SHARED", SOURCE / "../shared"))
    unittest.main()
