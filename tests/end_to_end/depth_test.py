#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Depth images of known poses become a cloud, and that a map; and what is refused. depth_test.py EVPOSE"""
import pathlib
import re
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

try:
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)

EVPOSE = None
WIDTH, HEIGHT, FOCAL = 240, 180, 200.0
CALIBRATION = f"""cam0:
  camera_model: pinhole
  intrinsics: [{FOCAL}, {FOCAL}, {(WIDTH - 1) / 2}, {(HEIGHT - 1) / 2}]
  distortion_model: radtan
  distortion_coeffs: [0, 0, 0, 0]
  resolution: [{WIDTH}, {HEIGHT}]
"""


def png(pixels, bits=16):
    """Grey levels."""
    def chunk(kind, content):
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
    rows = pixels.astype(">u2" if bits == 16 else "u1")
    content = b"".join(b"\0" + row.tobytes() for row in rows)
    head = struct.pack(">IIBBBBB", pixels.shape[1], pixels.shape[0], bits, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(content)) + chunk(b"IEND", b"")


def looking(eye, target):
    """Axes of a camera, as columns."""
    z = (target - eye) / np.linalg.norm(target - eye)
    x = np.cross(z, [0, 0, 1])
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def quaternion(r):
    """x, y, z, w."""
    w = np.sqrt(max(0, 1 + np.trace(r))) / 2
    return np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], 4 * w * w]) / (4 * w)


def depth_of_corner(eye, axes, random):
    """Metres; floor and two walls of 2 m that meet at the origin, with a depth camera's noise."""
    u, v = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    rays = np.stack([(u - (WIDTH - 1) / 2) / FOCAL, (v - (HEIGHT - 1) / 2) / FOCAL, np.ones_like(u, float)], -1) @ axes.T
    depth = np.full(u.shape, np.inf)
    for axis in range(3):
        with np.errstate(divide="ignore", invalid="ignore"):
            z = -eye[axis] / rays[..., axis]
            on = eye + z[..., None] * rays
        others = [k for k in range(3) if k != axis]
        hit = (z > 0) & (on[..., others] >= 0).all(-1) & (on[..., others] <= 2).all(-1)
        depth = np.where(hit & (z < depth), z, depth)
    depth[~np.isfinite(depth)] = 0
    return np.where(depth > 0, depth + (0.0015 + 0.0025 * depth**2) * random.normal(size=depth.shape), 0)


class DepthTest(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.root = pathlib.Path(scratch.name)
        self.folder = self.root / "images"
        (self.folder / "depth").mkdir(parents=True)
        (self.root / "calibration.yaml").write_text(CALIBRATION)
        self.cloud = self.root / "cloud.ply"
        self.images(3)

    def images(self, count, units_per_m=1000):
        random = np.random.default_rng(1)
        rows, poses = ["# depth images", "# timestamp filename"], []
        for k in range(count):
            turn = 0.4 + 0.8 * k / max(1, count - 1)
            eye = np.array([2.2 * np.cos(turn), 2.2 * np.sin(turn), 1.1 + 0.25 * (k % 3)])
            axes = looking(eye, np.array([0.3, 0.3, 0.4]))
            depth = depth_of_corner(eye, axes, random)
            (self.folder / f"depth/{k}.png").write_bytes(png(np.round(units_per_m * depth)))
            rows.append(f"{100 + 0.1 * k:.6f} depth/{k}.png")
            for t in (-0.001, 0, 0.001):
                poses.append(f"{100 + 0.1 * k + t:.6f} " + " ".join(map(str, [*eye, *quaternion(axes)])))
        (self.folder / "depth.txt").write_text("\n".join(rows) + "\n")
        (self.root / "poses.tum").write_text("\n".join(poses) + "\n")

    def run_depth(self, *more, folder=None):
        return subprocess.run([EVPOSE, "map", "depth", str(folder or self.folder), "--poses", str(self.root / "poses.tum"),
                               "--calibration", str(self.root / "calibration.yaml"), "-o", str(self.cloud), *more],
                              capture_output=True, text=True, timeout=120)

    def points(self):
        content = self.cloud.read_bytes()
        start = content.index(b"end_header\n") + 11
        kind = [("p", "<f8", 3), ("sigma", "<f4"), ("observations", "<u4")]
        return np.frombuffer(content[start:], kind)

    def refused(self, *says, more=(), folder=None):
        self.cloud.write_text("of an earlier run")
        before = sorted(self.root.rglob("*"))
        result = self.run_depth(*more, folder=folder)
        self.assertEqual(result.returncode, 2, result.stderr + result.stdout)
        self.assertEqual(result.stderr.count("\n"), 1, f"not one line: {result.stderr!r}")
        self.assertRegex(result.stderr, r"^evpose: .+: .+; .+\n$", "WHERE: WHAT; FIX")
        for expression in says:
            self.assertRegex(result.stderr, expression)
        self.assertEqual(self.cloud.read_text(), "of an earlier run")
        self.assertEqual(sorted(self.root.rglob("*")), before, "left behind")

    def test_a_corner_becomes_a_cloud_and_a_map_with_its_three_creases(self):
        self.images(10, units_per_m=5000)
        result = self.run_depth("--scale", "5000")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertRegex(result.stdout, r"images +10; 0 left out")
        points = self.points()
        off = np.abs(points["p"]).min(1)
        self.assertGreater(len(points), 20000)
        self.assertLess(np.median(off / points["sigma"]), 1)
        again = self.cloud.read_bytes()
        self.assertEqual(self.run_depth("--scale", "5000", "--threads", "1").returncode, 0)
        self.assertEqual(self.cloud.read_bytes(), again, "differs with the number of threads")

        # The line that is printed builds the map.
        command = re.search(r"next +evpose (map build .*)", result.stdout)[1].split()
        built = subprocess.run([EVPOSE, *command, "-o", str(self.root / "map.h5")], capture_output=True, text=True, timeout=120)
        self.assertEqual(built.returncode, 0, built.stderr)
        self.assertGreater(float(re.search(r"creases +([\d.]+) m", built.stdout)[1]), 4)

    def test_images_without_a_pose_are_counted(self):
        rows = (self.root / "poses.tum").read_text().splitlines()
        (self.root / "poses.tum").write_text("\n".join(rows[3:]) + "\n")
        result = self.run_depth()
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertRegex(result.stdout, r"images +2; 1 left out")

    def test_poses_of_another_body(self):
        self.assertEqual(self.run_depth().returncode, 0)
        plain = self.points()["p"]
        shifted = self.run_depth("--T-body-cam", "0,0,0,0,0,0,1")
        self.assertEqual(shifted.returncode, 0, shifted.stderr)
        self.assertEqual(self.points()["p"].tolist(), plain.tolist())
        self.refused("calibration.yaml", "where the IMU sits", more=["--imu-poses"])
        self.refused("--T-body-cam", "3 numbers", more=["--T-body-cam", "1,2,3"])

    def test_folders_that_hold_no_images(self):
        empty = self.root / "empty"
        empty.mkdir()
        self.refused("empty: holds no depth.txt", folder=empty)
        self.refused("nowhere: is no folder", folder=self.root / "nowhere")
        (empty / "depth.txt").write_text("# nothing\n")
        self.refused("depth.txt: lists no depth images", folder=empty)

    def test_images_that_are_missing_or_of_another_kind(self):
        image = self.folder / "depth/1.png"
        sound = image.read_bytes()
        image.unlink()
        self.refused(r"depth.txt:4: the depth image 'depth/1.png' is not there")
        image.write_bytes(png(np.zeros((HEIGHT, WIDTH)), bits=8))
        self.refused(r"1.png: is no PNG of one channel of 16 bits")
        image.write_bytes(sound[:2000])
        self.refused(r"1.png: is no PNG picture, or a damaged one")
        image.write_bytes(png(np.zeros((HEIGHT // 2, WIDTH))))
        self.refused(rf"1.png: is {WIDTH} x {HEIGHT // 2}, the calibration {WIDTH} x {HEIGHT}")

    def test_poses_of_another_time(self):
        rows = [row.replace("100.", "900.") for row in (self.root / "poses.tum").read_text().splitlines()]
        (self.root / "poses.tum").write_text("\n".join(row for row in rows if row.startswith("900.")) + "\n")
        self.refused("poses.tum: no depth image has a pose: images from 100 to 100.2 s, poses from 900", "clocks")

    def test_settings_that_mean_nothing(self):
        self.refused("--scale: 0 is no number", more=["--scale", "0"])
        self.refused("--voxel: 0 m", more=["--voxel", "0"])
        self.refused("--range: 0 m", more=["--range", "0"])
        self.refused("--range: inf m", more=["--range", "inf"])
        self.refused("--noise: ", more=["--noise", "0.001"])
        self.refused("--noise: ", more=["--noise", "inf,0"])
        self.refused("no pixel has a depth", more=["--scale", "1000000"])


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    EVPOSE = sys.argv.pop()
    unittest.main(verbosity=2)
