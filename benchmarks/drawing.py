# SPDX-License-Identifier: BSD-3-Clause
"""Pictures without a plotting library: SVG, and PNG read and written."""
import struct
import zlib

import numpy as np

INK, GRID = "#22262b", "#bbb"


class Svg:
    """A picture in the making, on white."""

    def __init__(self, width, height):
        self.parts = [f"<svg xmlns='http://www.w3.org/2000/svg' width='{width}' height='{height}' "
                      f"viewBox='0 0 {width} {height}' font-family='sans-serif' font-size='12' fill='{INK}'>",
                      "<rect width='100%' height='100%' fill='white'/>"]

    def text(self, x, y, words, anchor="start", size=12, fill=INK):
        words = words.replace("&", "&amp;").replace("<", "&lt;")
        self.parts.append(f"<text x='{x:.1f}' y='{y:.1f}' text-anchor='{anchor}' font-size='{size}' fill='{fill}'>{words}"
                          "</text>")

    def bar(self, x, y, width, height, fill):
        self.parts.append(f"<rect x='{x:.1f}' y='{y:.1f}' width='{width:.1f}' height='{height:.1f}' fill='{fill}'/>")

    def frame(self, x, y, width, height):
        self.parts.append(f"<rect x='{x:.1f}' y='{y:.1f}' width='{width:.1f}' height='{height:.1f}' fill='none' "
                          "stroke='#888'/>")

    def line(self, x1, y1, x2, y2, stroke=GRID, dashes=""):
        dashes = f" stroke-dasharray='{dashes}'" if dashes else ""
        self.parts.append(f"<line x1='{x1:.1f}' y1='{y1:.1f}' x2='{x2:.1f}' y2='{y2:.1f}' stroke='{stroke}'{dashes}/>")

    def curve(self, xs, ys, stroke, width=2.0):
        self.parts.append(f"<polyline points='{points(xs, ys)}' fill='none' stroke='{stroke}' stroke-width='{width}'/>")

    def area(self, xs, ys, fill):
        self.parts.append(f"<polygon points='{points(xs, ys)}' fill='{fill}'/>")

    def raw(self, part):
        self.parts.append(part)

    def content(self):
        return "\n".join(self.parts) + "\n</svg>\n"

    def write(self, path):
        path.write_text(self.content())


def points(xs, ys):
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in zip(xs, ys))


def png_chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png_head(width, height, depth, colour):
    return b"\x89PNG\r\n\x1a\n" + png_chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0))


def png_rows(rows):
    """Packed bytes of rows of bytes, unfiltered."""
    return zlib.compress(b"".join(b"\0" + row.tobytes() for row in rows), 9)


def write_png(path, image):
    """An image of height x width x 3 bytes."""
    height, width, _ = image.shape
    path.write_bytes(png_head(width, height, 8, 2) + png_chunk(b"IDAT", png_rows(image)) + png_chunk(b"IEND", b""))


def predicted(way, left, up, corner):
    """What a filter of PNG takes a byte for."""
    if way == 4:
        p, q, r = abs(up - corner), abs(left - corner), abs(left + up - 2 * corner)
        return left if p <= q and p <= r else up if q <= r else corner
    return (0, left, up, (left + up) // 2)[way]


def read_grey_png(path):
    """A grey PNG of 8 or 16 bits, as the simulator writes them."""
    data = path.read_bytes()
    at, packed, width, height, step = 8, b"", 0, 0, 1
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + size]
        if kind == b"IHDR":
            width, height, step = *struct.unpack(">II", body[:8]), body[8] // 8
        if kind == b"IDAT":
            packed += body
        at += size + 12
    raw, size = zlib.decompress(packed), step * width
    rows, above = [], [0] * size
    for y in range(height):
        line = raw[y * (size + 1):(y + 1) * (size + 1)]
        way, row = line[0], list(line[1:])
        for x in range(size):
            left, corner = (row[x - step], above[x - step]) if x >= step else (0, 0)
            row[x] = (row[x] + predicted(way, left, above[x], corner)) & 255
        rows.append(row)
        above = row
    image = np.array(rows, np.uint8)
    return image if step == 1 else image.view(">u2").astype(np.uint16)


def write_grey_png(path, image):
    """An image of height x width, of 8 or 16 bits."""
    height, width = image.shape
    rows = image.astype(">u2").view(np.uint8) if image.dtype == np.uint16 else image
    path.write_bytes(png_head(width, height, 8 * image.dtype.itemsize, 0) + png_chunk(b"IDAT", png_rows(rows)) +
                     png_chunk(b"IEND", b""))
