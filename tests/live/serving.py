# SPDX-License-Identifier: BSD-3-Clause
"""The live program under test: recordings to serve, ports, packets as a driver sends them (docs/use/live.md)."""
import pathlib
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "end_to_end"))
try:
    import h5py  # noqa: F401: the recordings need it
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)

from recording import Recording

START = "0,0,1,0,0,0,1"
EVENTS, IMU = 1, 2


def free_port(kind):
    with socket.socket(socket.AF_INET, kind) as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def packet(kind, sequence, base_us, payload):
    return struct.pack("<IB3xIIq", 0x31505645, kind, sequence, len(payload), base_us * 1000) + payload


def event_rows(dt_us, x, y, p):
    rows = np.zeros(len(dt_us), dtype=[("dt", "<u4"), ("x", "<u2"), ("y", "<u2")])
    rows["dt"], rows["x"], rows["y"] = dt_us, x, np.asarray(y, int) | np.asarray(p, int) << 15
    return rows.tobytes()


def imu_rows(stamps_ns, samples):
    return b"".join(struct.pack("<q6d", int(t), *sample) for t, sample in zip(stamps_ns, samples))


def pieces(recording, begin_us, end_us, step_us):
    """(time in us, events as bytes, IMU stamps in ns, IMU samples) of each step of a recording."""
    r = recording
    for at in range(begin_us, end_us, step_us):
        seen = (r.t >= at) & (r.t < at + step_us)
        felt = (r.imu_t_ns >= at * 1000) & (r.imu_t_ns < (at + step_us) * 1000)
        yield at, event_rows(r.t[seen] - at, r.x[seen], r.y[seen], r.p[seen]), r.imu_t_ns[felt], r.imu[felt]


class ServingTest(unittest.TestCase):
    """Subclasses set EVPOSE. Every program started is ended with its test."""

    EVPOSE = None

    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.root = pathlib.Path(scratch.name)
        cls.recording = Recording()
        cls.folder = cls.recording.write(cls.root / "recording")

    def command(self, what, source, *arguments):
        return [str(w) for w in (self.EVPOSE, what, source, "--map", self.folder / "contours.ply", *arguments)]

    def run_to_end(self, *arguments):
        return subprocess.run(self.command(*arguments), capture_output=True, text=True, timeout=60)

    def start(self, *arguments):
        process = subprocess.Popen(self.command(*arguments), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for cleanup in (process.stdout.close, process.stderr.close, process.wait, process.kill):
            self.addCleanup(cleanup)
        return process

    def serve_packets(self, *arguments):
        """The program, and the port of TCP at which it waits for a driver."""
        port = free_port(socket.SOCK_STREAM)
        return self.start("serve", f"tcp://127.0.0.1:{port}", "--calibration", self.folder / "camchain-imucam.yaml",
                          "--imu-model", self.folder / "imu.yaml", "--init", START, "--set", "queue.shed=false",
                          *arguments), port

    def finish(self, process, by=signal.SIGINT):
        process.send_signal(by)
        out, err = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130, out + err)
        return out, err


def main(doc):
    if len(sys.argv) < 2:
        sys.exit(doc)
    ServingTest.EVPOSE = sys.argv.pop(1)
    unittest.main()
