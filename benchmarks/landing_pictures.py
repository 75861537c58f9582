# SPDX-License-Identifier: BSD-3-Clause
"""docs/images/landing_strip.png and landing_events.png: a simulated landing.

The strip has grey pictures over the events of the same moment; the other is an animated PNG of the events.
"""
import struct

import numpy as np

import drawing
import files
import harness

SECONDS, SETTINGS = 3, ["camera.size=vga", "frames.rate_hz=30"]
STRIP = 6  # moments
EVENTS_S = 0.01  # shown at a moment
FRAMES_A_SECOND = 15
WHITE, RED, BLUE = 0, 1, 2
PALETTE = bytes((255, 255, 255, 214, 39, 40, 31, 99, 180, 0, 0, 0))


class EventImages:
    """Images of the events of a moment, at half the size."""

    def __init__(self, folder):
        self.events = files.Events(folder / "events.h5")
        camera = files.Camera(folder / "camchain-imucam.yaml")
        self.shape = camera.height // 2, camera.width // 2

    def at(self, end_s):
        """Palette numbers."""
        e = self.events
        part = slice(*np.searchsorted(e.t, [(end_s - EVENTS_S) * 1e6, end_s * 1e6]))
        image = np.full(self.shape, WHITE, np.uint8)
        y, x = e.y[part] // 2, e.x[part] // 2
        inside = (y < self.shape[0]) & (x < self.shape[1])
        image[y[inside], x[inside]] = np.where(e.on[part][inside] == 1, RED, BLUE)
        return image


def halved(grey):
    grey = grey[:grey.shape[0] // 2 * 2, :grey.shape[1] // 2 * 2].astype(np.uint16)
    return ((grey[::2, ::2] + grey[1::2, ::2] + grey[::2, 1::2] + grey[1::2, 1::2]) // 4).astype(np.uint8)


def write_strip(path, folder, images):
    stamps = [line.split(",") for line in (folder / "frames/timestamps.csv").read_text().splitlines()[1:]]
    picked = [stamps[round(i * (len(stamps) - 1) / (STRIP - 1))] for i in range(STRIP)]
    colours = np.frombuffer(PALETTE, np.uint8).reshape(4, 3)
    columns = []
    for stamp, name, _ in picked:
        grey = halved(drawing.read_grey_png(folder / "frames" / name))
        seen = images.at(int(stamp) * 1e-9)[:grey.shape[0], :grey.shape[1]]
        columns.append(np.vstack([np.repeat(grey[:, :, None], 3, axis=2), colours[seen]]))
    gap = np.full((columns[0].shape[0], 4, 3), 255, np.uint8)
    drawing.write_png(path, np.hstack([part for column in columns for part in (column, gap)][:-1]))


def packed_rows(image):
    """Two bits a pixel."""
    width = (image.shape[1] + 3) // 4 * 4
    full = np.zeros((image.shape[0], width), np.uint8)
    full[:, :image.shape[1]] = image
    quads = full.reshape(image.shape[0], -1, 4)
    return drawing.png_rows(quads[:, :, 0] << 6 | quads[:, :, 1] << 4 | quads[:, :, 2] << 2 | quads[:, :, 3])


def write_animation(path, images):
    times = np.arange(EVENTS_S, images.events.t[-1] * 1e-6, 1 / FRAMES_A_SECOND)
    height, width = images.shape
    out, number = drawing.png_head(width, height, 2, 3) + drawing.png_chunk(b"PLTE", PALETTE), 0
    out += drawing.png_chunk(b"acTL", struct.pack(">II", len(times), 0))
    for k, t in enumerate(times):
        out += drawing.png_chunk(b"fcTL", struct.pack(">IIIIIHHBB", number, width, height, 0, 0, 1, FRAMES_A_SECOND, 0, 0))
        number += 1
        rows = packed_rows(images.at(t))
        if k == 0:
            out += drawing.png_chunk(b"IDAT", rows)
        else:
            out += drawing.png_chunk(b"fdAT", struct.pack(">I", number) + rows)
            number += 1
    path.write_bytes(out + drawing.png_chunk(b"IEND", b""))


def make(bench):
    recording = bench.simulated("landing", SECONDS, SETTINGS, "landing_frames")
    images = EventImages(recording.folder)
    if len(images.events.t) == 0:
        raise harness.Failure(f"{recording.folder} has no events")
    strip, animation = bench.image("landing_strip.png"), bench.image("landing_events.png")
    write_strip(strip, recording.folder, images)
    write_animation(animation, images)
    return strip
