#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Frames beside the events and without them; EuRoC's layout and a stand-in for ORB-SLAM3. frames_test.py EVPOSE SOURCES"""
import json
import os
import pathlib
import re
import shutil
import stat
import subprocess
import sys
import tempfile
import unittest

EVPOSE, SOURCES = None, None
HERE = pathlib.Path(__file__).resolve().parent
SECONDS = 0.6
SETTINGS = ("camera.size=custom", "camera.width=240", "camera.height=180", "camera.focal_px=150", "trajectory.speed_m_s=0.6",
            "trajectory.centre_x_m=0", "trajectory.centre_y_m=0", "trajectory.centre_z_m=1.4", "trajectory.size_forward_m=1",
            "trajectory.size_left_m=1", "trajectory.size_up_m=0.4", "frames.rate_hz=40", "frames.exposure_ms=3")
# Of ORB-SLAM3: the truth in another frame, as its own program names files and stamps.
STAND_IN = """#!{python}
import math, pathlib, sys
vocabulary, settings, sequence, times, name = sys.argv[1:]
assert pathlib.Path(vocabulary).exists()
assert pathlib.Path(settings).read_text().startswith("%YAML:1.0")
truth = [line.split(",") for line in (pathlib.Path(sequence) / "mav0/state_groundtruth_estimate0/data.csv").read_text().splitlines() if line[0] != "#"]
stamps = [int(line) for line in pathlib.Path(times).read_text().split()]
assert all((pathlib.Path(sequence) / "mav0/cam0/data" / (str(t) + ".png")).exists() for t in stamps)
assert (pathlib.Path(sequence) / "mav0/imu0/data.csv").exists()
c, s = math.cos(0.35), math.sin(0.35)  # half of a turn of 0.7 rad about z
with open("f_" + name + ".txt", "w") as out:
    for t in stamps:
        row = min(truth, key=lambda r: abs(int(r[0]) - t))
        x, y, z, w, i, j, k = (float(v) for v in row[1:])
        turned = (c * w - s * k, c * i - s * j, c * j + s * i, c * k + s * w)
        px, py = math.cos(0.7) * x - math.sin(0.7) * y + 5, math.sin(0.7) * x + math.cos(0.7) * y - 3
        print("%.6f %.9f %.9f %.9f %.9f %.9f %.9f %.9f" % (int(row[0]), px, py, z + 1, *turned[1:], turned[0]), file=out)
"""


class FramesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.scratch.name)
        cls.recording = cls.root / "recording"
        words = [w for s in SETTINGS for w in ("--set", s)]
        scenario = cls.root / "flight.yaml"
        scenario.write_text(f"name: flight\nduration_s: {SECONDS}\nscene_file: {HERE / 'hall.yaml'}\n")
        done = cls.evpose("simulate", scenario, "-o", cls.recording, *words)
        assert done.returncode == 0, done.stderr

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    @staticmethod
    def evpose(*words):
        return subprocess.run([str(w) for w in (EVPOSE, "-q", *words)], capture_output=True, text=True, timeout=200,
                              stdin=subprocess.DEVNULL)

    def track(self, recording, name, *settings):
        words = [w for s in ("fusion.calibration.on=false", *settings) for w in ("--set", s)]
        return self.evpose("track", recording, "--map", self.recording / "contours.ply", "--occluders",
                           self.recording / "mesh.ply", "-o", self.root / name, "--force", *words)

    def accuracy(self, recording, name, *settings):
        done = self.track(recording, name, *settings)
        self.assertIn(done.returncode, (0, 1), done.stderr)
        summary = json.loads((self.root / name / "summary.json").read_text())
        self.assertGreater(summary["coverage"], 0.9)
        return summary["accuracy"]

    def alone(self):
        """The recording without its events."""
        folder = self.root / "frames_alone"
        if not folder.exists():
            shutil.copytree(self.recording, folder)
            (folder / "events.h5").unlink()
        return folder

    def refused(self, done, *words):
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertEqual(len(done.stderr.strip().splitlines()), 1, done.stderr)
        for word in words:
            self.assertIn(word, done.stderr)

    def test_frames_alone_hold_the_pose(self):
        accuracy = self.accuracy(self.recording, "alone", "frames.use=alone")
        self.assertLess(accuracy["ate_mean_mm"], 8)
        self.assertLess(accuracy["are_mean_deg"], 0.2)

    def test_a_recording_without_events_is_tracked_by_its_frames(self):
        accuracy = self.accuracy(self.alone(), "absent")
        self.assertLess(accuracy["ate_mean_mm"], 8)
        self.assertLess(accuracy["are_mean_deg"], 0.2)

    def test_frames_are_fused_by_default_and_change_the_pose(self):
        self.accuracy(self.recording, "fused")
        self.accuracy(self.recording, "without", "frames.use=off")
        bare = self.root / "bare"
        shutil.copytree(self.recording, bare, ignore=shutil.ignore_patterns("frames"))
        self.accuracy(bare, "bare_run")
        fused, without, never = ((self.root / name / "states.csv").read_bytes() for name in ("fused", "without", "bare_run"))
        self.assertFalse(fused == without)
        self.assertTrue(without == never)

    def test_any_packets_and_threads_give_the_same_bytes(self):
        self.track(self.recording, "one")
        self.track(self.recording, "two", "packet_ms=7", "threads=3")
        one, two = ((self.root / name / "states.csv").read_bytes() for name in ("one", "two"))
        self.assertTrue(one == two)

    def test_what_is_wrong_with_frames_is_said_in_one_line(self):
        bare = self.root / "no_frames"
        shutil.copytree(self.recording, bare, ignore=shutil.ignore_patterns("frames"))
        self.refused(self.track(bare, "r", "frames.use=alone"), "has no frames", "frames/timestamps.csv")
        self.refused(self.track(self.alone(), "r", "frames.use=off"), "has frames and no events")
        broken = self.root / "broken"
        shutil.copytree(self.recording, broken)
        picture = broken / "frames/000003.png"
        picture.write_bytes(picture.read_bytes()[:200])
        self.refused(self.track(broken, "r"), "000003.png", "damaged")
        picture.unlink()
        self.refused(self.track(broken, "r"), "timestamps.csv:5", "is not there")
        self.refused(self.evpose("calibrate", self.alone(), "--map", self.recording / "contours.ply", "-o", self.root / "c.yaml"),
                     "frames")

    def test_a_recording_folder_keeps_its_frames_and_euroc_is_read_again(self):
        done = self.evpose("convert", self.recording, self.root / "copy", "--start", 0.2)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("frames", done.stdout)
        rows = (self.root / "copy/frames/timestamps.csv").read_text().splitlines()
        self.assertLess(len(rows), SECONDS * 40 - 5)
        done = self.evpose("convert", self.recording, self.root / "euroc", "--to-format", "euroc")
        self.assertEqual(done.returncode, 0, done.stderr)
        pose = (self.recording / "groundtruth.tum").read_text().splitlines()
        first = next(row for row in pose if not row.startswith("#")).split()
        t = float((self.root / "euroc/times.txt").read_text().split()[0]) * 1e-9
        near = min((row.split() for row in pose if not row.startswith("#")), key=lambda r: abs(float(r[0]) - t))
        self.assertTrue(first)
        done = self.evpose("track", self.root / "euroc", "--map", self.recording / "contours.ply", "--init",
                           ",".join(near[1:]) + f"@{near[0]}", "-o", self.root / "euroc_run")
        self.assertIn(done.returncode, (0, 1), done.stderr)
        shutil.rmtree(self.root / "copy/frames")
        self.refused(self.evpose("convert", self.root / "copy", self.root / "none", "--to-format", "euroc"), "has no frames")

    def orb(self, *words):
        return subprocess.run([sys.executable, str(pathlib.Path(SOURCES) / "benchmarks/orb_slam3.py"), "--evpose", str(EVPOSE),
                               *map(str, words)], capture_output=True, text=True, timeout=200)

    def test_contours_are_seen_again_more_often_than_chance_has_it(self):
        """And corners in the events are found, a few of them where they were: the figures of `bench corners`."""
        done = self.evpose("bench", "corners", self.root, "--only", "recording")
        self.assertEqual(done.returncode, 0, done.stderr)
        cells = [cell.strip() for cell in done.stdout.strip().splitlines()[-1].strip("|").split("|")]
        self.assertEqual(cells[0], "recording")
        self.assertGreater(float(cells[1]), 0.1)
        self.assertLess(float(cells[1]), 30)
        shares = [[float(number) for number in re.findall(r"[\d.]+", cell)] for cell in cells[2:]]
        self.assertEqual(len(shares), 6)
        for seen, by_chance in shares[3:]:
            self.assertGreater(seen, 1.5 * by_chance)
        self.refused(self.evpose("bench", "corners", self.root / "nowhere"), "none of the wanted recordings")

    def test_orb_slam3_is_judged_after_alignment(self):
        program, vocabulary = self.root / "mono_inertial_euroc", self.root / "ORBvoc.txt"
        program.write_text(STAND_IN.format(python=sys.executable))
        program.chmod(program.stat().st_mode | stat.S_IXUSR)
        vocabulary.write_text("words")
        done = self.orb("--orb", program, "--vocabulary", vocabulary, self.recording)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("aligned by SE(3)", done.stdout)
        cells = [cell.strip() for cell in done.stdout.strip().splitlines()[-1].split("|")[1:-1]]
        self.assertEqual(cells[0], "recording")
        self.assertLess(float(cells[1]), 1)
        self.assertLess(float(cells[2]), 0.05)
        self.assertGreater(float(cells[4]), 80)

    def test_orb_slam3_that_is_not_there_or_fails_is_said_in_one_line(self):
        done = self.orb("--orb", self.root / "nothing", self.recording)
        self.assertEqual(done.returncode, 2)
        self.assertIn("not installed", done.stderr)
        self.assertEqual(len(done.stderr.strip().splitlines()), 1)
        program, vocabulary = self.root / "failing", self.root / "voc.txt"
        program.write_text(f"#!{sys.executable}\nimport sys\nsys.exit('no features')\n")
        program.chmod(0o755)
        vocabulary.write_text("words")
        done = self.orb("--orb", program, "--vocabulary", vocabulary, self.recording)
        self.assertEqual(done.returncode, 1)
        self.assertIn("no features", done.stderr)


if __name__ == "__main__":
    EVPOSE, SOURCES = os.path.abspath(sys.argv[1]), sys.argv[2]
    del sys.argv[1:3]
    unittest.main()
