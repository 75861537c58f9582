#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The map file as another program reads it, checksums and all. map_file_test.py EVPOSE"""
import pathlib
import re
import struct
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


def box_cloud(seed=1, noise_m=0.01):
    """Points of the floor and of a box on it, and the twelve edges that a scan of them tells."""
    random = np.random.default_rng(seed)

    def face(corner, a, b, per_m2=3000):
        corner, a, b = map(np.array, (corner, a, b))
        normal = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
        n = int(per_m2 * np.linalg.norm(np.cross(a, b)))
        return corner + random.random((n, 1)) * a + random.random((n, 1)) * b + noise_m * random.normal(size=(n, 1)) * normal

    hull = [face((0, 0, 0), (2., 0, 0), (0, 2., 0)), face((0, 0, 0), (2., 0, 0), (0, 0, 1.5)),
            face((0, 0, 0), (0, 2., 0), (0, 0, 1.5))]
    return np.concatenate(hull).astype("<f4")


def write_ply(path, points):
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    path.write_bytes(header.encode() + points.astype("<f4").tobytes())


def write_las(path, points):
    """LAS 1.2, points of format 0, millimetres."""
    header = bytearray(227)
    header[:4] = b"LASF"
    header[24:26] = bytes([1, 2])
    struct.pack_into("<H", header, 94, 227)
    struct.pack_into("<I", header, 96, 227)
    struct.pack_into("<BHI", header, 104, 0, 20, len(points))
    struct.pack_into("<6d", header, 131, 1e-4, 1e-4, 1e-4, 0, 0, 0)
    rows = np.zeros(len(points), dtype=[("xyz", "<i4", 3), ("rest", "u1", 8)])
    rows["xyz"] = np.round(points.astype(float) * 1e4)
    path.write_bytes(bytes(header) + rows.tobytes())


class MapBuildTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.root = pathlib.Path(scratch.name)
        cls.points = box_cloud()
        write_ply(cls.root / "cloud.ply", cls.points)
        cls.said = MapFileTest.run_evpose("map", "build", cls.root / "cloud.ply", "-o", cls.root / "map.h5").stdout

    def test_an_index_tells_what_is_seen_from_places_the_same_each_time(self):
        once, again = self.root / "indexed.h5", self.root / "again.h5"
        said = MapFileTest.run_evpose("map", "index", self.root / "map.h5", "-o", once).stdout
        MapFileTest.run_evpose("map", "index", once, "-o", again)
        with h5py.File(once) as file, h5py.File(self.root / "map.h5") as plain, h5py.File(again) as second:
            self.assertEqual(set(datasets(file)), set(datasets(second)))
            self.assertLessEqual(set(datasets(plain)), set(datasets(file)))
            for name, item in datasets(plain).items():
                np.testing.assert_allclose(item[()], file[name][()], 1e-5, 1e-6, err_msg=name)
            for name in file["places"]:
                np.testing.assert_array_equal(file["places"][name][()], second["places"][name][()], name)
            looked_at = file["places/looked_at"][:]
            places = looked_at[looked_at != 2**32 - 1].astype(int)
            self.assertRegex(said, f" {len(places)} places ")
            self.assertEqual(len(file["places/seen"]), ((places + 7) // 8).sum())
            low, high = file["places/box"][:]
            xyz = file["meta"].attrs["anchor"] + file["points/xyz"][:].astype(float)
            self.assertTrue((low < xyz.min(axis=0)).all() and (high > xyz.max(axis=0)).all())

    def refused(self, path, *says):
        result = MapFileTest.run_evpose("-q", "map", "build", path, "-o", self.root / "none.h5", status=2)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        self.assertFalse((self.root / "none.h5").exists())
        for words in says:
            self.assertRegex(result.stderr, words)

    def test_five_lines_of_h5py_read_contours_and_planes(self):
        with h5py.File(self.root / "map.h5") as file:
            xyz = file["meta"].attrs["anchor"] + file["points/xyz"][:]
            kind, length = file["contours/kind"][:], file["contours/length"][:]
            normals, inliers = file["planes/normal"][:], file["planes/inliers"][:]
        self.assertEqual(len(normals), 3)
        self.assertGreater(inliers.min(), 5000)
        # Three creases meet in the corner.
        self.assertAlmostEqual(length[kind == 1].sum(), 2 + 2 + 1.5, delta=0.2)
        self.assertLess(np.sort(np.abs(xyz), axis=1)[:, 0].max(), 0.02)

    def test_the_build_tells_where_a_pose_can_be_told_and_what_it_wrote(self):
        verdict = re.search(r"verdict +a pose is told to 5 mm in (\d+) % .* 15 mm in (\d+) %, to 50 mm in (\d+) %", self.said)
        self.assertTrue(verdict, self.said)
        shares = [int(share) for share in verdict.groups()]
        self.assertEqual(shares, sorted(shares))
        self.assertRegex(self.said, rf"output +{re.escape(str(self.root / 'map.h5'))};")

    def test_las_gives_the_map_of_the_same_points(self):
        points = np.round(self.points.astype(float), 4)
        write_las(self.root / "cloud.las", points)
        write_ply(self.root / "rounded.ply", points)
        maps = []
        for name in ("cloud.las", "rounded.ply"):
            MapFileTest.run_evpose("map", "build", self.root / name, "-o", self.root / "las.h5")
            with h5py.File(self.root / "las.h5") as file:
                maps.append(file["meta"].attrs["anchor"] + file["points/xyz"][:].astype(float))
        self.assertEqual(maps[0].shape, maps[1].shape)
        # The last bit of a coordinate decides between neighbours equally far away, and those are a part of all: far
        # below the noise of the points, but not nothing.
        off = np.abs(maps[0] - maps[1]).max(axis=1)
        self.assertLess(np.median(off), 1e-3)
        self.assertLess(off.max(), 5e-3)

    def test_exports_hold_the_contours(self):
        for name in ("out.ply", "out.obj", "out.svg"):
            MapFileTest.run_evpose("map", "export", self.root / "map.h5", "-o", self.root / name)
        with h5py.File(self.root / "map.h5") as file:
            count, outlines = len(file["points/xyz"]), len(file["polygons/start"])
        self.assertIn(f"element vertex {count}\n".encode(), (self.root / "out.ply").read_bytes())
        obj = (self.root / "out.obj").read_text().splitlines()
        vertices = sum(line.startswith("v ") for line in obj)
        self.assertGreaterEqual(vertices, 2 * count)
        for line in obj:
            if line.startswith("l "):
                self.assertLessEqual(max(map(int, line.split()[1:])), vertices)
        self.assertGreaterEqual(sum(line.startswith("l ") for line in obj), count + outlines)
        self.assertIn("<svg", (self.root / "out.svg").read_text()[:200])
        self.assertRegex(MapFileTest.run_evpose("map", "export", self.root / "map.h5", "-o", self.root / "out.dxf",
                                                status=2).stderr, "out.dxf.*ply.*obj.*svg")

    def test_a_map_compared_with_itself_is_without_error(self):
        table = MapFileTest.run_evpose("map", "compare", self.root / "map.h5", self.root / "map.h5").stdout
        row = next(line.split() for line in table.splitlines() if line.startswith("all"))
        self.assertEqual(row[3:7], ["100.0"] * 4)
        self.assertEqual(row[7], "0.00")

    def test_the_papers_map_is_outlines_of_the_same_planes(self):
        built = self.root / "paper.h5"
        MapFileTest.run_evpose("map", "build", self.root / "cloud.ply", "--preset", "paper", "-o", built)
        with h5py.File(built) as file:
            kind, length, normals = file["contours/kind"][:], file["contours/length"][:], file["planes/normal"][:]
            xyz = file["meta"].attrs["anchor"] + file["points/xyz"][:]
        self.assertEqual(len(normals), 3)
        self.assertEqual(set(kind), {2})
        # Each of three faces has its own line around it.
        self.assertAlmostEqual(length.sum(), 2 * (4 + 3.5 + 3.5), delta=3)
        self.assertLess(np.median(np.sort(np.abs(xyz), axis=1)[:, 0]), 0.02)
        for words, says in ((("--preset", "papers"), "known: paper"), (("--preset", "paper", "--set", "noise=0.01"), "--set"),
                            (("--preset", "paper", "--viewpoint", "0,0,0"), "--viewpoint"),
                            (("--preset", "paper", "--plan", str(self.root / "tiles")), "--plan")):
            result = MapFileTest.run_evpose("map", "build", self.root / "cloud.ply", "-o", self.root / "none.h5", *words,
                                            status=2)
            self.assertRegex(result.stderr, rf"^evpose: .*{says}.*\n$")
            self.assertFalse((self.root / "none.h5").exists())

    def test_what_is_no_cloud_is_told_in_one_line(self):
        bad = self.root / "bad.ply"
        write_ply(bad, self.points[:0])
        self.refused(bad, "bad.ply", "no points|points")
        write_ply(bad, np.outer(np.linspace(0, 1, 500), [1, 2, 3]))
        self.refused(bad, "lines")
        write_ply(bad, np.full((500, 3), np.nan))
        self.refused(bad, "no point is finite")
        write_ply(bad, np.tile(self.points[:20], (100, 1)))
        self.refused(bad, "points|lines|flat")
        write_ply(bad, np.random.default_rng(3).random((400, 3)) * 20)
        self.refused(bad, "flat|plane|sparse")
        whole = (self.root / "cloud.ply").read_bytes()
        bad.write_bytes(whole[:len(whole) // 2])
        self.refused(bad, "bad.ply", "truncated|bytes")
        bad.write_bytes(whole.replace(str(len(self.points)).encode(), b"1000000000000", 1))
        self.refused(bad, "bad.ply", "1000000000000|promises|bytes")
        pcd = self.root / "bad.pcd"
        pcd.write_bytes(b"VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 9\nHEIGHT 1\n"
                        b"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 9\nDATA binary\n" + bytes(30))
        self.refused(pcd, "bad.pcd", "bytes|truncated")

    def test_centimetres_and_stray_values_are_warned_of(self):
        stray = np.concatenate([self.points, [[np.nan, 0, 0], [np.inf, 1, 1]], self.points[:50]])
        write_ply(self.root / "stray.ply", stray)
        warned = MapFileTest.run_evpose("map", "build", self.root / "stray.ply", "-o", self.root / "stray.h5").stderr
        self.assertRegex(warned, r"\b2\b.*finite|finite.*\b2\b")
        write_ply(self.root / "cm.ply", 3000 * self.points)  # a hall of 60 m in centimetres
        told = subprocess.run([EVPOSE, "map", "build", str(self.root / "cm.ply"), "-o", str(self.root / "cm.h5")],
                              capture_output=True, text=True, timeout=60).stderr
        self.assertRegex(told, "metres")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    EVPOSE = sys.argv.pop(1)
    unittest.main()
