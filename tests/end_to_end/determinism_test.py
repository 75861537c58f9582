#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The same recording gives the same bytes, however it is read and computed. determinism_test.py EVPOSE"""
import pathlib
import subprocess
import sys
import tempfile
import unittest

try:
    import h5py  # noqa: F401: the recordings need it
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)

from recording import CALIBRATION, Recording

EVPOSE = None
FILES = ("trajectory.tum", "trajectory_camera.tum", "states.csv", "states_imu.csv")


class DeterminismTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.root = pathlib.Path(scratch.name)
        recording = Recording()
        recording.calibration = CALIBRATION  # states nothing of its errors: it is aligned and estimated, too
        cls.folder = recording.write(cls.root / "recording")
        cls.reference = cls.track("reference")

    @classmethod
    def track(cls, name, *settings):
        command = [EVPOSE, "track", cls.folder, "--map", cls.folder / "contours.ply", "-o", cls.root / name]
        for setting in ("states_imu=true", *settings):
            command += ["--set", setting]
        subprocess.run([str(word) for word in command], check=True, capture_output=True, timeout=60)
        return {file: (cls.root / name / file).read_bytes() for file in FILES}

    def same(self, *settings):
        result = self.track("_".join(settings).replace("=", "_"), *settings)
        for file in FILES:
            self.assertTrue(result[file] == self.reference[file], f"{file} differs with {settings}")

    def test_a_second_run(self):
        self.same("packet_ms=1")

    def test_packets_of_any_length(self):
        self.same("packet_ms=0.1")
        self.same("packet_ms=10")

    def test_with_pictures_and_without(self):
        self.same("overlays=0")
        self.same("overlays=20", "packet_ms=3")

    def test_every_back_end(self):
        for kind in ("graph", "particle", "ekf"):
            reference = self.track(f"{kind}_1", f"fusion.kind={kind}")
            again = self.track(f"{kind}_2", f"fusion.kind={kind}", "packet_ms=7", "threads=3")
            for file in FILES:
                self.assertTrue(again[file] == reference[file], f"{file} differs with {kind}")

    def test_any_number_of_threads(self):
        self.same("threads=1")
        self.same("threads=2")
        self.same("threads=5", "packet_ms=3")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    EVPOSE = sys.argv.pop(1)
    unittest.main()
