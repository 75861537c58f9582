#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The live program: serve_test.py EVPOSE"""
import os
import pathlib
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "end_to_end"))
try:
    import h5py  # noqa: F401: the recordings need it
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)

from recording import Recording

EVPOSE = None
FILES = ("trajectory.tum", "trajectory_camera.tum", "states.csv")
START = "0,0,1,0,0,0,1"


def free_port(kind=socket.SOCK_DGRAM):
    with socket.socket(socket.AF_INET, kind) as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def packets(recording, step_us=5000):
    """The recording as a driver would send it: docs/live.md."""
    sequence, imu = 0, 0
    for begin in range(0, int(recording.imu_t_ns[-1] // 1000), step_us):
        chosen = (recording.t >= begin) & (recording.t < begin + step_us)
        rows = np.zeros(chosen.sum(), dtype=[("dt", "<u4"), ("x", "<u2"), ("y", "<u2")])
        rows["dt"], rows["x"] = recording.t[chosen] - begin, recording.x[chosen]
        rows["y"] = recording.y[chosen] | recording.p[chosen] << 15
        samples = b""
        while imu < len(recording.imu) and recording.imu_t_ns[imu] < (begin + step_us) * 1000:
            samples += struct.pack("<q6d", recording.imu_t_ns[imu], *recording.imu[imu])
            imu += 1
        for kind, payload in ((2, samples), (1, rows.tobytes())):
            yield struct.pack("<IB3xIIq", 0x31505645, kind, sequence, len(payload), begin * 1000) + payload
            sequence += 1


class ServeTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.root = pathlib.Path(scratch.name)
        cls.recording = Recording()
        cls.folder = cls.recording.write(cls.root / "recording")

    def command(self, what, source, name, *arguments):
        words = [EVPOSE, what, source, "--map", self.folder / "contours.ply", *arguments]
        return [str(w) for w in words + (["-o", self.root / name] if name else [])]

    def run_to_end(self, *arguments):
        return subprocess.run(self.command(*arguments), capture_output=True, text=True, timeout=60)

    def start(self, *arguments):
        process = subprocess.Popen(self.command(*arguments), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.stderr.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        return process

    def source(self, address, name, *arguments):
        return self.start("serve", address, name, "--calibration", self.folder / "camchain-imucam.yaml", "--imu-model",
                          self.folder / "imu.yaml", "--init", START, *arguments)

    def same_files(self, a, b):
        for file in FILES:
            self.assertEqual((self.root / a / file).read_bytes(), (self.root / b / file).read_bytes(), file)

    def test_a_replay_is_what_track_says(self):
        self.assertEqual(self.run_to_end("track", self.folder, "tracked").returncode, 0)
        link = ["--mavlink", f"udp://127.0.0.1:{free_port()}"]
        fast = self.run_to_end("serve", self.folder, "fast", "--speed", "0", *link)
        self.assertEqual(fast.returncode, 0, fast.stderr)
        self.same_files("tracked", "fast")
        # At the clock's pace; a machine that is too busy may take longer, but leaves nothing out.
        paced = self.run_to_end("serve", self.folder, "paced", "--set", "queue.shed=false", *link)
        self.assertEqual(paced.returncode, 0, paced.stderr)
        self.same_files("tracked", "paced")
        self.assertIn("p99", paced.stdout)

    def test_interrupted_it_leaves_complete_files(self):
        process = self.start("serve", self.folder, "interrupted", "--set", "replay.loop=true")
        time.sleep(2)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
        self.assertEqual(process.returncode, 130, out + err)
        self.assertIn("restarted: the recording starts again", err)
        for file in (*FILES, "summary.json", "report.html", "config.yaml"):
            self.assertGreater((self.root / "interrupted" / file).stat().st_size, 0, file)

    def test_packets_by_tcp_are_tracked_and_a_driver_may_come_again(self):
        port = free_port(socket.SOCK_STREAM)
        process = self.source(f"tcp://127.0.0.1:{port}", "tcp", "--set", "queue.shed=false", "--set", "session.stall_s=60")
        self.assertIsNotNone(self.drive(port))
        self.assertIsNotNone(self.drive(port))  # its clock starts again
        time.sleep(1)
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=30)
        self.assertEqual(process.returncode, 130, out + err)
        self.assertIn("the driver has gone after 240 packets", err)
        self.assertIn("went back by", err)
        self.assertIn(f"events: {2 * len(self.recording.t)} arrived, 0 shed", out)
        rows = (self.root / "tcp" / "trajectory.tum").read_text().splitlines()
        self.assertGreater(len([r for r in rows if not r.startswith("#")]), 150)

    def drive(self, port):
        for _ in range(100):
            try:
                with socket.create_connection(("127.0.0.1", port)) as driver:
                    for packet in packets(self.recording):
                        driver.sendall(packet)
                    return True
            except ConnectionRefusedError:
                time.sleep(0.05)
        return None

    def test_what_is_wrong_is_said_in_one_line(self):
        def refused(words, *arguments):
            done = self.run_to_end("serve", *arguments)
            self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
            self.assertEqual(len(done.stderr.strip().splitlines()), 1, done.stderr)
            self.assertIn(words, done.stderr)

        refused("no address of a link", self.folder, "x", "--mavlink", "udp:127.0.0.1")
        refused("--calibration", "udp://127.0.0.1:9", "x")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
            taken.bind(("127.0.0.1", 0))
            refused("the port is in use", f"udp://127.0.0.1:{taken.getsockname()[1]}", "x", "--calibration",
                    self.folder / "camchain-imucam.yaml", "--init", START)
        refused("mavlink.rate_hz", self.folder, "x", "--set", "mavlink.rate_hertz=3")
        self.assertFalse((self.root / "x").exists())

    def test_every_setting_is_printed(self):
        done = subprocess.run([EVPOSE, "serve", "--dump-config"], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0)
        for group in ("replay:", "queue:", "session:", "mavlink:", "frames:"):
            self.assertIn(group, done.stdout)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    EVPOSE = sys.argv.pop(1)
    unittest.main()
