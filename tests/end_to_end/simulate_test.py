#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The simulator as a user meets it: simulate_test.py EVPOSE"""
import pathlib
import subprocess
import sys
import tempfile
import unittest

EVPOSE = sys.argv.pop(1)
SCENE = """
free_space: {low: [-1, -1, 0.5], high: [1, 1, 2]}
materials:
  - {name: bricks, pattern: bricks, size_m: [1, 1], texel_m: 0.01}
  - {name: wood, pattern: planks, size_m: [1, 1], texel_m: 0.01}
lights:
  - {name: lamp, kind: lamp, at: [0, 0, 2.7], candela: 900}
  - {name: all around, kind: ambient, lux: 120}
objects:
  - {name: floor, quad: {corner: [-3, -3, 0], u: [6, 0, 0], v: [0, 6, 0]}, material: wood}
  - {name: ahead, quad: {corner: [3, -3, 0], u: [0, 0, 3], v: [0, 6, 0]}, material: bricks}
  - {name: left, quad: {corner: [-3, 3, 0], u: [6, 0, 0], v: [0, 0, 3]}, material: bricks}
  - {name: right, quad: {corner: [-3, -3, 0], u: [0, 0, 3], v: [6, 0, 0]}, material: bricks}
  - {name: crate, at: [1.8, 0.3, 0], yaw_deg: 20, box: {size: [0.6, 0.8, 1.1]}, material: wood}
"""
SCENARIO = """
duration_s: 0.05
scene_file: scene.yaml
camera: {size: custom, width: 96, height: 72, focal_px: 60}
trajectory: {kind: square_spiral, centre_x_m: 0, centre_y_m: 0, centre_z_m: 1.2, size_forward_m: 1, size_left_m: 1, size_up_m: 0.4}
"""


class Simulate(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.place = pathlib.Path(self.folder.name)
        (self.place / "scene.yaml").write_text(SCENE)
        (self.place / "scenario.yaml").write_text(SCENARIO)

    def run_evpose(self, *arguments):
        return subprocess.run([EVPOSE, *map(str, arguments)], capture_output=True, text=True, timeout=120)

    def simulate(self, *settings):
        sets = [word for setting in settings for word in ("--set", setting)]
        return self.run_evpose("simulate", self.place / "scenario.yaml", "-o", self.place / "recording", *sets)

    def refused(self, wanted, *settings):
        done = self.simulate(*settings)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
        self.assertIn(wanted, done.stderr)
        self.assertFalse((self.place / "recording").exists())
        self.assertEqual([p for p in self.place.iterdir() if ".part-" in p.name], [])

    def test_a_recording_is_complete_and_can_be_tracked(self):
        done = self.simulate("truth.events=true", "lidar.on=true", "lidar.flight.duration_s=0.3",
                             "lidar.flight.centre_x_m=0", "lidar.flight.centre_y_m=0", "lidar.flight.centre_z_m=1.2",
                             "lidar.flight.size_forward_m=1", "lidar.flight.size_left_m=1")
        self.assertEqual(done.returncode, 0, done.stderr)
        made = {p.name for p in (self.place / "recording").iterdir()}
        self.assertLessEqual({"events.h5", "imu.csv", "groundtruth.tum", "groundtruth_camera.tum", "imu.yaml",
                              "camchain-imucam.yaml", "contours.ply", "mesh.ply", "scenario.yaml",
                              "events_truth.h5", "map_raw.ply"}, made)
        done = self.run_evpose("track", self.place / "recording", "-o", self.place / "run", "--occluders",
                               self.place / "recording/mesh.ply")
        self.assertIn(done.returncode, (0, 1), done.stderr)
        self.assertIn("tracking in", done.stdout)

    def test_a_recording_makes_itself_again_from_its_own_scenario(self):
        self.assertEqual(self.simulate().returncode, 0)
        # The scene's file is named in the copy as it was found.
        again = self.run_evpose("simulate", self.place / "recording/scenario.yaml", "-o", self.place / "again",
                                "--set", f"scene_file={self.place / 'scene.yaml'}")
        self.assertEqual(again.returncode, 0, again.stderr)
        for name in ("events.h5", "imu.csv", "groundtruth.tum", "contours.ply"):
            self.assertEqual((self.place / "recording" / name).read_bytes(), (self.place / "again" / name).read_bytes())

    def test_bad_scenarios_are_refused_in_one_line(self):
        self.refused("inside of something", "trajectory.centre_x_m=2", "trajectory.centre_y_m=0.3",
                     "trajectory.centre_z_m=0.6", "trajectory.size_forward_m=0.1", "trajectory.size_left_m=0.1",
                     "trajectory.size_up_m=0.1")
        self.refused("events.threshold_on", "events.threshold_on=-0.2")
        self.refused("px/s", "integrator.max_flow_px_s=2")
        self.refused("events.preset", "events.preset=dvs128")
        self.refused("handed_over.preset", "handed_over.preset=perfect")
        self.refused("lidar.moved_furniture", "lidar.on=true", "lidar.moved_furniture=3")
        self.refused("events.treshold_on", "events.treshold_on=0.2")
        self.refused("do not fit", "frames.rate_hz=30", "frames.exposure_ms=50")

    def test_a_scene_without_light_is_refused(self):
        (self.place / "scene.yaml").write_text(SCENE.replace("900", "0").replace("120", "0"))
        self.refused("contrast")

    def test_no_such_scenario(self):
        done = self.run_evpose("simulate", "moon_landing", "-o", self.place / "recording")
        self.assertEqual(done.returncode, 2)
        self.assertIn("moon_landing: no such scenario", done.stderr)
        self.assertIn("scenarios", done.stderr)

    def test_nothing_else_is_replaced(self):
        (self.place / "recording").mkdir()
        (self.place / "recording/letter.txt").write_text("dear")
        done = self.simulate()
        self.assertEqual(done.returncode, 2)
        self.assertIn("is there already", done.stderr)
        self.assertEqual((self.place / "recording/letter.txt").read_text(), "dear")


if __name__ == "__main__":
    unittest.main()
