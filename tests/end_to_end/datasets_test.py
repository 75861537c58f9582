#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Data sets as downloaded are tracked as our own recording of the same motion is. datasets_test.py EVPOSE"""
import json
import pathlib
import re
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

import layouts
from recording import Recording

EVPOSE = None


def run(*words):
    return subprocess.run([EVPOSE, *map(str, words)], capture_output=True, text=True, timeout=60,
                          stdin=subprocess.DEVNULL)


class DatasetsTest(unittest.TestCase):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.addCleanup(self.scratch.cleanup)
        self.root = pathlib.Path(self.scratch.name)
        self.recording = Recording()

    def tracked(self, recording, *more):
        """Rows of the trajectory of a run. Other formats do not state that the calibration is known."""
        output = self.root / f"run{len(list(self.root.iterdir()))}"
        result = run("track", recording, "-o", output, "--set", "fusion.calibration.on=false", *more)
        self.assertIn(result.returncode, (0, 1), result.stderr + result.stdout)  # 1: held loosely, without IMU
        return np.loadtxt(output / "trajectory.tum")

    def assert_same_run(self, rows, expected, epoch_s=0):
        self.assertEqual(rows.shape, expected.shape)
        self.assertLess(np.abs(rows[:, 0] - epoch_s - expected[:, 0]).max(), 1e-6)
        self.assertLess(np.abs(rows[:, 1:4] - expected[:, 1:4]).max(), 1e-5, "metres")
        self.assertLess(np.abs(rows[:, 4:] - expected[:, 4:]).max(), 1e-5)

    def info(self, path):
        result = run("info", path, "--json")
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads(result.stdout)

    def test_tum_vie(self):
        expected = self.tracked(self.recording.write(self.root / "own"))
        folder = layouts.write_tum_vie(self.root / "mocap-desk", self.recording)
        self.assert_same_run(self.tracked(folder), expected)
        told = self.info(folder)
        self.assertEqual(told["recording"]["layout"], "TUM-VIE sequence")
        self.assertTrue(told["recording"]["ready"])
        self.assertEqual(told["events"]["count"], len(self.recording.t))

    def test_tum_vie_names_what_is_missing_and_where_it_belongs(self):
        folder = layouts.write_tum_vie(self.root / "bike-easy", self.recording, "bike-easy", "A")
        told = self.info(folder)
        self.assertFalse(told["recording"]["ready"])
        lines = [finding["where"] for finding in told["findings"]]
        self.assertIn(str(folder / "camera-calibrationB.json"), lines)
        result = run("track", folder)
        self.assertEqual(result.returncode, 2)
        self.assertRegex(result.stderr, r"^evpose: .*camera-calibrationB\.json: no such file.*; download it")
        for name in ("imu_data.txt", "mocap_data.txt"):
            (folder / name).unlink()
        whats = " ".join(finding["fix"] for finding in self.info(folder)["findings"])
        self.assertIn("bike-easy-vi_gt_data.tar.gz", whats)

    def test_vector(self):
        expected = self.tracked(self.recording.write(self.root / "own"))
        folder = layouts.write_vector(self.root / "vector", self.recording)
        self.assert_same_run(self.tracked(folder), expected, epoch_s=1_640_000_000)
        self.assertEqual(self.info(folder)["recording"]["layout"], "VECtor sequence")
        # The other scale's calibration beside it changes nothing.
        shared = self.root / "vector/small_scale_calibration"
        for name in ("joint_camera_extrinsic_results.yaml", "camera_imu_extrinsic_results1.yaml"):
            mine = next(shared.glob(f"*{name}"))
            mine.rename(shared / f"small_scale_{name}")
            (shared / f"large_scale_{name}").write_text("nothing: of use\n")
        self.assert_same_run(self.tracked(folder), expected, epoch_s=1_640_000_000)

    def test_vector_without_calibration_says_where_to_get_it(self):
        folder = layouts.write_vector(self.root / "vector", self.recording)
        for file in (self.root / "vector/small_scale_calibration").iterdir():
            file.unlink()
        result = run("track", folder)
        self.assertEqual(result.returncode, 2)
        self.assertRegex(result.stderr, r"left_event_camera_intrinsic.*no such file.*; download the calibration")

    def test_dsec_without_imu(self):
        folder = self.root / "zurich"
        (folder / "events/left").mkdir(parents=True)
        layouts.write_events(folder / "events/left/events.h5", self.recording, t_offset=np.int64(0))
        camera = (f"{{camera_matrix: [{layouts.FOCAL}, {layouts.FOCAL}, {(layouts.WIDTH - 1) / 2}, "
                  f"{(layouts.HEIGHT - 1) / 2}], distortion_coeffs: [0, 0, 0, 0], distortion_model: radtan, "
                  f"camera_model: pinhole, camera_type: event, resolution: [{layouts.WIDTH}, {layouts.HEIGHT}]}}")
        (folder / "cam_to_cam.yaml").write_text(f"intrinsics:\n  cam0: {camera}\nextrinsics: {{}}\n")
        told = self.info(folder)
        self.assertEqual(told["recording"]["layout"], "DSEC sequence")
        self.assertTrue(told["recording"]["ready"], told["findings"])
        self.recording.write_contours(folder / "contours.ply")
        T = np.linalg.inv(layouts.T_CAM_IMU)
        p = T[:3, 3] + [0, 0, 1]
        start = ",".join(str(float(v)) for v in (*p, *layouts.quaternion(T[:3, :3])))
        rows = self.tracked(folder, "--init", start)
        self.assertGreater(len(rows), 100)

    def test_a_folder_whose_files_tell_by_themselves(self):
        """As people keep them: other names, another tool's calibration, stamps in seconds."""
        expected = self.tracked(self.recording.write(self.root / "own"))
        folder = self.root / "mine"
        folder.mkdir()
        layouts.write_events(folder / "flight.h5", self.recording)
        (folder / "my_imu.txt").write_text("# t gx gy gz ax ay az\n" + "\n".join(
            f"{t / 1e9:.9f} " + " ".join(f"{v:.7f}" for v in row)
            for t, row in zip(self.recording.imu_t_ns, self.recording.imu)) + "\n")
        (folder / "calib.yaml").write_text(self.recording.calibration)
        (folder / "imu.yaml").write_text(self.recording.imu_model)
        own = self.root / "own"
        (folder / "groundtruth.txt").write_text((own / "groundtruth.tum").read_text())
        self.recording.write_contours(folder / "contours.ply")
        self.assert_same_run(self.tracked(folder), expected)

    def test_a_bag_brings_its_ground_truth(self):
        own = self.recording.write(self.root / "own")
        expected = self.tracked(own)
        folder = self.root / "bagged"
        folder.mkdir()
        self.assertEqual(run("convert", own, folder / "flight.bag").returncode, 0)
        for name in ("camchain-imucam.yaml", "imu.yaml", "contours.ply"):
            (folder / name).write_bytes((own / name).read_bytes())
        for path in (folder, folder / "flight.bag"):
            self.assert_same_run(self.tracked(path), expected)
        self.assertEqual(self.info(folder)["recording"]["groundtruth"], str(folder / "flight.bag"))

    def published(self, *words, status=0):
        result = run("-q", "bench", "paper", *words, "--maps", self.root / "maps")
        self.assertEqual(result.returncode, status, result.stderr)
        return result

    def test_published_sequences_are_tracked_in_both_forms(self):
        vector = layouts.write_vector(self.root / "vector", self.recording)
        tum_vie = layouts.write_tum_vie(self.root / "tum/mocap-desk", self.recording)
        for folder in (vector, tum_vie):
            (folder / "contours.ply").rename(f"{folder}_contours.ply")
        said = self.published("--vector", self.root / "vector", "--tum-vie", self.root / "tum").stdout
        for layout, name in (("VECtor", "desk_normal1"), ("TUM-VIE", "mocap-desk")):
            part = said.split(f"### {layout} sequence")[1].split("###")[0]
            for form, most_mm in (("paper", 50), ("defaults", 10)):
                ate = re.search(rf"\| {name} \| {form} \| ([\d.]+) \|", part)
                self.assertTrue(ate, part)
                self.assertLess(float(ate[1]), most_mm)
                self.assertIn(f"| mean of 1 | {form} | {ate[1]} |", part)
        self.assertFalse((self.root / "maps").exists())

    def test_published_sequences_build_the_maps_of_their_clouds(self):
        folder = layouts.write_tum_vie(self.root / "tum/mocap-desk", self.recording)
        random = np.random.default_rng(1)
        walls = random.random((12000, 3)) * [3, 3, 2] - [0, 1.5, 0]  # two walls and a floor before the camera
        walls[:4000, 0], walls[4000:8000, 1], walls[8000:, 2] = 3, 1.5, 0
        with open(f"{folder}_cloud.ply", "wb") as file:
            file.write(f"ply\nformat binary_little_endian 1.0\nelement vertex {len(walls)}\nproperty float x\n"
                       "property float y\nproperty float z\nend_header\n".encode() + walls.astype("<f4").tobytes())
        said = self.published("--tum-vie", self.root / "tum").stdout
        self.assertRegex(said, r"\| mocap-desk \| paper \| [\d.]+ \|")
        built = [self.root / f"maps/mocap-desk_{form}.h5" for form in ("paper", "defaults")]
        stamps = [path.stat().st_mtime_ns for path in built]
        self.assertEqual(self.published("--tum-vie", self.root / "tum").stdout, said)
        self.assertEqual([path.stat().st_mtime_ns for path in built], stamps)

    def test_published_sequences_that_are_not_there_are_told_in_one_line(self):
        layouts.write_vector(self.root / "vector", self.recording)
        for words, says in ((("--vector", self.root / "nowhere"), "nowhere"),
                            (("--tum-vie", self.root / "vector"), "holds no TUM-VIE sequence")):
            told = self.published(*words, status=2)
            self.assertRegex(told.stderr, rf"^evpose: .*{says}.*\n$")
        for other in ((self.root / "vector",), ("--set", "rate_hz=100"), ("--variant", "paper"), ("--only", "a")):
            self.published("--vector", self.root / "vector", *other, status=2)
        told = self.published("--vector", self.root / "vector", status=2)
        self.assertRegex(told.stderr, r"^evpose: .*no map of it; put .*desk_normal1_contours\.ply or .*desk_normal1_cloud\.ply there\n$")
        self.assertIn("| desk_normal1 | paper | - | - | - |", told.stdout)

    def test_calibration_can_be_given(self):
        folder = self.recording.write(self.root / "own")
        expected = self.tracked(folder)
        (folder / "camchain-imucam.yaml").rename(self.root / "elsewhere.yaml")
        self.assert_same_run(self.tracked(folder, "--calibration", self.root / "elsewhere.yaml"), expected)
        self.assertEqual(run("track", folder).returncode, 2)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    EVPOSE = sys.argv.pop(1)
    unittest.main()
