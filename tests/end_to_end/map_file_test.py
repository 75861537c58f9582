#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The map file as another program reads it, checksums and all. map_file_test.py EVPOSE"""
import pathlib
import subprocess
import sys
import tempfile
import unittest
import zlib

try:
    import h5py
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)

from recording import Recording

EVPOSE = None


def datasets(file):
    found = {}
    file.visititems(lambda name, item: found.update({name: item}) if isinstance(item, h5py.Dataset) else None)
    return found


class MapFileTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.root = pathlib.Path(scratch.name)
        cls.recording = Recording()
        cls.folder = cls.recording.write(cls.root / "recording")
        cls.map = cls.root / "map.h5"
        cls.run_evpose("map", "import", cls.folder / "contours.ply", "-o", cls.map)

    @classmethod
    def run_evpose(cls, *words, status=0):
        result = subprocess.run([EVPOSE, *map(str, words)], capture_output=True, text=True, timeout=60)
        if result.returncode != status:
            raise AssertionError(f"status {result.returncode}: {result.stderr}{result.stdout}")
        return result

    def test_another_reader_finds_the_points_where_they_were(self):
        with h5py.File(self.map) as file:
            points = file["meta"].attrs["anchor"] + file["points/xyz"][:].astype(float)
        given = self.recording.contours[:, :3]
        order = [np.lexsort(np.round(cloud, 4).T) for cloud in (points, given)]
        self.assertEqual(len(points), len(given))
        self.assertLess(np.abs(points[order[0]] - given[order[1]]).max(), 1e-6)

    def test_every_dataset_has_the_checksum_of_its_content(self):
        with h5py.File(self.map) as file:
            found = datasets(file)
            self.assertLessEqual({"points/xyz", "points/tangent", "contours/start", "contours/count"}, set(found))
            for name, item in found.items():
                content = np.ascontiguousarray(item[()]).astype(item.dtype.newbyteorder("<")).tobytes()
                self.assertEqual(zlib.crc32(content), item.attrs["crc32"], name)

    def test_a_changed_value_is_refused_by_its_name(self):
        damaged = self.root / "damaged.h5"
        damaged.write_bytes(self.map.read_bytes())
        with h5py.File(damaged, "a") as file:
            file["points/tangent"][3, 0] += 0.25
        result = self.run_evpose("map", "info", damaged, status=2)
        self.assertRegex(result.stderr, r"^evpose: .*damaged\.h5.*/points/tangent.*\n$")

    def test_a_damaged_byte_never_crashes(self):
        whole = self.map.read_bytes()
        damaged = self.root / "damaged.h5"
        random = np.random.default_rng(5)
        for place in random.integers(0, len(whole), 60):
            spoilt = bytearray(whole)
            spoilt[place] ^= 0x40
            damaged.write_bytes(spoilt)
            result = subprocess.run([EVPOSE, "map", "info", str(damaged)], capture_output=True, text=True, timeout=60)
            with self.subTest(place=int(place)):
                self.assertIn(result.returncode, (0, 2), result.stderr)
                self.assertLessEqual(result.stderr.count("\n"), 1, result.stderr)

    def test_tracking_with_the_map_file_is_tracking_with_its_contours(self):
        ends = []
        for name, source in (("a", self.folder / "contours.ply"), ("b", self.map)):
            self.run_evpose("track", self.folder, "--map", source, "-o", self.root / name)
            ends.append(np.loadtxt(self.root / name / "trajectory.tum"))
        self.assertEqual(ends[0].shape, ends[1].shape)
        self.assertLess(np.abs(ends[0] - ends[1]).max(), 1e-3)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    EVPOSE = sys.argv.pop(1)
    unittest.main()
