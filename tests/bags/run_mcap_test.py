#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A run becomes an MCAP file for Foxglove: run_mcap_test.py EVPOSE NODE SCRIPT LAYOUT"""
import pathlib
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "end_to_end"))
try:
    import h5py  # noqa: F401: the recordings need it
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)

from recording import Recording

EVPOSE, NODE, SCRIPT, LAYOUT = sys.argv[1:5]


class RunMcapTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.root = pathlib.Path(scratch.name)
        folder = Recording().write(cls.root / "recording")
        cls.evpose("track", folder, "-o", cls.root / "run")

    @staticmethod
    def evpose(*words, status=0):
        done = subprocess.run([EVPOSE, *map(str, words)], capture_output=True, text=True, timeout=60)
        assert done.returncode == status, done.stderr
        return done.stderr if status else done.stdout

    def test_mcaps_own_library_reads_all_of_it(self):
        said = self.evpose("convert", self.root / "run", self.root / "run.mcap")
        self.assertRegex(said, r"\d+ poses, \d+ map points, [5-7] pictures")
        done = subprocess.run([NODE, SCRIPT, self.root / "run.mcap", self.root / "run/trajectory.tum", LAYOUT],
                              capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_the_same_run_gives_the_same_bytes(self):
        for name in ("a.mcap", "b.mcap"):
            self.evpose("convert", self.root / "run", self.root / name)
        self.assertEqual((self.root / "a.mcap").read_bytes(), (self.root / "b.mcap").read_bytes())

    def test_without_its_recording_a_run_has_no_pictures(self):
        (self.root / "recording").rename(self.root / "away")
        self.addCleanup((self.root / "away").rename, self.root / "recording")
        said = self.evpose("convert", self.root / "run", self.root / "bare.mcap")
        self.assertRegex(said, r"0 map points, 0 pictures\nwithout pictures: .*recording.*: no such")

    def test_a_run_becomes_nothing_else(self):
        said = self.evpose("convert", self.root / "run", self.root / "run.bag", status=2)
        self.assertRegex(said, r"^evpose: .*run\.bag: a run cannot be written so; use .*\.mcap\n$")


if __name__ == "__main__":
    sys.argv = sys.argv[:1]
    unittest.main()
