# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/simulator-peer.md: the simulator's events beside those of an independent one, on the same flight.

room_spiral of the shared recordings is from the other simulator. Its flight is flown in our hall: with the sensor as the
other has it (no low pass), with the world softened, and with that and the other's contrast threshold. Writes the pictures
simulators_events.png (events of 20 ms) and simulators_distributions.svg (times between events of a pixel, events per pixel).
"""
import dataclasses
import pathlib

import numpy as np

import drawing
import files
import harness
import tables

PEER = "room_spiral"
COMPARED_S, HALL_S = 0.7, 2
PICTURE_S = 0.02
COLOURS = ("#1f5fa8", "#3a9a5b", "#c23b22", "#8a56ac")
RED, BLUE = (200, 40, 30), (30, 90, 190)
SOFT = ["events.dark_cd_m2=3"]
THRESHOLD = ["events.threshold_on=0.595", "events.threshold_off=0.595", "events.threshold_sigma=0.071"]
HOT_QUANTILE = 0.999   # of the pixels; what fires twice as often as that is hot
LEAST_EVENTS = 1000


@dataclasses.dataclass(frozen=True)
class Source:
    """A recording, and the files that tell which contours are in view."""
    name: str
    folder: pathlib.Path
    contours: pathlib.Path
    cloud: pathlib.Path


class Stretch:
    """The beginning of a recording, with what is needed to project its contours."""

    def __init__(self, source, seconds):
        self.name = source.name
        self.camera = files.Camera(source.folder / "camchain-imucam.yaml")
        truth = np.loadtxt(source.folder / "groundtruth.tum")
        self.begin = int(1e6 * truth[0, 0])
        end = int(1e6 * min(truth[-1, 0], truth[0, 0] + seconds))
        self.seconds = (end - self.begin) * 1e-6
        self.events = files.Events(source.folder / "events.h5", self.begin, end)
        if len(self.events.t) < LEAST_EVENTS:
            raise harness.Failure(f"{source.folder}: fewer than {LEAST_EVENTS} events")
        self.truth_us = truth[:, 0] * 1e6
        self.T_map_body = np.tile(np.eye(4), (len(truth), 1, 1))
        self.T_map_body[:, :3, :3] = files.rotation(truth[:, 4:8])
        self.T_map_body[:, :3, 3] = truth[:, 1:4]
        self.contours = files.Ply(source.contours)
        self.cloud = files.Ply(source.cloud).points()
        self.pixels = self.camera.width * self.camera.height

    def T_cam_map(self, t_us):
        i = int(np.clip(np.searchsorted(self.truth_us, t_us), 1, len(self.truth_us) - 1))
        i -= t_us - self.truth_us[i - 1] < self.truth_us[i] - t_us
        return self.camera.T_cam_body @ np.linalg.inv(self.T_map_body[i])

    def between(self, begin_us, end_us):
        return slice(*np.searchsorted(self.events.t, [begin_us, end_us]))

    def pixel_numbers(self):
        return self.events.y.astype(np.int64) * self.camera.width + self.events.x

    def in_order_of_pixels(self):
        """Pixel numbers and times, sorted by both."""
        number = self.pixel_numbers()
        order = np.lexsort((self.events.t, number))
        return number[order], self.events.t[order]

    def rates(self):
        """Events a second of each pixel."""
        return np.bincount(self.pixel_numbers(), minlength=self.pixels) / self.seconds


# ---- figures

def gaps(stretch):
    """Times between events of a pixel, seconds, without the pixels that fire most (hot ones)."""
    number, t = stretch.in_order_of_pixels()
    counts = np.bincount(number, minlength=stretch.pixels)
    hot = counts > np.quantile(counts, HOT_QUANTILE) * 2
    same = (number[1:] == number[:-1]) & ~hot[number[1:]]
    return np.diff(t)[same] * 1e-6


def lonely_share(stretch, window_us=10000, most=400000):
    """Share of events without any other within 10 ms in the eight pixels around."""
    number, t = stretch.in_order_of_pixels()
    width = stretch.camera.width
    t = t - t.min()
    stride = int(t.max()) + 4 * window_us
    keys = number * stride + t
    chosen = np.random.default_rng(1).choice(len(keys), min(most, len(keys)), replace=False)
    chosen = chosen[(number[chosen] % width > 0) & (number[chosen] % width < width - 1)]
    lonely = np.ones(len(chosen), bool)
    for step in [dy * width + dx for dy in (-1, 0, 1) for dx in (-1, 0, 1) if dx or dy]:
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


def chained_points(contours):
    """Points, their tangents, the length that each stands for, and which of them have a next one."""
    points = contours.points()
    step = np.zeros_like(points)
    step[:-1] = points[1:] - points[:-1]
    length = np.linalg.norm(step, axis=1)
    chained = (length > 1e-6) & (length < 0.1)
    if "tx" in contours.vertices.dtype.names:
        return points, contours.columns("tx", "ty", "tz"), length, chained
    return points, step / np.where(chained, length, 1)[:, None], length, chained


def moved(points, T):
    return points @ T[:3, :3].T + T[:3, 3]


def edges_in_view(stretch, contours, moment):
    """Pixels of visible contour points at a moment, their lengths in pixels, their speeds along the normal in px/s."""
    camera, (points, tangent, length, chained) = stretch.camera, contours
    T = stretch.T_cam_map(moment)
    in_camera = moved(points, T)
    pixels, front = camera.project(in_camera)
    along, along_front = camera.project(moved(points + 1e-3 * tangent, T))
    before, after = (camera.project(moved(points, stretch.T_cam_map(moment + offset_us)))[0] for offset_us in (-2000, 2000))
    inside = (front & along_front & chained & (pixels[:, 0] >= 8) & (pixels[:, 1] >= 8) &
              (pixels[:, 0] < camera.width - 8) & (pixels[:, 1] < camera.height - 8))
    seen = visible(camera, in_camera, pixels, inside, moved(stretch.cloud, T))
    direction = (along - pixels)[seen] / 1e-3
    scale = np.linalg.norm(direction, axis=1)
    unit = direction / np.maximum(scale, 1e-9)[:, None]
    velocity = (after - before)[seen] / 0.004
    return pixels[seen], scale * length[seen], np.abs(velocity[:, 1] * unit[:, 0] - velocity[:, 0] * unit[:, 1])


def edge_crossings(stretch, windows=40, window_s=0.004):
    """Events per pixel that a visible contour crosses, those of the surroundings taken off; mean speed of the
    contours along their normals, px/s; their length in view, px."""
    contours = chained_points(stretch.contours)
    excess = swept = total_length = speed_length = 0.0
    moments = stretch.begin + 1e6 * (np.linspace(0.05, 0.95, windows) * stretch.seconds)
    for moment in moments:
        pixels, length_px, speed = edges_in_view(stretch, contours, moment)
        line = np.zeros((stretch.camera.height, stretch.camera.width), bool)
        line[np.rint(pixels[:, 1]).astype(int), np.rint(pixels[:, 0]).astype(int)] = True
        near = grown(line, 2)
        band = grown(near, 6) & ~grown(near, 3)
        part = stretch.between(moment - 5e5 * window_s, moment + 5e5 * window_s)
        x, y = stretch.events.x[part], stretch.events.y[part]
        excess += near[y, x].sum() - band[y, x].sum() * near.sum() / max(band.sum(), 1)
        swept += (length_px * speed).sum() * window_s
        total_length += length_px.sum()
        speed_length += (length_px * speed).sum()
    return excess / swept, speed_length / total_length, total_length / len(moments)


def figures(stretch):
    between = gaps(stretch)
    crossing, speed, length = edge_crossings(stretch)
    rate = len(stretch.events.t) / stretch.seconds
    spread = np.quantile(stretch.rates(), [0.5, 0.9, 0.99])
    return {
        "events, Mev/s": f"{rate * 1e-6:.2f}",
        "events per pixel and second: median, 90 %, 99 % of the pixels": ", ".join(f"{v:.1f}" for v in spread),
        "share of on events": f"{np.mean(stretch.events.on):.3f}",
        "visible contours, px": f"{length:.0f}",
        "their mean speed along the normal, px/s": f"{speed:.0f}",
        "events per pixel and pixel of motion": f"{rate / stretch.pixels / speed:.4f}",
        "events per edge crossing, surroundings subtracted": f"{crossing:.2f}",
        "time between events of a pixel, ms: 10 %, median, 90 %":
            ", ".join(f"{1e3 * v:.1f}" for v in np.quantile(between, [0.1, 0.5, 0.9])),
        "of these times, shorter than 0.2 ms": f"{np.mean(between < 2e-4):.4f}",
        "events alone for 10 ms among 3x3 pixels": f"{lonely_share(stretch):.3f}",
    }


# ---- pictures

def event_picture(stretch):
    """Events of 20 ms in the middle: on red, off blue, the newest of a pixel wins."""
    middle = stretch.begin + 5e5 * stretch.seconds
    part = stretch.between(middle, middle + 1e6 * PICTURE_S)
    image = np.full((stretch.camera.height, stretch.camera.width, 3), 255, np.uint8)
    colours = np.array([BLUE, RED], np.uint8)
    image[stretch.events.y[part], stretch.events.x[part]] = colours[(stretch.events.on[part] > 0).astype(int)]
    return image


def side_by_side(pictures):
    height = max(p.shape[0] for p in pictures)
    padded = [np.pad(p, ((0, height - p.shape[0]), (0, 8), (0, 0)), constant_values=128) for p in pictures]
    return np.concatenate(padded, axis=1)[:, :-8]


def draw_shares(svg, left, title, unit, edges, curves):
    """Shares per bin over a logarithmic axis."""
    width, height, top = 380, 220, 40
    most = max(max(c) for c in curves)
    svg.text(left, 20, title, size=14)
    svg.frame(left, top, width, height)
    low, high = np.log10(edges[0]), np.log10(edges[-1])
    for decade in range(int(np.ceil(low)), int(np.floor(high)) + 1):
        at = left + width * (decade - low) / (high - low)
        svg.line(at, top, at, top + height, "#ddd")
        svg.text(at, top + height + 16, f"{10.0 ** decade:g}", "middle")
    svg.text(left + width / 2, top + height + 34, unit, "middle")
    middles = 0.5 * (np.log10(edges[1:]) + np.log10(edges[:-1]))
    for curve, colour in zip(curves, COLOURS):
        svg.curve(left + width * (middles - low) / (high - low), top + height * (1 - 0.95 * np.asarray(curve) / most), colour)


def draw_distributions(path, stretches):
    between_edges, rate_edges = np.logspace(-4, 0.5, 46), np.logspace(-0.5, 3, 36)
    histograms = [np.histogram(gaps(s), between_edges)[0] for s in stretches]
    svg = drawing.Svg(880, 310)
    draw_shares(svg, 30, "Time between events of a pixel", "s", between_edges, [h / h.sum() for h in histograms])
    draw_shares(svg, 470, "Events per pixel", "1/s", rate_edges,
                [np.histogram(s.rates(), rate_edges)[0] / s.pixels for s in stretches])
    for i, (stretch, colour) in enumerate(zip(stretches, COLOURS)):
        svg.text(850 - 90 * (len(stretches) - 1 - i), 32, stretch.name, "end", fill=colour)
    svg.write(path)


# ---- the page

def sources(bench):
    peer = bench.peer(PEER)
    flight = ["camera.size=vga", "lidar.on=true", "events.bandwidth_hz_per_cd_m2=0", "trajectory.kind=file",
              f"trajectory.file={peer.truth}"]

    def flown(name, seconds, *settings):
        made = bench.simulated("indoor_spiral", seconds, [*flight, *settings], f"peer_flight_{name}")
        return Source(name, made.folder, made.contours, made.folder / "map_raw.ply")

    out = [flown("hall", HALL_S), flown("softened", COMPARED_S, "world.texture_contrast=0.5", *SOFT),
           Source("peer", peer.folder, peer.contours, bench.shared / "data/peer/maps/room_map_raw.ply"),
           flown("thresholds", COMPARED_S, *SOFT, *THRESHOLD)]
    return out[::3] if bench.quick else out


def make(bench):
    stretches = [Stretch(source, COMPARED_S) for source in sources(bench)]
    columns = {s.name: bench.once(f"simulator-peer: {s.name}", lambda: figures(s)) for s in stretches}
    rows = [[what, *(column[what] for column in columns.values())] for what in columns[stretches[0].name]]
    drawing.write_png(bench.image("simulators_events.png"), side_by_side([event_picture(s) for s in stretches[:3]]))
    draw_distributions(bench.image("simulators_distributions.svg"), stretches[:3])
    return bench.write_page("simulator-peer",
                            {"statistics": tables.table([f"first {COMPARED_S} s", *columns], rows)})
