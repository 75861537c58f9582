#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A run as a film: render_test.py EVPOSE"""
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

try:
    import h5py  # noqa: F401: the recordings need it
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)

from recording import HEIGHT, WIDTH, Recording

EVPOSE = sys.argv[1]
SCALE = 4  # small images are enlarged to 640 px


def read_png(path):
    """Rows of red, green, blue; of pictures without interlace."""
    data, at, packed = path.read_bytes(), 8, b""
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        if kind == b"IHDR":
            width, height = struct.unpack(">II", data[at + 8:at + 16])
        if kind == b"IDAT":
            packed += data[at + 8:at + 8 + length]
        at += 12 + length
    rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, 1 + 3 * width)
    above, out = [0] * (3 * width + 3), []
    for kind, *row in rows.tolist():
        line = [0, 0, 0]  # one pixel to the left of the image
        for x, value in enumerate(row):
            a, b, c = line[x], above[x + 3], above[x]
            if kind == 4:  # whichever of the three is nearest to a + b - c
                guess = min((abs(b - c), 0, a), (abs(a - c), 1, b), (abs(a + b - 2 * c), 2, c))[2]
            else:
                guess = (0, a, b, (a + b) // 2)[kind]
            line.append((value + guess) % 256)
        above = line
        out.append(line[3:])
    return np.array(out).reshape(height, width, 3)


class RenderTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.root = pathlib.Path(scratch.name)
        folder = Recording().write(cls.root / "recording")
        subprocess.run([EVPOSE, "track", folder, "-o", cls.root / "run"], check=True, capture_output=True, timeout=60)

    def render(self, output, *more, status=0, **how):
        done = subprocess.run([EVPOSE, "render", self.root / "run", "-o", self.root / output, *more], timeout=60,
                              capture_output=True, text=True, **how)
        self.assertEqual(done.returncode, status, done.stderr)
        return done.stderr if status else done.stdout

    def test_pictures_show_events_map_and_words(self):
        self.assertIn("4 pictures", self.render("frames", "--fps", "10", "--start", "0.1", "--duration", "0.3"))
        files = sorted((self.root / "frames").iterdir())
        self.assertEqual([f.name for f in files], [f"frame_{k:05d}.png" for k in range(4)])
        pixels = read_png(files[0])
        self.assertEqual(pixels.shape, (max(480, SCALE * HEIGHT), SCALE * WIDTH + 400, 3))
        overlay, panel = pixels[:SCALE * HEIGHT, :SCALE * WIDTH], pixels[:, SCALE * WIDTH:]
        red, green, blue = np.moveaxis(overlay, -1, 0)
        self.assertGreater(((red > 150) & (blue < 120)).sum(), 100, "on events")
        self.assertGreater(((blue > 150) & (red < 120)).sum(), 100, "off events")
        self.assertGreater(((green > 120) & (red < 60) & (blue < 100)).sum(), 100, "matched points")
        self.assertGreater((panel[:200].max(axis=-1) < 100).sum(), 500, "words")
        self.assertGreater((panel[-40:].min(axis=-1) < 60).sum(), 500, "health over time")
        self.assertNotEqual(files[0].read_bytes(), files[3].read_bytes())

    def test_films_are_what_ffmpeg_takes_them_for_and_the_same_each_time(self):
        if shutil.which("ffmpeg") is None:
            self.skipTest("no ffmpeg: scripts/packages.sh test")
        for name, codec in (("film.mp4", "h264"), ("film.gif", "gif")):
            with self.subTest(name):
                self.assertIn("pictures", self.render(name, "--speed", "0.5"))
                first = (self.root / name).read_bytes()
                self.render(name, "--speed", "0.5")
                self.assertEqual((self.root / name).read_bytes(), first)
                told = subprocess.run(["ffprobe", "-v", "error", "-count_frames", "-show_entries",
                                       "stream=codec_name,width,height,nb_read_frames", "-of", "csv=p=0",
                                       self.root / name], capture_output=True, text=True, check=True).stdout
                kind, width, height, count = told.strip().split(",")
                self.assertEqual((kind, int(width), int(height)), (codec, SCALE * WIDTH + 400, SCALE * HEIGHT))
                self.assertAlmostEqual(int(count), 0.6 / 0.5 * 25, delta=2)

    def test_without_ffmpeg_one_line_says_what_to_install(self):
        said = self.render("none.mp4", status=2, env={**os.environ, "PATH": "/nowhere"})
        self.assertRegex(said, r"^evpose: ffmpeg: is not installed; install the package ffmpeg, or .*folder.*\n$")
        self.assertEqual([p for p in self.root.iterdir() if p.name.startswith("none")], [])

    def test_what_cannot_be_drawn_is_refused_and_leaves_nothing(self):
        before = sorted(self.root.iterdir())
        self.assertRegex(self.render("late.mp4", "--start", "99", status=2), r"--start: 99 s lies after the end")
        (self.root / "recording").rename(self.root / "away")
        try:
            self.assertRegex(self.render("gone", status=2), r"^evpose: .+: no such .+; .+\n$")
        finally:
            (self.root / "away").rename(self.root / "recording")
        self.assertEqual(sorted(self.root.iterdir()), before)
        done = subprocess.run([EVPOSE, "render", self.root / "recording", "-o", self.root / "x"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 2)
        self.assertRegex(done.stderr, r"^evpose: .*recording: is no run folder: .+; .+\n$")


if __name__ == "__main__":
    sys.argv = sys.argv[:1]
    unittest.main()
