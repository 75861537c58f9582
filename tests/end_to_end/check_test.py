#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""evpose check passes what can be tracked and names what cannot, with what to do. check_test.py EVPOSE"""
import pathlib
import re
import struct
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

from recording import Recording

EVPOSE = None


def run(*words):
    return subprocess.run([EVPOSE, *map(str, words)], capture_output=True, text=True, timeout=60,
                          stdin=subprocess.DEVNULL)


def dataflash(t_ns, imu):
    """A log of an ArduPilot that holds an IMU."""
    def kind(number, length, name, form, columns):
        return struct.pack("<3BBB4s16s64s", 0xA3, 0x95, 0x80, number, length, name, form, columns)

    log = kind(0x80, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    log += kind(0x90, 36, b"IMU", b"QBffffff", b"TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ")
    for t, row in zip(t_ns, imu):
        log += struct.pack("<3BQB6f", 0xA3, 0x95, 0x90, t // 1000, 0, *row)
    return log


class CheckTest(unittest.TestCase):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.addCleanup(self.scratch.cleanup)
        self.root = pathlib.Path(self.scratch.name)
        self.recording = Recording(duration_s=1.6)

    def check(self, *more):
        folder = self.root / "recording"
        if not folder.exists():
            self.recording.write(folder)
        return run("check", folder, *more)

    def broken(self, thing, what, fix, *more):
        """The check finds this problem with that remedy; status 1."""
        result = self.check(*more)
        self.assertEqual(result.returncode, 1, result.stdout + result.stderr)
        self.assertRegex(result.stdout, re.compile(rf"^PROBLEM  {thing} +.*{what}.*\n +do: .*{fix}", re.MULTILINE))
        self.assertRegex(result.stdout, r"\d+ problems?\n$")
        return result.stdout

    def test_what_can_be_tracked_passes(self):
        result = self.check("--map", self.root / "recording/contours.ply")
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        self.assertNotIn("PROBLEM", result.stdout)
        for thing in ("files", "events", "clocks", "IMU rate", "IMU", "calibration", "map", "start", "view"):
            self.assertRegex(result.stdout, re.compile(rf"^ok +{thing} ", re.MULTILINE))
        self.assertEqual(run("track", self.root / "recording", "-o", self.root / "run").returncode, 0)

    def test_no_such_recording_is_bad_input(self):
        result = run("check", self.root / "nowhere")
        self.assertEqual((result.returncode, result.stdout), (2, ""))

    def test_a_recording_that_cannot_be_opened_is_a_problem_and_the_map_is_checked(self):
        self.recording.calibration = self.recording.calibration.replace("distortion_model: none", "distortion_model: fish")
        said = self.broken("recording", "distortion_model", "radtan|Kalibr|calibrate")
        self.assertRegex(said, re.compile(r"^skipped +clocks", re.MULTILINE))
        self.assertRegex(said, re.compile(r"^ok +map", re.MULTILINE))

    def test_clocks_that_do_not_overlap(self):
        self.recording.imu_t_ns += 20_000_000_000
        said = self.broken("clocks", "overlap", "time.offset_events_s")
        self.assertRegex(said, re.compile(r"^ok +IMU rate", re.MULTILINE))

    def test_mixed_axes(self):
        self.recording.imu[:, 3:] = self.recording.imu[:, [5, 4, 3]]
        self.broken("IMU", "accelerometer's axes", "imu.columns")

    def test_events_after_the_end_of_the_imu(self):
        self.recording.imu, self.recording.imu_t_ns = self.recording.imu[:400], self.recording.imu_t_ns[:400]
        self.broken("clocks", "have no IMU", "record both")

    def test_damaged_events(self):
        self.recording.t[2000] -= 5000
        self.broken("events", "event 2000", "sort")

    def test_millimetres_between_camera_and_imu(self):
        self.recording.calibration = self.recording.calibration.replace("[0.0, -1.0, 0.0, 0.0]", "[0.0, -1.0, 0.0, 47.0]")
        self.broken("calibration", "47.00 m off the IMU", "metres")

    def test_a_map_in_centimetres(self):
        self.recording.contours[:, :3] *= 200
        said = self.broken("map", r"598 m wide: centimetres", "metres")
        self.assertRegex(said, r"PROBLEM  (start|view)")

    def test_no_map_and_a_cloud_for_a_map(self):
        self.recording.write(self.root / "recording")
        (self.root / "recording/contours.ply").unlink()
        self.broken("map", "no map", "--map")
        self.broken("map", "no such file", "path", "--map", self.root / "none.ply")

    def test_a_start_elsewhere(self):
        self.broken("start", r"lies 5\.\d m outside", "--init", "--init", "0,0,8,0,0,0,1")
        self.broken("view", "sees 0 points", "start", "--init", "0,0,1,0,0,1,0")
        self.broken("start", "deg off the map's z", "quaternion", "--init", "0,0,1,0.7071068,0,0,0.7071068")
        self.broken("start", "no start pose", "--init|quaternion", "--init", "1,2,3")

    def test_an_autopilots_log_beside_a_raw_file(self):
        folder = self.recording.write(self.root / "own")
        both = self.root / "recording"
        both.mkdir()
        for name in ("camchain-imucam.yaml", "imu.yaml", "contours.ply", "groundtruth.tum"):
            (both / name).write_bytes((folder / name).read_bytes())
        self.assertEqual(run("convert", folder / "events.h5", both / "events_of_the_day.raw").returncode, 0)
        log = both / "00000042.bin"  # before the events by name, and with an ending of event files
        log.write_bytes(dataflash(self.recording.imu_t_ns, self.recording.imu))
        result = self.check()
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        self.assertIn("events_of_the_day.raw, 00000042.bin", result.stdout)
        log.write_bytes(dataflash(self.recording.imu_t_ns[::20], self.recording.imu[::20]))
        self.broken("IMU rate", "25 Hz is too slow", "LOG_BITMASK")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    EVPOSE = sys.argv.pop(1)
    unittest.main()
