#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of a simulated landing: landing_pictures.py RECORDING OUT

RECORDING was made with frames, e.g. by
  evpose simulate landing -o RECORDING --duration 3 --set camera.size=vga --set frames.rate_hz=30
Writes OUT/landing_strip.png (grey pictures over the events of the same moment) and OUT/landing_events.png, an animated
PNG of the events.
"""
import pathlib
import struct
import sys
import zlib

import h5py
import numpy as np

STRIP = 6  # moments
EVENTS_S = 0.01  # shown at a moment
FRAMES_A_SECOND = 15
WHITE, RED, BLUE = 0, 1, 2
PALETTE = bytes((255, 255, 255, 214, 39, 40, 31, 99, 180, 0, 0, 0))


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def header(width, height, depth, colour):
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0))


def read_grey(path):
    """An 8-bit grey PNG, as the simulator writes them."""
    data = path.read_bytes()
    at, packed = 8, b""
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + size]
        if kind == b"IHDR":
            width, height = struct.unpack(">II", body[:8])
        if kind == b"IDAT":
            packed += body
        at += size + 12
    raw = zlib.decompress(packed)
    rows, above = [], [0] * width
    for y in range(height):
        line = raw[y * (width + 1):(y + 1) * (width + 1)]
        way, row, left, corner = line[0], list(line[1:]), 0, 0
        for x in range(width):
            up = above[x]
            if way == 1:
                guess = left
            elif way == 2:
                guess = up
            elif way == 3:
                guess = (left + up) // 2
            elif way == 4:
                p, q, r = abs(up - corner), abs(left - corner), abs(left + up - 2 * corner)
                guess = left if p <= q and p <= r else up if q <= r else corner
            else:
                guess = 0
            left = row[x] = (row[x] + guess) & 255
            corner = up
        rows.append(row)
        above = row
    return np.array(rows, np.uint8)


class Events:
    def __init__(self, folder):
        with h5py.File(folder / "events.h5") as file:
            self.t, self.x, self.y, self.p = (file[f"events/{name}"][:] for name in "txyp")
            self.size = int(file.attrs["height"]), int(file.attrs["width"])

    def image(self, end_s, half):
        """Palette numbers; at half the size where `half`."""
        first, last = np.searchsorted(self.t, [(end_s - EVENTS_S) * 1e6, end_s * 1e6])
        step = 2 if half else 1
        image = np.full((self.size[0] // step, self.size[1] // step), WHITE, np.uint8)
        y, x = self.y[first:last] // step, self.x[first:last] // step
        inside = (y < image.shape[0]) & (x < image.shape[1])
        image[y[inside], x[inside]] = np.where(self.p[first:last][inside] == 1, RED, BLUE)
        return image


def halved(grey):
    grey = grey[:grey.shape[0] // 2 * 2, :grey.shape[1] // 2 * 2].astype(np.uint16)
    return ((grey[::2, ::2] + grey[1::2, ::2] + grey[::2, 1::2] + grey[1::2, 1::2]) // 4).astype(np.uint8)


def write_strip(path, folder, events):
    stamps = [line.split(",") for line in (folder / "frames/timestamps.csv").read_text().splitlines()[1:]]
    picked = [stamps[round(i * (len(stamps) - 1) / (STRIP - 1))] for i in range(STRIP)]
    colours = np.frombuffer(PALETTE, np.uint8).reshape(4, 3)
    columns = []
    for stamp, name, _ in picked:
        grey = halved(read_grey(folder / "frames" / name))
        seen = events.image(int(stamp) * 1e-9, True)[:grey.shape[0], :grey.shape[1]]
        columns.append(np.vstack([np.repeat(grey[:, :, None], 3, axis=2), colours[seen]]))
    gap = np.full((columns[0].shape[0], 4, 3), 255, np.uint8)
    strip = np.hstack([part for column in columns for part in (column, gap)][:-1])
    rows = b"".join(b"\0" + row.tobytes() for row in strip)
    path.write_bytes(header(strip.shape[1], strip.shape[0], 8, 2) + chunk(b"IDAT", zlib.compress(rows, 9)) +
                     chunk(b"IEND", b""))


def packed_rows(image):
    """Two bits a pixel."""
    width = (image.shape[1] + 3) // 4 * 4
    full = np.zeros((image.shape[0], width), np.uint8)
    full[:, :image.shape[1]] = image
    quads = full.reshape(image.shape[0], -1, 4)
    rows = quads[:, :, 0] << 6 | quads[:, :, 1] << 4 | quads[:, :, 2] << 2 | quads[:, :, 3]
    return zlib.compress(b"".join(b"\0" + row.tobytes() for row in rows), 9)


def write_animation(path, events):
    length_s = events.t[-1] * 1e-6
    times = np.arange(EVENTS_S, length_s, 1 / FRAMES_A_SECOND)
    height, width = events.image(times[0], True).shape
    out, number = header(width, height, 2, 3) + chunk(b"PLTE", PALETTE), 0
    out += chunk(b"acTL", struct.pack(">II", len(times), 0))
    for k, t in enumerate(times):
        out += chunk(b"fcTL", struct.pack(">IIIIIHHBB", number, width, height, 0, 0, 1, FRAMES_A_SECOND, 0, 0))
        number += 1
        rows = packed_rows(events.image(t, True))
        if k == 0:
            out += chunk(b"IDAT", rows)
        else:
            out += chunk(b"fdAT", struct.pack(">I", number) + rows)
            number += 1
    path.write_bytes(out + chunk(b"IEND", b""))


if len(sys.argv) != 3:
    sys.exit(__doc__)
recording, target = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
target.mkdir(parents=True, exist_ok=True)
seen = Events(recording)
write_strip(target / "landing_strip.png", recording, seen)
write_animation(target / "landing_events.png", seen)
