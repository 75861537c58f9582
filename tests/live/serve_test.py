#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The live program: serve_test.py EVPOSE"""
import signal
import socket
import subprocess
import time

import serving
from serving import EVENTS, IMU, START, ServingTest, free_port, packet

FILES = ("trajectory.tum", "trajectory_camera.tum", "states.csv")


def packets(recording, step_us=5000):
    """The recording as a driver would send it."""
    sequence = 0
    for at, events, stamps, samples in serving.pieces(recording, 0, int(recording.imu_t_ns[-1] // 1000), step_us):
        for kind, payload in ((IMU, serving.imu_rows(stamps, samples)), (EVENTS, events)):
            yield packet(kind, sequence, at, payload)
            sequence += 1


class ServeTest(ServingTest):
    def into(self, name):
        return ["-o", self.root / name]

    def same_files(self, a, b):
        for file in FILES:
            self.assertEqual((self.root / a / file).read_bytes(), (self.root / b / file).read_bytes(), file)

    def test_a_replay_is_what_track_says(self):
        self.assertEqual(self.run_to_end("track", self.folder, *self.into("tracked")).returncode, 0)
        link = ["--mavlink", f"udp://127.0.0.1:{free_port(socket.SOCK_DGRAM)}"]
        fast = self.run_to_end("serve", self.folder, *self.into("fast"), "--speed", "0", *link)
        self.assertEqual(fast.returncode, 0, fast.stderr)
        self.assertIn("not real time: the recording is replayed as fast as it is tracked", fast.stderr)
        self.same_files("tracked", "fast")
        # At the clock's pace; a machine that is too busy may take longer, but leaves nothing out.
        paced = self.run_to_end("serve", self.folder, *self.into("paced"), "--set", "queue.shed=false", *link)
        self.assertEqual(paced.returncode, 0, paced.stderr)
        self.same_files("tracked", "paced")
        self.assertIn("p99", paced.stdout)
        self.assertNotIn("replayed", paced.stderr)
        unsaved = self.run_to_end("serve", self.folder, "--speed", "0")
        self.assertRegex(unsaved.stdout, r"tracking in \d+\.\d % of the updates")

    def test_interrupted_it_leaves_complete_files(self):
        process = self.start("serve", self.folder, *self.into("interrupted"), "--set", "replay.loop=true")
        time.sleep(2)
        _, err = self.finish(process)
        self.assertIn("restarted: the recording starts again", err)
        for file in (*FILES, "summary.json", "report.html", "config.yaml"):
            self.assertGreater((self.root / "interrupted" / file).stat().st_size, 0, file)

    def test_packets_by_tcp_are_tracked_and_a_driver_may_come_again(self):
        process, port = self.serve_packets(*self.into("tcp"), "--set", "session.stall_s=60")
        self.assertIsNotNone(self.drive(port))
        self.assertIsNotNone(self.drive(port))  # its clock starts again
        time.sleep(1)
        out, err = self.finish(process, signal.SIGTERM)
        self.assertIn("the driver has gone after 240 packets", err)
        self.assertIn("went back by", err)
        self.assertIn(f"events: {2 * len(self.recording.t)} arrived, 0 shed", out)
        rows = (self.root / "tcp" / "trajectory.tum").read_text().splitlines()
        self.assertGreater(len([r for r in rows if not r.startswith("#")]), 150)

    def drive(self, port):
        for _ in range(100):
            try:
                with socket.create_connection(("127.0.0.1", port)) as driver:
                    for data in packets(self.recording):
                        driver.sendall(data)
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

        x = self.into("x")
        refused("no address of a link", self.folder, *x, "--mavlink", "udp:127.0.0.1")
        refused("--calibration", "udp://127.0.0.1:9", *x)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
            taken.bind(("127.0.0.1", 0))
            refused("the port is in use", f"udp://127.0.0.1:{taken.getsockname()[1]}", *x, "--calibration",
                    self.folder / "camchain-imucam.yaml", "--init", START)
        refused("mavlink.rate_hz", self.folder, *x, "--set", "mavlink.rate_hertz=3")
        self.assertFalse((self.root / "x").exists())

    def test_every_setting_is_printed(self):
        done = subprocess.run([self.EVPOSE, "serve", "--dump-config"], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0)
        for group in ("replay:", "queue:", "session:", "mavlink:", "frames:"):
            self.assertIn(group, done.stdout)


if __name__ == "__main__":
    serving.main(__doc__)
