#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Clouds that no map can be made of, and those that only need a word. clouds_test.py EVPOSE

Refusals: one clear line, exit status 2, the map of an earlier build untouched. Warnings: one line, and the map is made.
"""
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest

try:
    import h5py
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)

EVPOSE = None
NOISE_M = 0.01


def corner(scale=1.0, per_m2=2500):
    """Floor and two walls of 1.5 m that meet at the origin."""
    random = np.random.default_rng(1)
    faces = []
    for axis in range(3):
        face = random.uniform(0, 1.5, (int(per_m2 * 2.25), 3))
        face[:, axis] = random.normal(0, NOISE_M, len(face))
        faces.append(face)
    return scale * np.concatenate(faces)


def ply(points, count=None):
    count = len(points) if count is None else count
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    return header.encode() + np.asarray(points, "<f4").tobytes()


def pcd(points, count=None):
    count = len(points) if count is None else count
    header = f"VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {count}\nHEIGHT 1\n"
    return (header + f"POINTS {count}\nDATA binary\n").encode() + np.asarray(points, "<f4").tobytes()


class CloudsTest(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.root = pathlib.Path(scratch.name)
        self.map = self.root / "map.h5"
        self.map.write_text("of an earlier build")

    def command(self, content, name, *more):
        (self.root / name).write_bytes(content)
        return [EVPOSE, "map", "build", str(self.root / name), "-o", str(self.map), *more]

    def build(self, content, name, *more):
        return subprocess.run(self.command(content, name, *more), capture_output=True, text=True, timeout=60)

    def refused(self, content, *says, name="cloud.ply"):
        result = self.build(content, name)
        self.assertEqual(result.returncode, 2, result.stderr + result.stdout)
        self.assertEqual(result.stderr.count("\n"), 1, f"not one line: {result.stderr!r}")
        self.assertRegex(result.stderr, r"^evpose: .+: .+; .+\n$", "WHERE: WHAT; FIX")
        for expression in (re.escape(name), *says):
            self.assertRegex(result.stderr, re.compile(expression, re.IGNORECASE))
        self.unharmed(name)

    def unharmed(self, name):
        self.assertEqual(self.map.read_text(), "of an earlier build")
        self.assertEqual({path.name for path in self.root.iterdir()}, {"map.h5", name}, "left behind")

    def made(self, content, *warnings, name="cloud.ply"):
        """Builds; stderr must be one line for each expression, and that a corner alone tells no pose."""
        result = self.build(content, name)
        self.assertEqual(result.returncode, 0, result.stderr)
        *lines, verdict = result.stderr.splitlines()
        self.assertRegex(verdict, r"a pose is told to 15 mm in 0 % of the volume only")
        self.assertEqual(len(lines), len(warnings), result.stderr)
        for line, expression in zip(lines, warnings):
            self.assertRegex(line, re.compile(expression, re.IGNORECASE))
        with h5py.File(self.map) as file:
            return file["meta"].attrs["anchor"] + file["points/xyz"][:].astype(float)

    # The control: without it every refusal below could be for a reason of its own.

    def test_a_healthy_cloud_makes_a_map(self):
        for name, content in (("cloud.ply", ply(corner())), ("cloud.pcd", pcd(corner()))):
            points = self.made(content, name=name)
            on_edges = np.sort(np.abs(points), axis=1)[:, 1] < 0.01
            self.assertGreater(on_edges.mean(), 0.3)

    def test_no_points(self):
        self.refused(b"", "empty")
        self.refused(ply(np.zeros((0, 3))), "empty")
        self.refused(ply(np.zeros((3, 3))), "only 1 different point")

    def test_points_on_one_line(self):
        along = np.linspace(0, 5, 4000)[:, None]
        self.refused(ply(along * [1.0, 0.5, 0.2]), "on lines")

    def test_one_point_again_and_again(self):
        self.refused(ply(np.tile([1.0, 2.0, 3.0], (4000, 1))), "only 1 different point")

    def test_no_point_is_finite(self):
        self.refused(ply(np.full((4000, 3), np.nan)), "no point is finite")
        self.refused(ply(np.full((4000, 3), np.inf)), "no point is finite")

    def test_points_that_are_not_finite_are_counted_and_left_out(self):
        points = corner()
        points[5] = np.nan
        points[70] = np.inf
        points[900, 1] = -np.inf
        with_them = self.made(ply(points), f"3 of {len(points)} points are not finite")
        without = self.made(ply(np.delete(points, [5, 70, 900], axis=0)))
        self.assertTrue(np.array_equal(with_them, without))

    def test_far_points(self):
        points = corner()
        points[7] = 1e9
        self.refused(ply(points), "point 7", "10000000 m")

    def test_other_units_are_warned_of(self):
        # A few metres, told in millimetres: more than any scene. A corner in kilometres: a speck.
        result = self.build(ply(corner(scale=1e4)), "cloud.ply")
        self.assertRegex(result.stderr, r"15\d\d\d.* m across.*millimetres")
        result = self.build(ply(corner(scale=1e-3)), "cloud.ply")
        self.assertRegex(result.stderr, "only 0.00.* m across.*kilometres")

    def test_centimetres_are_told_by_the_noise(self):
        # 150 "metres" could be a yard, but points that lie a metre off their surfaces are no scanner's.
        result = self.build(ply(corner(scale=100)), "cloud.ply")
        self.assertRegex(result.stderr, r"noise of (9|10)\d\d mm.*centimetres")

    def test_duplicates_change_nothing(self):
        points = corner()
        once = self.made(ply(points))
        self.assertTrue(np.array_equal(once, self.made(ply(np.concatenate([points, points[:3000]])))))

    def test_too_sparse_for_planes(self):
        random = np.random.default_rng(2)
        self.refused(ply(random.uniform(0, 8, (3000, 3))), "no surface|no plane|no contour", "denser")

    def test_truncated_files(self):
        for name, content in (("cloud.ply", ply(corner())), ("cloud.pcd", pcd(corner()))):
            for share in (0.01, 0.5, 0.999):
                self.refused(content[:int(share * len(content))], "bytes", name=name)
                (self.root / name).unlink()

    def test_headers_that_lie(self):
        few = corner()[:10]
        for name, content in (("cloud.ply", ply(few, 10**12)), ("cloud.pcd", pcd(few, 10**12))):
            self.refused(content, "bytes|1000000000000|WIDTH", name=name)
            (self.root / name).unlink()

    def test_other_files(self):
        self.refused(b"hello, here are no points\n" * 100, "neither PLY, PCD nor LAS", name="cloud.txt")

    def test_a_column_is_recorded_and_told(self):
        random = np.random.default_rng(3)
        angle, height = random.uniform(0, 2 * np.pi, 8000), random.uniform(0, 1.5, 8000)
        radius = 0.15 + random.normal(0, NOISE_M, 8000)
        column = np.stack([0.8 + radius * np.cos(angle), 0.8 + radius * np.sin(angle), height], axis=1)
        self.made(ply(np.concatenate([corner(), column])))
        with h5py.File(self.map) as file:
            sigma = file["contours/sigma"][:][file["contours/kind"][:] == 4]
        self.assertEqual(len(sigma), 1)
        self.assertAlmostEqual(float(sigma[0]), 0.15, delta=0.005)
        said = subprocess.run([EVPOSE, "map", "info", str(self.map)], capture_output=True, text=True, check=True).stdout
        self.assertRegex(said, r"cylinder_axis +1\.[345] m, view-dependent")

    def test_view_points_are_places(self):
        content = ply(corner())
        result = self.build(content, "cloud.ply", "--viewpoint", "1,2")
        self.assertEqual(result.returncode, 2)
        self.assertRegex(result.stderr, r"^evpose: --viewpoint: has 2 numbers in all; .+\n$")
        result = self.build(content, "cloud.ply", "--viewpoint", "-1,2,3", "--viewpoint", "1,1,1")
        self.assertEqual(result.returncode, 0, result.stderr)

    def test_an_interruption_writes_nothing(self):
        points = np.concatenate([corner(per_m2=20000) + [4.0 * k, 0, 0] for k in range(5)])
        process = subprocess.Popen(self.command(ply(points), "cloud.ply", "--threads", "1"), stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
        time.sleep(1.0)
        self.assertIsNone(process.poll(), "ended before it could be interrupted: give it more points")
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(timeout=60), 130)
        self.unharmed("cloud.ply")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    EVPOSE = sys.argv.pop()
    unittest.main(verbosity=2)
