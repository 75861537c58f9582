# SPDX-License-Identifier: BSD-3-Clause
"""docs/images/simulator_options.png and simulator_presets.png: what options of scenes and cameras, and sensors, look like.

The first has grey pictures without and with options; the second the events of one moment of the same flight with each preset
of the sensor, at the camera that belongs to it, scaled to one width.
"""
import numpy as np

import drawing
import files

SECONDS = 0.15
VGA = ("camera.size=vga", "frames.rate_hz=50")
PICTURE = 3  # of the pictures of a flight
ALL, MIDDLE = (0, 1, 0, 1), (0.4, 0.6, 0.4, 0.6)
# Rows of two: scenario, settings, part of the picture that is shown (left, right, top, bottom of its size).
PICTURES = [[("indoor_spiral", (), ALL), ("indoor_spiral", ("world.mirror=0.2",), ALL)],
            [("outdoor_spiral", (), ALL), ("outdoor_spiral", ("world.repeated_facades=true",), ALL)],
            [("indoor_spiral", ("camera.vignetting=0.4",), ALL), ("board", (), ALL)],
            [("indoor_spiral", (), MIDDLE), ("indoor_spiral", ("camera.blur_px=0.7",), MIDDLE)]]
PRESETS = {"typical": "vga", "imx636": "720p", "dvxplorer": "vga", "davis346": "davis346"}
EVENTS_S = 0.01
WIDTH, GAP = 480, 6
COLOURS = np.array([(255, 255, 255), (31, 99, 180), (214, 39, 40)], np.uint8)  # none, off, on


def scaled(image, width=WIDTH):
    """To that width, by the nearest pixel."""
    height = round(image.shape[0] * width / image.shape[1])
    rows = (np.arange(height) + 0.5) * image.shape[0] / height
    columns = (np.arange(width) + 0.5) * image.shape[1] / width
    return image[rows.astype(int)][:, columns.astype(int)]


def grey_picture(bench, scenario, settings, part):
    folder = bench.simulated(scenario, SECONDS, (*VGA, *settings), f"picture_{scenario}").folder
    name = (folder / "frames/timestamps.csv").read_text().splitlines()[1 + PICTURE].split(",")[1]
    grey = drawing.read_grey_png(folder / "frames" / name)
    height, width = grey.shape
    left, right, top, bottom = (round(share * size) for share, size in zip(part, (width, width, height, height)))
    return np.repeat(scaled(grey[top:bottom, left:right])[:, :, None], 3, axis=2)


def event_picture(bench, preset, size):
    """The newest event of each pixel in the last 10 ms."""
    folder = bench.simulated("indoor_spiral", SECONDS, (f"camera.size={size}", f"events.preset={preset}"),
                             f"preset_{preset}").folder
    camera, events = files.Camera(folder / "camchain-imucam.yaml"), files.Events(folder / "events.h5")
    part = slice(*np.searchsorted(events.t, [(SECONDS - EVENTS_S) * 1e6, SECONDS * 1e6]))
    image = np.zeros((camera.height, camera.width), np.uint8)
    image[events.y[part], events.x[part]] = 1 + (events.on[part] == 1)
    return COLOURS[scaled(image)]


def sheet(rows):
    """Rows of pictures of one width, with gaps."""
    lines = []
    for row in rows:
        height = max(picture.shape[0] for picture in row)
        line = np.full((height, len(row) * (WIDTH + GAP) - GAP, 3), 255, np.uint8)
        for k, picture in enumerate(row):
            line[:picture.shape[0], k * (WIDTH + GAP):k * (WIDTH + GAP) + WIDTH] = picture
        lines += [line, np.full((GAP, line.shape[1], 3), 255, np.uint8)]
    return np.vstack(lines[:-1])


def make(bench):
    pictures = [[grey_picture(bench, *picture) for picture in row] for row in PICTURES[:1 if bench.quick else None]]
    drawing.write_png(bench.image("simulator_options.png"), sheet(pictures))
    presets = [event_picture(bench, *preset) for preset in list(PRESETS.items())[:2 if bench.quick else None]]
    path = bench.image("simulator_presets.png")
    drawing.write_png(path, sheet([presets[k:k + 2] for k in range(0, len(presets), 2)]))
    return path
