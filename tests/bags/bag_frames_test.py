#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Frames of a ROS 1 bag that ROS's own library wrote come out as pictures: bag_frames_test.py EVPOSE"""
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

try:
    import genpy.dynamic
    import numpy as np
    import rosbag

    import h5py  # noqa: F401: the recording needs it
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "end_to_end"))
from recording import HEIGHT, WIDTH, Recording  # noqa: E402

EVPOSE = None
LINE = "=" * 80
IMAGE = f"""Header header
uint32 height
uint32 width
string encoding
uint8 is_bigendian
uint32 step
uint8[] data
{LINE}
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
"""
STAMPS_NS = [20_000_001, 53_000_000, 86_000_000]


def read_grey8(path):
    """Pixels of a grey PNG of 8 bits, by the format's description."""
    data, at, packed = path.read_bytes(), 8, b""
    while at < len(data):
        (length,) = struct.unpack(">I", data[at:at + 4])
        if data[at + 4:at + 8] == b"IHDR":
            width, height, bits, colour = struct.unpack(">IIBB", data[at + 8:at + 18])
        if data[at + 4:at + 8] == b"IDAT":
            packed += data[at + 8:at + 8 + length]
        at += length + 12
    assert (bits, colour) == (8, 0), (bits, colour)
    rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, width + 1)
    out = np.zeros((height + 1, width + 1), int)  # with a row above and a column before
    for y, row in enumerate(rows.astype(int), 1):
        for x in range(1, width + 1):
            left, above, corner = out[y, x - 1], out[y - 1, x], out[y - 1, x - 1]
            nearest = min((left, above, corner), key=lambda v: abs(left + above - corner - v))
            out[y, x] = (row[x] + (0, left, above, (left + above) // 2, nearest)[row[0]]) % 256
    return out[1:, 1:].astype(np.uint8)


class BagFramesTest(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.root = pathlib.Path(scratch.name)
        Recording().write(self.root / "own")
        self.bag = self.root / "flight.bag"
        self.assertEqual(self.evpose("convert", self.root / "own", self.bag).returncode, 0)
        self.pictures = np.random.default_rng(3).integers(0, 256, (len(STAMPS_NS), HEIGHT, WIDTH), np.uint8)
        self.pictures[1] = np.arange(WIDTH)  # smooth: other filters of rows

    @staticmethod
    def evpose(*words):
        return subprocess.run([EVPOSE, *map(str, words)], capture_output=True, text=True, timeout=60,
                              stdin=subprocess.DEVNULL)

    def add_images(self, encoding, rows):
        kind = genpy.dynamic.generate_dynamic("sensor_msgs/Image", IMAGE)["sensor_msgs/Image"]
        with rosbag.Bag(str(self.bag), "a") as bag:
            for t, picture in zip(STAMPS_NS, rows):
                stamp = genpy.Time(t // 10**9, t % 10**9)
                message = kind(height=HEIGHT, width=WIDTH, encoding=encoding, step=len(picture[0].tobytes()),
                               data=picture.tobytes())
                message.header.stamp = stamp
                bag.write("/cam0/image_raw", message, stamp)

    def converted(self):
        done = self.evpose("convert", self.bag, self.root / "out")
        self.assertEqual(done.returncode, 0, done.stderr)
        return self.root / "out/frames"

    def assert_frames(self, pictures):
        frames = self.converted()
        rows = [line.split(",") for line in (frames / "timestamps.csv").read_text().splitlines() if line[0] != "#"]
        self.assertEqual([int(row[0]) for row in rows], STAMPS_NS)
        for row, picture in zip(rows, pictures):
            np.testing.assert_array_equal(read_grey8(frames / row[1]), picture)

    def test_grey_pictures_come_out_as_they_were(self):
        self.add_images("mono8", self.pictures)
        self.assert_frames(self.pictures)

    def test_rows_may_be_padded(self):
        self.add_images("mono8", np.pad(self.pictures, ((0, 0), (0, 0), (0, 5))))
        self.assert_frames(self.pictures)

    def test_a_bag_without_pictures_has_no_frames(self):
        self.assertFalse(self.converted().exists())


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    EVPOSE = sys.argv.pop(1)
    unittest.main()
