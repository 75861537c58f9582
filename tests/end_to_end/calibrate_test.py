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

import april_grid
from recording import CALIBRATION, Recording

EVPOSE = None
SCENARIO = pathlib.Path(__file__).resolve().parents[2] / "scenarios/turning_2.yaml"
TINY = ["camera.size=custom", "camera.width=320", "camera.height=240", "camera.focal_px=190"]


def numbers(chain, key):
    """Of a list on one line of a camera chain."""
    return [float(word) for word in re.search(rf"^  {key}: \[(.*)\]$", chain, re.MULTILINE).group(1).split(",")]


def matrices(text, key):
    """All matrices of that key, row by row: the accelerometer's first."""
    rows = r"(?:  - \[.*\]\n){3}"
    return [[float(word) for word in re.findall(r"[-+.e\d]+", block.replace("  - ", ""))]
            for block in re.findall(rf"^  {key}:\n({rows})", text, re.MULTILINE)]


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

    def test_a_camera_that_is_far_off_is_found_and_every_command_reads_it(self):
        flight = self.root / "flight"
        made = self.evpose("simulate", SCENARIO, "-o", flight, "--duration", 1,
                           *(word for setting in TINY for word in ("--set", setting)))
        self.assertEqual(made.returncode, 0, made.stderr)
        truth = (flight / "camchain-imucam.yaml").read_text()
        fx, fy, cx, cy = numbers(truth, "intrinsics")
        start = re.sub(r"intrinsics: \[.*\]", f"intrinsics: [{1.03 * fx}, {1.03 * fy}, {cx + 5}, {cy - 5}]", truth)
        start = re.sub(r"distortion_coeffs: \[.*\]", "distortion_coeffs: [0, 0, 0, 0]", start)
        start = re.sub(r".*_sigma: .*\n", "", start)
        done = self.calibrate(flight, start, "--occluders", flight / "mesh.ply")
        self.assertEqual(done.returncode, 0, done.stderr)
        chain = (self.root / "found.yaml").read_text()
        for key in ("intrinsics", "distortion_coeffs"):
            sigmas = numbers(chain, key.replace("_coeffs", "") + "_sigma")
            for found, sigma, number in zip(numbers(chain, key), sigmas, numbers(truth, key)):
                self.assertLess(abs(found - number), 4 * sigma)
        self.assertLess(abs(numbers(chain, "intrinsics")[0] / fx - 1), 0.002)
        self.assertIn("calibration_correlation", chain)
        self.assertIn("<svg", (self.root / "found.html").read_text())
        self.assertEqual(self.evpose("info", self.root / "found.yaml").returncode, 0)
        self.judge_axes((self.root / "found-imu.yaml").read_text(), (flight / "imu_truth.yaml").read_text())
        tracked = self.evpose("track", flight, "--map", flight / "contours.ply", "--occluders", flight / "mesh.ply",
                              "--calibration", self.root / "found.yaml", "--imu-model", self.root / "found-imu.yaml", "-o",
                              self.root / "run")
        self.assertEqual(tracked.returncode, 0, tracked.stderr)
        surely_off = re.sub(r"intrinsics: \[.*\]", f"intrinsics: [{1.02 * fx}, {1.02 * fy}, {cx}, {cy}]\n"
                            f"  intrinsics_sigma: [{1e-3 * fx}, {1e-3 * fy}, 0.1, 0.1]", re.sub(r".*_sigma: .*\n", "", truth))
        refuted = self.calibrate(flight, surely_off, "--occluders", flight / "mesh.ply", "--force")
        self.assertIn("it was taken for a data sheet's", refuted.stdout, refuted.stderr)
        self.assertLess(abs(numbers((self.root / "found.yaml").read_text(), "intrinsics")[0] / fx - 1), 0.005)
        again = self.calibrate(flight, start)
        self.assertEqual(again.returncode, 2)
        self.assertIn("found.yaml: exists", again.stderr)
        known = self.evpose("calibrate", flight, "--map", flight / "contours.ply", "-o", self.root / "other.yaml")
        self.assertEqual(known.returncode, 2)
        self.assertIn("all of it is known", known.stderr)

    def judge_axes(self, found, truth):
        """Every element within four sigmas, and one of the gyroscope known better than before."""
        for numbers, sigmas, known in zip(*(matrices(*of) for of in ((found, "M"), (found, "M_sigma"), (truth, "M")))):
            for number, sigma, true in zip(numbers, sigmas, known):
                self.assertLess(abs(number - true), 4 * sigma)
        self.assertLess(min(matrices(found, "M_sigma")[1]), 4.9e-3)  # of 5e-3: a second tells little, but something

    def hand_held(self, *settings):
        """A recording before a board, without truth, and a start that is off; and the true chain."""
        folder, start = self.root / "hand_held", self.root / "start.yaml"
        made = self.evpose("simulate", SCENARIO.with_name("board.yaml"), "-o", folder, "--duration", 3,
                           *(word for setting in (*TINY, *settings) for word in ("--set", setting)))
        self.assertEqual(made.returncode, 0, made.stderr)
        truth = (folder / "camchain-imucam.yaml").read_text()
        for name in ("groundtruth.tum", "groundtruth_camera.tum", "contours.ply"):
            (folder / name).unlink()
        fx, fy, cx, cy = numbers(truth, "intrinsics")
        start.write_text(re.sub(r".*_sigma: .*\n", "", re.sub(
            r"distortion_coeffs: \[.*\]", "distortion_coeffs: [0, 0, 0, 0]", re.sub(
                r"intrinsics: \[.*\]", f"intrinsics: [{1.1 * fx}, {1.1 * fy}, {cx + 10}, {cy - 10}]", truth))))
        return folder, start, truth

    def found_before_board(self, folder, start, truth, focal, *board):
        """Within its sigmas, and the focal length within that share; the board's map."""
        path = self.root / "board.h5"
        self.assertEqual(self.evpose("map", "board", *board, "-o", path).returncode, 0)
        done = self.evpose("calibrate", folder, "--map", path, "--start", start, "-o", self.root / "found.yaml")
        if "was built without" in done.stderr:
            self.skipTest(done.stderr.strip())
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotIn("warning", done.stderr)
        chain = (self.root / "found.yaml").read_text()
        for key in ("intrinsics", "distortion_coeffs"):
            sigmas = numbers(chain, key.replace("_coeffs", "") + "_sigma")
            for found, sigma, number in zip(numbers(chain, key), sigmas, numbers(truth, key)):
                self.assertLess(abs(found - number), 4 * sigma)
        self.assertLess(abs(numbers(chain, "intrinsics")[0] / numbers(truth, "intrinsics")[0] - 1), focal)
        return path

    def test_a_grid_of_tags_needs_no_start_pose(self):
        folder, start, truth = self.hand_held(f"scene_file={april_grid.write_scene(self.root)}")
        self.found_before_board(folder, start, truth, 0.02, "--aprilgrid", f"{april_grid.COLUMNS}x{april_grid.ROWS}", "--tag",
                                april_grid.TAG_M)

    def test_a_printed_board_needs_no_start_pose(self):
        folder, start, truth = self.hand_held()
        board = self.found_before_board(folder, start, truth, 0.005, "--checkerboard", "9x7", "--square", 0.08)
        hall = self.root / "hall"
        self.assertEqual(self.evpose("simulate", SCENARIO, "-o", hall, "--duration", 0.5,
                                     *(word for setting in TINY for word in ("--set", setting))).returncode, 0)
        none = self.evpose("calibrate", hall, "--map", board, "--start", start, "-o", self.root / "none.yaml")
        self.assertEqual(none.returncode, 2)
        self.assertIn("the board is never seen", none.stderr)
        self.assertEqual(len(none.stderr.strip().splitlines()), 1, none.stderr)

    def test_what_a_short_slide_does_not_tell_is_said(self):
        done = self.calibrate(Recording().write(self.root / "recording"), CALIBRATION)
        self.assertIn(done.returncode, (0, 1), done.stderr)
        self.assertIn("the motion does not tell time", done.stdout)
        self.assertIn("the motion does not tell place", done.stdout)

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


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    EVPOSE = sys.argv.pop(1)
    unittest.main()
