#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Faults while serving, each against the whole program: faults_test.py EVPOSE

The camera stands still during a fault, so that tracking must go on after it.
"""
import base64
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

from recording import HEIGHT, WIDTH, Recording

EVPOSE = None
STEP_US = 2000
STILL = [0.0, 0.0, 0.0, 0.0, 0.0, 9.81]
PAUSE_S = 0.392  # here the camera nearly stands


def free_port(kind):
    with socket.socket(socket.AF_INET, kind) as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


class Driver:
    """A camera's driver at the pace of the wall clock."""

    def __init__(self, port, recording):
        self.recording, self.port, self.sequence, self.clock_us = recording, port, 0, 1_000_000
        self.random = np.random.default_rng(5)
        self.connect()

    def connect(self):
        for _ in range(200):
            try:
                self.socket = socket.create_connection(("127.0.0.1", self.port))
                self.begin, self.sent = time.monotonic(), 0
                return
            except ConnectionRefusedError:
                time.sleep(0.05)
        raise AssertionError("evpose does not listen")

    def packet(self, kind, payload):
        self.sequence += 1
        return struct.pack("<IB3xIIq", 0x31505645, kind, self.sequence, len(payload), self.clock_us * 1000) + payload

    def step(self, rows, samples):
        data = b""
        if samples is not None:
            data += self.packet(2, b"".join(struct.pack("<q6d", t, *sample) for t, sample in samples))
        if rows is not None:
            data += self.packet(1, rows.tobytes())
        self.socket.sendall(data)
        self.clock_us += STEP_US
        self.sent += 1
        time.sleep(max(0.0, self.begin + self.sent * STEP_US * 1e-6 - time.monotonic()))

    def play(self, begin_s, end_s):
        """What the camera sees and the IMU feels from one time of the recording to another."""
        r = self.recording
        for at in range(int(begin_s * 1e6), int(end_s * 1e6), STEP_US):
            chosen = (r.t >= at) & (r.t < at + STEP_US)
            rows = self.rows(r.t[chosen] - at, r.x[chosen], r.y[chosen], r.p[chosen])
            imu = (r.imu_t_ns >= at * 1000) & (r.imu_t_ns < (at + STEP_US) * 1000)
            self.step(rows, [(int(t) + (self.clock_us - at) * 1000, s) for t, s in zip(r.imu_t_ns[imu], r.imu[imu])])

    def stand(self, seconds, events=True, imu=True):
        """A few events of noise, and gravity."""
        for _ in range(round(seconds * 1e6 / STEP_US)):
            n = 2
            noise = self.rows(np.zeros(n), self.random.integers(0, WIDTH, n), self.random.integers(0, HEIGHT, n), np.ones(n, int))
            self.step(noise if events else None, [(self.clock_us * 1000, STILL)] if imu else None)

    @staticmethod
    def rows(dt, x, y, p):
        rows = np.zeros(len(dt), dtype=[("dt", "<u4"), ("x", "<u2"), ("y", "<u2")])
        rows["dt"], rows["x"], rows["y"] = dt, x, np.asarray(y, int) | np.asarray(p, int) << 15
        return rows


class FaultsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.root = pathlib.Path(scratch.name)
        cls.recording = Recording()
        cls.folder = cls.recording.write(cls.root / "recording")

    def serve(self, source, *arguments):
        words = [EVPOSE, "serve", source, "--map", self.folder / "contours.ply", *arguments]
        process = subprocess.Popen([str(w) for w in words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for cleanup in (process.stdout.close, process.stderr.close, process.wait, process.kill):
            self.addCleanup(cleanup)
        return process

    def serve_packets(self, *arguments):
        port = free_port(socket.SOCK_STREAM)
        process = self.serve(f"tcp://127.0.0.1:{port}", "--calibration", self.folder / "camchain-imucam.yaml", "--imu-model",
                             self.folder / "imu.yaml", "--init", "0,0,1,0,0,0,1", "--set", "queue.shed=false", "-o",
                             self.root / self.id(), *arguments)
        driver = Driver(port, self.recording)
        self.addCleanup(lambda: driver.socket.close())
        return process, driver

    def finish(self, process):
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130, out + err)
        return out, err

    def tracked_after(self, clock_us):
        """Poses that count after a time of the driver's clock."""
        rows = (self.root / self.id() / "trajectory.tum").read_text().splitlines()
        return sum(float(r.split()[0]) > clock_us * 1e-6 for r in rows if not r.startswith("#"))

    def test_the_imu_stops_for_two_seconds(self):
        process, driver = self.serve_packets()
        driver.play(0, PAUSE_S)
        driver.stand(2, imu=False)
        again = driver.clock_us
        driver.play(PAUSE_S, 0.6)
        _, err = self.finish(process)
        for words in ("no IMU for 0.3 s", "events wait for the IMU", "IMU are coming again", "restarted: no IMU for 2"):
            self.assertIn(words, err)
        self.assertGreater(self.tracked_after(again), 20)

    def test_events_stop_for_five_seconds(self):
        process, driver = self.serve_packets()
        driver.play(0, PAUSE_S)
        driver.stand(5, events=False)
        again = driver.clock_us
        driver.play(PAUSE_S, 0.6)
        _, err = self.finish(process)
        for words in ("no events for 0.3 s", "events are coming again", "restarted: no events for 5"):
            self.assertIn(words, err)
        self.assertGreater(self.tracked_after(again), 20)

    def test_the_clock_goes_back_by_a_second(self):
        process, driver = self.serve_packets()
        driver.clock_us += 1_000_000
        driver.play(0, PAUSE_S)
        driver.clock_us -= 1_000_000
        driver.play(PAUSE_S, 0.6)
        out, err = self.finish(process)
        self.assertRegex(err, r"restarted: the clock of the (IMU|events) went back by (1|0\.99)")
        self.assertRegex(out, r"\b1 restarts")
        self.assertRegex(out, r"^(tracking|degraded)")

    def test_the_driver_is_killed_within_a_packet_and_comes_again(self):
        process, driver = self.serve_packets()
        driver.play(0, PAUSE_S)
        driver.socket.sendall(driver.packet(1, bytes(800))[:300])
        driver.socket.close()
        time.sleep(1)
        driver.clock_us += 1_000_000
        driver.connect()
        again = driver.clock_us
        driver.play(PAUSE_S, 0.6)
        _, err = self.finish(process)
        self.assertIn("the driver has gone", err)
        self.assertIn("no events for 0.3 s", err)
        self.assertIn("restarted: no ", err)
        self.assertGreater(self.tracked_after(again), 20)

    def test_a_browser_that_never_reads_costs_nothing(self):
        port = free_port(socket.SOCK_STREAM)
        process = self.serve(self.folder, "--view", port, "--set", "replay.loop=true", "--set", "queue.shed=false")
        key = base64.b64encode(os.urandom(16)).decode()
        clients = []
        for _ in range(3):
            for _ in range(200):
                try:
                    client = socket.create_connection(("127.0.0.1", port))
                    break
                except ConnectionRefusedError:
                    time.sleep(0.05)
            client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
            client.sendall((f"GET /stream HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                            f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\n\r\n").encode())
            clients.append(client)
            self.addCleanup(client.close)
        time.sleep(2)
        before = self.memory_mb(process)
        time.sleep(4)
        self.assertLess(self.memory_mb(process), before + 20)
        out, _ = self.finish(process)
        self.assertRegex(out, r"[1-9]\d\d+ updates")

    @staticmethod
    def memory_mb(process):
        status = pathlib.Path(f"/proc/{process.pid}/status").read_text()
        return next(int(line.split()[1]) / 1024 for line in status.splitlines() if line.startswith("VmRSS:"))

    def test_the_serial_line_goes_away(self):
        master, slave = os.openpty()
        name = os.ttyname(slave)
        process = self.serve(self.folder, "--mavlink", f"serial://{name}:115200", "--set", "replay.loop=true")
        heard = b""
        until = time.monotonic() + 10
        while b"\xfd" not in heard and time.monotonic() < until:
            heard += os.read(master, 4096)
        self.assertIn(b"\xfd", heard)
        os.close(slave)
        os.close(master)  # the device is gone
        time.sleep(2)
        self.assertIsNone(process.poll())
        out, err = self.finish(process)
        self.assertIn(name, err)
        self.assertRegex(out, r"[1-9]\d\d+ updates")

    def test_a_port_in_use_is_one_line(self):
        for kind, option in ((socket.SOCK_STREAM, "--view"), (socket.SOCK_DGRAM, "--mavlink")):
            with socket.socket(socket.AF_INET, kind) as taken:
                taken.bind(("127.0.0.1", 0))
                if kind == socket.SOCK_STREAM:
                    taken.listen()
                port = taken.getsockname()[1]
                process = self.serve(self.folder, option, port if option == "--view" else f"udpin://127.0.0.1:{port}")
                out, err = process.communicate(timeout=30)
                self.assertEqual(process.returncode, 2, out + err)
                self.assertEqual(len([line for line in err.splitlines() if "in use" in line]), 1, err)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    EVPOSE = sys.argv.pop(1)
    unittest.main()
