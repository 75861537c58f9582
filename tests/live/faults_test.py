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
import time

import numpy as np
import serving
from recording import HEIGHT, WIDTH
from serving import EVENTS, IMU, ServingTest, free_port

STEP_US = 2000
STILL = [0.0, 0.0, 0.0, 0.0, 0.0, 9.81]
PAUSE_S = 0.392  # here the camera nearly stands


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
        return serving.packet(kind, self.sequence, self.clock_us, payload)

    def step(self, events, samples):
        """Either may be None: that sensor is silent."""
        for kind, payload in ((IMU, samples), (EVENTS, events)):
            if payload is not None:
                self.socket.sendall(self.packet(kind, payload))
        self.clock_us += STEP_US
        self.sent += 1
        time.sleep(max(0.0, self.begin + self.sent * STEP_US * 1e-6 - time.monotonic()))

    def play(self, begin_s, end_s):
        """What the camera sees and the IMU feels from one time of the recording to another."""
        for at, events, stamps, samples in serving.pieces(self.recording, int(begin_s * 1e6), int(end_s * 1e6), STEP_US):
            self.step(events, serving.imu_rows(stamps + (self.clock_us - at) * 1000, samples))

    def stand(self, seconds, events=True, imu=True):
        """A few events of noise, and gravity."""
        for _ in range(round(seconds * 1e6 / STEP_US)):
            n = 2
            noise = serving.event_rows(np.zeros(n), self.random.integers(0, WIDTH, n), self.random.integers(0, HEIGHT, n),
                                       np.ones(n, int))
            self.step(noise if events else None, serving.imu_rows([self.clock_us * 1000], [STILL]) if imu else None)


class FaultsTest(ServingTest):
    def driven(self, *arguments):
        process, port = self.serve_packets("-o", self.root / self.id(), *arguments)
        driver = Driver(port, self.recording)
        self.addCleanup(lambda: driver.socket.close())
        return process, driver

    def tracked_after(self, clock_us):
        """Poses that count after a time of the driver's clock."""
        rows = (self.root / self.id() / "trajectory.tum").read_text().splitlines()
        return sum(float(r.split()[0]) > clock_us * 1e-6 for r in rows if not r.startswith("#"))

    def test_the_imu_stops_for_two_seconds(self):
        process, driver = self.driven()
        driver.play(0, PAUSE_S)
        driver.stand(2, imu=False)
        again = driver.clock_us
        driver.play(PAUSE_S, 0.6)
        _, err = self.finish(process)
        for words in ("no IMU for 0.3 s", "events wait for the IMU", "IMU are coming again", "restarted: no IMU for 2"):
            self.assertIn(words, err)
        self.assertGreater(self.tracked_after(again), 20)

    def test_events_stop_for_five_seconds(self):
        process, driver = self.driven()
        driver.play(0, PAUSE_S)
        driver.stand(5, events=False)
        again = driver.clock_us
        driver.play(PAUSE_S, 0.6)
        _, err = self.finish(process)
        for words in ("no events for 0.3 s", "events are coming again", "restarted: no events for 5"):
            self.assertIn(words, err)
        self.assertGreater(self.tracked_after(again), 20)

    def test_the_clock_goes_back_by_a_second(self):
        process, driver = self.driven()
        driver.clock_us += 1_000_000
        driver.play(0, PAUSE_S)
        driver.clock_us -= 1_000_000
        driver.play(PAUSE_S, 0.6)
        out, err = self.finish(process)
        self.assertRegex(err, r"restarted: the clock of the (IMU|events) went back by (1|0\.99)")
        self.assertRegex(out, r"\b1 restarts")
        self.assertRegex(out, r"^(tracking|degraded|initialising)")  # 0.2 s from a standstill hardly verify a pose

    def test_the_driver_is_killed_within_a_packet_and_comes_again(self):
        process, driver = self.driven()
        driver.play(0, PAUSE_S)
        driver.socket.sendall(driver.packet(EVENTS, bytes(800))[:300])
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
        process = self.start("serve", self.folder, "--view", port, "--set", "replay.loop=true", "--set", "queue.shed=false")
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
        process = self.start("serve", self.folder, "--mavlink", f"serial://{name}:115200", "--set", "replay.loop=true")
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
                process = self.start("serve", self.folder, option, port if option == "--view" else f"udpin://127.0.0.1:{port}")
                out, err = process.communicate(timeout=30)
                self.assertEqual(process.returncode, 2, out + err)
                self.assertEqual(len([line for line in err.splitlines() if "in use" in line]), 1, err)


if __name__ == "__main__":
    serving.main(__doc__)
