#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Events of recordings side by side: compare_simulators.py [options] OUT NAME=FOLDER NAME=FOLDER ...

    --contours NAME=FILE.ply    true contours, where they are not in the folder
    --cloud NAME=FILE.ply       cloud that tells what hides contours, where it is not map_raw.ply of the folder
    --start S, --end S          stretch of each recording

Prints a table in Markdown and writes OUT/events.png (events of 20 ms of each) and OUT/distributions.svg (times
between events of a pixel, events per pixel). Needs numpy and h5py.
"""
import argparse
import pathlib
import re
import struct
import sys
import zlib

import h5py
import numpy as np

PICTURE_S = 0.02
COLOURS = ("#1f5fa8", "#3a9a5b", "#c23b22", "#8a56ac")


# ---- files

def read_ply(path):
    """Columns of the vertices of a binary PLY file."""
    types = {"float": "f4", "float32": "f4", "double": "f8", "uchar": "u1", "uint8": "u1", "char": "i1", "int8": "i1",
             "int": "i4", "int32": "i4", "uint": "u4", "short": "i2", "ushort": "u2"}
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    header = data[:end].decode().splitlines()
    if "format binary_little_endian 1.0" not in header:
        sys.exit(f"{path}: not a little-endian binary PLY file")
    count, fields, inside = 0, [], False
    for line in header:
        words = line.split()
        if words[:1] == ["element"]:
            inside = words[1] == "vertex"
            count = int(words[2]) if inside else count
        elif words[:1] == ["property"] and inside:
            fields.append((words[2], "<" + types[words[1]]))
    return np.frombuffer(data, dtype=fields, count=count, offset=end)


def points_of(table):
    return np.stack([table["x"], table["y"], table["z"]], axis=1).astype(float)


class Camera:
    """cam0 of a camera chain: pinhole with radial-tangential, equidistant or no distortion."""

    def __init__(self, path):
        text = path.read_text()

        def numbers(key):
            return [float(v) for v in re.search(key + r":\s*\[([^\]]*)\]", text)[1].split(",") if v.strip()]

        self.fx, self.fy, self.cx, self.cy = numbers("intrinsics")
        self.distortion = numbers("distortion_coeffs")
        self.model = re.search(r"distortion_model:\s*(\S+)", text)[1]
        self.width, self.height = (int(v) for v in numbers("resolution"))
        rows = re.search(r"T_cam_imu:\s*\n((?:\s*-\s*\[[^\]]*\]\s*\n?){4})", text)[1]
        self.T_cam_body = np.array([[float(v) for v in row.split(",")] for row in re.findall(r"\[([^\]]*)\]", rows)])

    def project(self, points):
        """Pixels, and where they are in front and within the lens's field."""
        z = points[:, 2]
        front = z > 0.05
        x, y = points[:, 0] / np.where(front, z, 1), points[:, 1] / np.where(front, z, 1)
        r2 = x * x + y * y
        front &= r2 < 4
        if self.model == "radtan":
            k1, k2, p1, p2 = self.distortion[:4]
            radial = 1 + r2 * (k1 + r2 * k2)
            x, y = (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                    y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y)
        elif self.model == "equidistant":
            r = np.sqrt(r2)
            angle = np.arctan(r)
            a2 = angle * angle
            k = self.distortion
            scale = np.where(r > 1e-9, angle * (1 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3])))) /
                             np.maximum(r, 1e-9), 1)
            x, y = x * scale, y * scale
        return np.stack([self.fx * x + self.cx, self.fy * y + self.cy], axis=1), front


def matrices(rows):
    """T_map_body of rows of a TUM file."""
    x, y, z, w = rows[:, 4:8].T
    out = np.zeros((len(rows), 4, 4))
    out[:, 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], 1)
    out[:, 1, :3] = np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], 1)
    out[:, 2, :3] = np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], 1)
    out[:, :3, 3] = rows[:, 1:4]
    out[:, 3, 3] = 1
    return out


class Recording:
    def __init__(self, name, folder, contours, cloud, start_s, end_s):
        self.name = name
        self.camera = Camera(folder / "camchain-imucam.yaml")
        with h5py.File(folder / "events.h5", "r") as file:
            t = file["events/t"][:].astype(np.int64)
            offset = int(file["t_offset"][()]) if "t_offset" in file else 0
            t += offset
            truth = np.loadtxt(folder / "groundtruth.tum")
            begin = int(1e6 * (truth[0, 0] + start_s))
            end = int(1e6 * min(truth[-1, 0], truth[0, 0] + end_s))
            part = slice(*np.searchsorted(t, [begin, end]))
            self.t = t[part]
            self.x, self.y, self.on = (file["events/" + key][part] for key in ("x", "y", "p"))
        if len(self.t) < 1000:
            sys.exit(f"{folder}: fewer than 1000 events from {start_s} s on")
        self.begin, self.seconds = begin, (end - begin) * 1e-6
        self.truth_us = truth[:, 0] * 1e6
        self.T_map_body = matrices(truth)
        self.contours = read_ply(contours or folder / "contours.ply")
        self.cloud = points_of(read_ply(cloud or folder / "map_raw.ply"))
        self.pixels = self.camera.width * self.camera.height

    def T_cam_map(self, t_us):
        i = int(np.clip(np.searchsorted(self.truth_us, t_us), 1, len(self.truth_us) - 1))
        i -= t_us - self.truth_us[i - 1] < self.truth_us[i] - t_us
        return self.camera.T_cam_body @ np.linalg.inv(self.T_map_body[i])

    def pixel_numbers(self):
        return self.y.astype(np.int64) * self.camera.width + self.x

    def in_order_of_pixels(self):
        """Pixel numbers and times, sorted by both."""
        number = self.pixel_numbers()
        order = np.lexsort((self.t, number))
        return number[order], self.t[order]


# ---- figures

def gaps(recording):
    """Times between events of a pixel, seconds, without the pixels that fire most (hot ones)."""
    number, t = recording.in_order_of_pixels()
    counts = np.bincount(number, minlength=recording.pixels)
    hot = counts > np.quantile(counts, 0.999) * 2
    same = (number[1:] == number[:-1]) & ~hot[number[1:]]
    return np.diff(t)[same] * 1e-6


def lonely_share(recording, window_us=10000, most=400000):
    """Share of events without any other within 10 ms in the eight pixels around."""
    number, t = recording.in_order_of_pixels()
    t = t - t.min()
    stride = int(t.max()) + 4 * window_us
    keys = number * stride + t
    chosen = np.random.default_rng(1).choice(len(keys), min(most, len(keys)), replace=False)
    chosen = chosen[(number[chosen] % recording.camera.width > 0) &
                    (number[chosen] % recording.camera.width < recording.camera.width - 1)]
    lonely = np.ones(len(chosen), bool)
    for step in [dy * recording.camera.width + dx for dy in (-1, 0, 1) for dx in (-1, 0, 1) if dx or dy]:
        wanted = keys[chosen] + step * stride
        after = np.searchsorted(keys, wanted - window_us)
        lonely &= ~(keys[np.minimum(after, len(keys) - 1)] <= wanted + window_us) | (after >= len(keys))
    return lonely.mean()


def grown(mask, times):
    for _ in range(times):
        wider = mask.copy()
        wider[1:] |= mask[:-1]
        wider[:-1] |= mask[1:]
        wider[:, 1:] |= mask[:, :-1]
        wider[:, :-1] |= mask[:, 1:]
        mask = wider
    return mask


def visible(camera, points_cam, pixels, inside, cloud_cam):
    """Contour points that the cloud does not hide: by a coarse depth picture."""
    cell = 8
    columns, rows = camera.width // cell + 1, camera.height // cell + 1
    place, front = camera.project(cloud_cam)
    front &= (place[:, 0] >= 0) & (place[:, 1] >= 0) & (place[:, 0] < camera.width) & (place[:, 1] < camera.height)
    depth = np.full(rows * columns, np.inf)
    cells = (place[front, 1] // cell).astype(int) * columns + (place[front, 0] // cell).astype(int)
    np.minimum.at(depth, cells, cloud_cam[front, 2])
    out = inside.copy()
    at = (pixels[inside, 1] // cell).astype(int) * columns + (pixels[inside, 0] // cell).astype(int)
    out[inside] = points_cam[inside, 2] < depth[at] * 1.04 + 0.06
    return out


def edge_crossings(recording, windows=40, window_s=0.004):
    """Events per pixel that a visible contour crosses, those of the surroundings taken off; mean speed of the
    contours along their normals, px/s; their length in view, px."""
    camera, table = recording.camera, recording.contours
    points = points_of(table)
    step = np.zeros_like(points)
    step[:-1] = points[1:] - points[:-1]
    length = np.linalg.norm(step, axis=1)
    chained = (length > 1e-6) & (length < 0.1)
    if "tx" in table.dtype.names:
        tangent = np.stack([table["tx"], table["ty"], table["tz"]], 1).astype(float)
    else:
        tangent = step / np.where(chained, length, 1)[:, None]
    excess = swept = total_length = speed_length = 0.0
    moments = recording.begin + 1e6 * (np.linspace(0.05, 0.95, windows) * recording.seconds)
    for moment in moments:
        def place(offset_us, what=points):
            T = recording.T_cam_map(moment + offset_us)
            in_camera = what @ T[:3, :3].T + T[:3, 3]
            return in_camera, *camera.project(in_camera)

        in_camera, pixels, front = place(0)
        _, along, along_front = place(0, points + 1e-3 * tangent)
        _, before, _ = place(-2000)
        _, after, _ = place(2000)
        inside = (front & along_front & chained & (pixels[:, 0] >= 8) & (pixels[:, 1] >= 8) &
                  (pixels[:, 0] < camera.width - 8) & (pixels[:, 1] < camera.height - 8))
        T = recording.T_cam_map(moment)
        seen = visible(camera, in_camera, pixels, inside, recording.cloud @ T[:3, :3].T + T[:3, 3])
        direction = (along - pixels)[seen] / 1e-3
        length_px = np.linalg.norm(direction, axis=1) * length[seen]
        unit = direction / np.maximum(np.linalg.norm(direction, axis=1), 1e-9)[:, None]
        velocity = (after - before)[seen] / 0.004
        normal_speed = np.abs(velocity[:, 1] * unit[:, 0] - velocity[:, 0] * unit[:, 1])
        line = np.zeros((camera.height, camera.width), bool)
        line[np.rint(pixels[seen, 1]).astype(int), np.rint(pixels[seen, 0]).astype(int)] = True
        near = grown(line, 2)
        band = grown(near, 6) & ~grown(near, 3)
        part = slice(*np.searchsorted(recording.t, [moment - 5e5 * window_s, moment + 5e5 * window_s]))
        x, y = recording.x[part], recording.y[part]
        excess += near[y, x].sum() - band[y, x].sum() * near.sum() / max(band.sum(), 1)
        swept += (length_px * normal_speed).sum() * window_s
        total_length += length_px.sum()
        speed_length += (length_px * normal_speed).sum()
    return excess / swept, speed_length / total_length, total_length / len(moments)


def figures(recording):
    counts = np.bincount(recording.pixel_numbers(), minlength=recording.pixels) / recording.seconds
    spread = np.quantile(counts, [0.1, 0.5, 0.9, 0.99])
    between = gaps(recording)
    crossing, speed, length = edge_crossings(recording)
    rate = len(recording.t) / recording.seconds
    return [
        ("seconds", f"{recording.seconds:.2f}"),
        ("events, Mev/s", f"{rate * 1e-6:.2f}"),
        ("events per pixel and second, mean", f"{rate / recording.pixels:.2f}"),
        ("... 10 %, median, 90 %, 99 % of the pixels", ", ".join(f"{v:.1f}" for v in spread)),
        ("share of on events", f"{np.mean(recording.on):.3f}"),
        ("visible contours, px", f"{length:.0f}"),
        ("their mean speed along the normal, px/s", f"{speed:.0f}"),
        ("events per pixel and pixel of motion", f"{rate / recording.pixels / speed:.4f}"),
        ("events per edge crossing", f"{crossing:.2f}"),
        ("time between events of a pixel, ms: 10 %, median, 90 %",
         ", ".join(f"{1e3 * v:.1f}" for v in np.quantile(between, [0.1, 0.5, 0.9]))),
        ("... shorter than 0.2 ms", f"{np.mean(between < 2e-4):.4f}"),
        ("events alone for 10 ms among 3x3 pixels", f"{lonely_share(recording):.3f}"),
    ]


# ---- pictures

def write_png(path, image):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    height, width, _ = image.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), image.reshape(height, -1)], axis=1)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) +
                     chunk(b"IDAT", zlib.compress(rows.tobytes(), 9)) + chunk(b"IEND", b""))


def event_picture(recording):
    """Events of 20 ms in the middle: on red, off blue, the newest of a pixel wins."""
    middle = recording.begin + 5e5 * recording.seconds
    part = slice(*np.searchsorted(recording.t, [middle, middle + 1e6 * PICTURE_S]))
    image = np.full((recording.camera.height, recording.camera.width, 3), 255, np.uint8)
    red, blue = np.array([200, 40, 30], np.uint8), np.array([30, 90, 190], np.uint8)
    image[recording.y[part], recording.x[part]] = np.where(recording.on[part][:, None] > 0, red, blue)
    return image


def side_by_side(pictures):
    height = max(p.shape[0] for p in pictures)
    padded = [np.pad(p, ((0, height - p.shape[0]), (0, 8), (0, 0)), constant_values=128) for p in pictures]
    return np.concatenate(padded, axis=1)[:, :-8]


def svg_panel(left, title, unit, edges, curves):
    """Shares per bin over a logarithmic axis."""
    width, height, top = 380, 220, 40
    most = max(max(c) for c in curves)
    out = [f'<text x="{left}" y="20" font-size="14">{title}</text>',
           f'<rect x="{left}" y="{top}" width="{width}" height="{height}" fill="none" stroke="#888"/>']
    low, high = np.log10(edges[0]), np.log10(edges[-1])
    for decade in range(int(np.ceil(low)), int(np.floor(high)) + 1):
        at = left + width * (decade - low) / (high - low)
        out.append(f'<line x1="{at:.1f}" y1="{top}" x2="{at:.1f}" y2="{top + height}" stroke="#ddd"/>')
        out.append(f'<text x="{at:.1f}" y="{top + height + 16}" text-anchor="middle">{10.0 ** decade:g}</text>')
    out.append(f'<text x="{left + width / 2}" y="{top + height + 34}" text-anchor="middle">{unit}</text>')
    middles = 0.5 * (np.log10(edges[1:]) + np.log10(edges[:-1]))
    for curve, colour in zip(curves, COLOURS):
        line = " ".join(f"{left + width * (m - low) / (high - low):.1f},{top + height * (1 - 0.95 * v / most):.1f}"
                        for m, v in zip(middles, curve))
        out.append(f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="2"/>')
    return out


def write_distributions(path, recordings):
    between_edges = np.logspace(-4, 0.5, 46)
    count_edges = np.logspace(-0.5, 3, 36)
    between, counts = [], []
    for recording in recordings:
        histogram = np.histogram(gaps(recording), between_edges)[0]
        between.append(histogram / histogram.sum())
        per_pixel = np.bincount(recording.pixel_numbers(), minlength=recording.pixels) / recording.seconds
        counts.append(np.histogram(per_pixel, count_edges)[0] / recording.pixels)
    out = ['<svg xmlns="http://www.w3.org/2000/svg" width="880" height="310" font-family="sans-serif" font-size="12">',
           '<rect width="880" height="310" fill="white"/>']
    out += svg_panel(30, "Time between events of a pixel", "s", between_edges, between)
    out += svg_panel(470, "Events per pixel", "1/s", count_edges, counts)
    for i, (recording, colour) in enumerate(zip(recordings, COLOURS)):
        out.append(f'<text x="{850 - 90 * (len(recordings) - 1 - i)}" y="32" text-anchor="end" fill="{colour}">{recording.name}</text>')
    path.write_text("\n".join(out) + "\n</svg>\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("recordings", nargs="+", metavar="NAME=FOLDER")
    parser.add_argument("--contours", action="append", default=[], metavar="NAME=FILE")
    parser.add_argument("--cloud", action="append", default=[], metavar="NAME=FILE")
    parser.add_argument("--start", type=float, default=0.0)
    parser.add_argument("--end", type=float, default=1e9)
    options = parser.parse_args()

    def named(values):
        for value in values:
            if "=" not in value:
                sys.exit(f"{value}: write NAME=PATH")
        return {name: pathlib.Path(path) for name, path in (value.split("=", 1) for value in values)}

    if len(options.recordings) > len(COLOURS):
        sys.exit(f"{len(COLOURS)} recordings at most")
    contours, clouds = named(options.contours), named(options.cloud)
    recordings = [Recording(name, folder, contours.get(name), clouds.get(name), options.start, options.end)
                  for name, folder in named(options.recordings).items()]
    options.out.mkdir(parents=True, exist_ok=True)
    columns = [figures(recording) for recording in recordings]
    print("| | " + " | ".join(recording.name for recording in recordings) + " |")
    print("|---|" + "---|" * len(recordings))
    for rows in zip(*columns):
        print(f"| {rows[0][0]} | " + " | ".join(value for _, value in rows) + " |")
    write_png(options.out / "events.png", side_by_side([event_picture(r) for r in recordings]))
    write_distributions(options.out / "distributions.svg", recordings)


if __name__ == "__main__":
    main()
