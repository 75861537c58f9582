#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Runs the commands of docs/use/first-flight.md as they stand there: first_flight_test.py EVPOSE ROOT [--keep FOLDER]

A simulated flight is handed over as an EVK4 and a Pixhawk would: EVT3 RAW, DataFlash log in the autopilot's axes and on
its clock, a cloud, a calibration with errors. Commands are the unnamed code blocks, output that is promised those named
text; numbers of that may differ. --keep leaves the data there.
"""
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest

try:
    import h5py  # noqa: F401: situations.py needs it
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)

from layouts import quaternion
from situations import dataflash

EVPOSE, ROOT = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2])
PAGE = ROOT / "docs/use/first-flight.md"
FLIGHT = f"""
scene_file: {ROOT.resolve()}/tests/end_to_end/hall.yaml
duration_s: 5
camera: {{size: custom, width: 400, height: 300, focal_px: 280}}
trajectory: {{kind: lissajous, centre_x_m: 0, centre_y_m: 0, centre_z_m: 1.4, size_forward_m: 1.6, size_left_m: 2,
  size_up_m: 0.9, speed_m_s: 0.7, rate_deg_s: 70, sway_deg: 14}}
imu: {{rate_hz: 400}}
handed_over: {{preset: ordinary, time_sigma_ms: 0}}
lidar: {{on: true, flight: {{duration_s: 10, centre_x_m: 0, centre_y_m: 0, centre_z_m: 1.4, size_forward_m: 4,
  size_left_m: 3, size_up_m: 1}}}}
"""
BOOT_S = 37.4  # the autopilot was switched on so long before the camera
FLIP = np.diag([1.0, -1, -1])  # forward, left, up to forward, right, down


def evpose(place, *words):
    done = subprocess.run([str(word) for word in (EVPOSE, *words)], cwd=place, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


def matrix_rows(text):
    """The numbers of T_cam_imu."""
    rows = re.search(r"T_cam_imu:\n((?:  - .*\n)+)", text)[1]
    return np.array([[float(word) for word in row[row.index("[") + 1:-1].split(",")] for row in rows.splitlines()])


def rotation(q):
    x, y, z, w = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def hand_over(made, place):
    """The recording as files of the cameras' own: folder `flight`, hall.ply; truth.tum of the Pixhawk's body."""
    flight = place / "flight"
    flight.mkdir()
    evpose(place, "convert", made / "events.h5", flight / "recording_2026-05-04.raw")
    rows = np.loadtxt(made / "imu.csv", delimiter=",", skiprows=1)
    turned = np.hstack([rows[:, 1:4] @ FLIP, rows[:, 4:7] @ FLIP])
    (flight / "00000042.BIN").write_bytes(dataflash(rows[:, 0], turned, first_us=round(BOOT_S * 1e6)))
    text = (made / "camchain-imucam.yaml").read_text()
    T = matrix_rows(text)
    T[:3, :3] = T[:3, :3] @ FLIP
    lines = "".join("  - [" + ", ".join(repr(float(v)) for v in row) + "]\n" for row in T)
    text = re.sub(r"T_cam_imu:\n(  - .*\n)+", "T_cam_imu:\n" + lines, text)
    text = re.sub(r"  timeshift_sigma: .*\n", "", text)
    (flight / "camchain-imucam.yaml").write_text(text)
    shutil.copy(made / "imu.yaml", flight / "imu.yaml")
    shutil.copy(made / "map_raw.ply", place / "hall.ply")
    truth = np.loadtxt(made / "groundtruth.tum")
    with open(place / "truth.tum", "w") as file:
        for row in truth:
            q = quaternion(rotation(row[4:8]) @ FLIP)
            file.write(f"{row[0] + BOOT_S:.9f} " + " ".join(f"{v:.9f}" for v in (*row[1:4], *q)) + "\n")


def blocks(text):
    """(named, lines) of each code block."""
    return [(name, body.splitlines()) for name, body in re.findall(r"^```(\w*)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)]


class FirstFlightTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.place = KEEP or pathlib.Path(scratch.name)
        cls.place.mkdir(exist_ok=True)
        made = cls.place / "made"
        (cls.place / "flight.yaml").write_text(FLIGHT)
        evpose(cls.place, "simulate", "flight.yaml", "-o", made)
        hand_over(made, cls.place)

    def shell(self, line, wanted):
        """Runs one line of the tutorial; what it printed."""
        path = f"{EVPOSE.parent}:{os.environ['PATH']}"
        process = subprocess.Popen(["bash", "-c", "exec " + line if line.startswith("evpose view") else line], cwd=self.place,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, stdin=subprocess.DEVNULL,
                                   env={**os.environ, "PATH": path})
        if line.startswith("evpose view"):  # until Ctrl-C
            self.assertIn("open http://", process.stderr.readline())
            process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=300)
        if KEEP:
            print(f"$ {line}\n{out}{err}", flush=True)
        self.assertEqual(process.returncode, wanted, f"{line}\n{out}{err}")
        return out

    def promised(self, lines, said):
        """Each line was printed; but for its numbers."""
        def plain(text):
            return re.sub(r" +", " ", re.sub(r"-?\d+(\.\d+)?", "#", text)).strip()
        printed = [plain(line) for line in said.splitlines()]
        for line in lines:
            self.assertIn(plain(line), printed, said)

    def test_the_commands_lead_to_a_pose(self):
        said, everything = "", []
        page = blocks(PAGE.read_text())
        for k, (name, lines) in enumerate(page):
            if name == "text":
                self.promised(lines, said)
                continue
            self.assertEqual(name, "", "a block is commands, or the text that they print")
            next_text = page[k + 1][1] if k + 1 < len(page) and page[k + 1][0] == "text" else []
            wanted = 1 if any(line.startswith("PROBLEM") for line in next_text) else 0
            said = ""
            for line in lines:
                if line.startswith("evpose render") and shutil.which("ffmpeg") is None:
                    continue
                said += self.shell(line, wanted)
                everything.append(line)
        for command in ("info", "map build", "check", "track", "view", "render", "convert", "serve"):
            self.assertTrue(any(line.startswith(f"evpose {command} ") for line in everything), command)
        self.judge()

    def judge(self):
        """What came out is the truth: the pose, the clocks, and what the calibration was wrong by."""
        import json
        scored = json.loads(evpose(self.place, "eval", "run/trajectory.tum", "truth.tum", "--json"))
        self.assertLess(scored["accuracy"]["ate_mean_mm"], MOST_MM)
        self.assertLess(scored["accuracy"]["are_mean_deg"], MOST_DEG)
        offset_s = float(re.search(r"offset_events_s: ([\d.]+)", (self.place / "flight/recording.yaml").read_text())[1])
        found = json.loads((self.place / "run/summary.json").read_text())["calibration"]["timeshift_cam_imu_s"]["found"]
        self.assertAlmostEqual(offset_s, BOOT_S, delta=0.02)
        self.assertAlmostEqual(offset_s + found, BOOT_S, delta=0.002)


MOST_MM, MOST_DEG = 25.0, 1.0

if __name__ == "__main__":
    KEEP = pathlib.Path(sys.argv[4]) if sys.argv[3:4] == ["--keep"] else None
    sys.argv = sys.argv[:1]
    unittest.main()
