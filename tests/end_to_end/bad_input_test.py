#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Bad input: one clear line, exit status 2, nothing overwritten. bad_input_test.py EVPOSE

Each case spoils one thing of a healthy recording; the line must name the file (or key), where, and what to do.
"""
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

from recording import Recording

EVPOSE = None


class BadInputTest(unittest.TestCase):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.addCleanup(self.scratch.cleanup)
        self.root = pathlib.Path(self.scratch.name)
        self.recording = Recording()

    def track(self, folder, *more, map_file=None, output="run"):
        command = [EVPOSE, "track", folder, "--map", map_file or folder / "contours.ply", "-o", self.root / output]
        return subprocess.run([str(word) for word in command + list(more)], capture_output=True, text=True,
                              timeout=60, stdin=subprocess.DEVNULL)

    def refused(self, folder, *more, says, map_file=None):
        """Runs and asserts the refusal; `says`: expressions that the one line must match."""
        before = self.root / "run"
        before.mkdir(exist_ok=True)
        (before / "summary.json").write_text("of an earlier run")
        result = self.track(folder, "--force", *more, map_file=map_file)
        message = result.stderr
        self.assertEqual(result.returncode, 2, f"status {result.returncode}: {message}{result.stdout}")
        self.assertEqual(message.count("\n"), 1, f"not one line: {message!r}")
        self.assertRegex(message, r"^evpose: .+: .+; .+\n$", "WHERE: WHAT; FIX")
        for expression in says:
            self.assertRegex(message, re.compile(expression, re.IGNORECASE))
        self.assertEqual(sorted(path.name for path in before.iterdir()), ["summary.json"])
        self.assertEqual((before / "summary.json").read_text(), "of an earlier run")
        strangers = {path.name for path in self.root.iterdir()} - {"run", "recording", "map.ply", "map.pcd", "c.yaml"}
        self.assertEqual(strangers, set(), "left behind beside the output")

    def written(self, **more):
        return self.recording.write(self.root / "recording", **more)

    # The control: without it every refusal below could be for a reason of its own.

    def test_the_healthy_recording_is_tracked(self):
        result = self.track(self.written())
        self.assertEqual(result.returncode, 0, result.stderr + result.stdout)
        for name in ("trajectory.tum", "states.csv", "summary.json", "report.html"):
            self.assertTrue((self.root / "run" / name).stat().st_size > 0, name)

    # Events.

    def test_missing_recording(self):
        self.refused(self.root / "recording", says=["recording", "no such|not found|does not exist|missing"],
                     map_file=self.root / "map.ply")

    def test_missing_events(self):
        folder = self.written()
        (folder / "events.h5").unlink()
        self.refused(folder, says=[r"events\.h5"])

    def test_missing_map(self):
        self.refused(self.written(), says=[r"map\.ply"], map_file=self.root / "map.ply")

    def test_truncated_events(self):
        folder = self.written()
        whole = (folder / "events.h5").read_bytes()
        for share in (0.0, 0.01, 0.3, 0.7, 0.999):
            with self.subTest(share=share):
                (folder / "events.h5").write_bytes(whole[:int(len(whole) * share)])
                self.refused(folder, says=[r"events\.h5", "truncated|incomplete|cut|damaged|empty|not an? HDF5"])

    def test_unequal_columns(self):
        folder = self.written()
        with h5py.File(folder / "events.h5", "a") as file:
            file["events/x"].resize((100,))
        self.refused(folder, says=[r"events\.h5", "100", str(len(self.recording.t))])

    def test_events_out_of_order(self):
        self.recording.t[2000] -= 5000
        self.refused(self.written(), says=[r"events\.h5", r"\b(2000|2001)\b", "order|back|sorted"])

    def test_event_outside_of_the_image(self):
        self.recording.x[1234] = 160
        self.refused(self.written(), says=[r"events\.h5", r"\b(1234|1235)\b", "160"])

    def test_seconds_instead_of_microseconds(self):
        self.recording.t = self.recording.t * 1e-6
        self.refused(self.written(t_type="f8"), says=[r"events\.h5", "seconds", r"events\.time_unit"])

    def test_no_events(self):
        for name in "txyp":
            setattr(self.recording, name, getattr(self.recording, name)[:0])
        self.refused(self.written(), says=[r"events\.h5", "no events|empty"])

    # IMU and calibration.

    def test_imu_gap(self):
        keep = (self.recording.imu_t_ns < 200_000_000) | (self.recording.imu_t_ns > 330_000_000)
        self.recording.imu, self.recording.imu_t_ns = self.recording.imu[keep], self.recording.imu_t_ns[keep]
        self.refused(self.written(), says=[r"imu\.csv:(101|102|103)\b", "gap", r"0?\.13\d* ?s|13\d(\.\d+)? ?ms"])

    def test_gyroscope_in_degrees(self):
        t_s = self.recording.imu_t_ns * 1e-9
        self.recording.imu[:, 0] = np.degrees(3 * np.sin(6 * t_s))
        self.refused(self.written(), says=[r"imu\.csv", "deg/s", r"imu\.gyro_unit"])

    def test_accelerometer_in_g(self):
        self.recording.imu[:, 3:] /= 9.80665
        self.refused(self.written(), says=[r"imu\.csv", r"\bg\b", r"imu\.accel_unit"])

    def test_imu_not_a_number(self):
        self.recording.imu[50, 4] = np.nan
        self.refused(self.written(), says=[r"imu\.csv:52\b"])

    def test_imu_of_another_time(self):
        self.recording.imu_t_ns += 20_000_000_000
        self.refused(self.written(), says=["imu", "overlap"])

    def test_calibration_without_extrinsics(self):
        self.recording.calibration = re.sub(r"  T_cam_imu:\n(  - .*\n)+", "", self.recording.calibration)
        self.refused(self.written(), says=[r"camchain-imucam\.yaml", "T_cam_imu"])

    def test_broken_yaml_names_its_line(self):
        self.recording.calibration = self.recording.calibration.replace("resolution: [", "resolution: [[")
        self.refused(self.written(), says=[r"camchain-imucam\.yaml:\d+"])

    # Map.

    def test_empty_map(self):
        self.recording.contours = self.recording.contours[:0]
        self.refused(self.written(), says=[r"contours\.ply", "empty|no (contour )?points"])

    def test_not_a_number_in_a_cloud(self):
        self.recording.contours[77, 1] = np.nan
        self.refused(self.written(), says=[r"contours\.ply", r"\b(77|78)\b", "nan|finite"])

    def test_truncated_map(self):
        folder = self.written()
        whole = (folder / "contours.ply").read_bytes()
        (folder / "contours.ply").write_bytes(whole[:-1000])
        self.refused(folder, says=[r"contours\.ply", "bytes"])

    def test_map_that_never_comes_into_view(self):
        self.recording.contours[:, 0] -= 6  # behind the camera
        self.refused(self.written(), says=["map|contours", "view|seen|visible"])

    # Start and settings.

    def test_start_off_the_map(self):
        self.refused(self.written(), "--init", "500,0,1,0,0,0,1@0.1", says=["--init|start", "map"])

    def test_start_that_is_no_pose(self):
        folder = self.written()
        for text in ("1,2,3", "a,b,c,d,e,f,g", "0,0,1,0,0,0,0", "nan,0,1,0,0,0,1"):
            with self.subTest(text=text):
                self.refused(folder, "--init", text, says=["--init"])

    def test_ground_truth_wanted_but_absent(self):
        folder = self.written()
        (folder / "groundtruth.tum").unlink()
        self.refused(folder, "--init", "groundtruth", says=[r"groundtruth\.tum|ground truth", "--init"])

    def test_unknown_setting_names_the_nearest(self):
        self.refused(self.written(), "--set", "rate_hx=100", says=["--set", "rate_hx", "rate_hz"])

    def test_unknown_setting_in_a_file_names_its_line(self):
        config = self.root / "c.yaml"
        config.write_text("# settings\nno_such_key: 3\n")
        self.refused(self.written(), "--config", config, says=[r"c\.yaml:2", "no_such_key"])

    def test_unknown_key_in_the_recording(self):
        folder = self.written()
        (folder / "recording.yaml").write_text("version: 1\nimu:\n  acel_unit: g\n")
        self.refused(folder, says=[r"recording\.yaml:3", "acel_unit", "accel_unit"])

    def test_an_earlier_run_is_replaced_only_by_force(self):
        folder = self.written()
        self.assertEqual(self.track(folder).returncode, 0)
        before = (self.root / "run/latency.csv").read_bytes()
        result = self.track(folder)
        self.assertEqual(result.returncode, 2, result.stdout)
        self.assertRegex(result.stderr, r"^evpose: .*run: holds an earlier run; .*--force.*-o\n$")
        self.assertEqual((self.root / "run/latency.csv").read_bytes(), before)
        self.assertEqual(self.track(folder, "--force").returncode, 0)
        self.assertNotEqual((self.root / "run/latency.csv").read_bytes(), before)

    def test_a_folder_that_is_no_run_is_not_replaced(self):
        (self.root / "run").mkdir()
        (self.root / "run" / "thesis.txt").write_text("years of work")
        result = self.track(self.written())
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertEqual((self.root / "run" / "thesis.txt").read_text(), "years of work")
        self.assertEqual(len(list((self.root / "run").iterdir())), 1)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    EVPOSE = sys.argv.pop(1)
    unittest.main()
