#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Real data: 0.22 s of a flying hexacopter (MVSEC indoor_flying1), tracked from events alone.

    mvsec_chunk.py EVPOSE CHUNK OUT [--map-s 0.06] [--json]

Contour points are made from the events and the metric depth of the first 60 ms of CHUNK; the rest is tracked by
EVPOSE against them, started from ground truth; the run and its figures land in OUT. Printed: errors against ground
truth, the mean twist beside the free contrast maximum that CHUNK's README states, and the sharpness (variance of
the image of warped events, 1 px blur) with the estimated motion, with the true one and with none.
Needs numpy and h5py. About 5 s.
"""
import argparse
import json
import pathlib
import re
import subprocess
import sys

import h5py
import numpy as np

import files

WIDTH, HEIGHT = 346, 260
MARGIN_PX = 10
README_TWIST = ((0.013, 0.162, 0.006), (0.075, -0.090, -0.072))  # rad/s, m/s; camera axes


class CameraPath(files.Trajectory):
    """Camera poses in the world."""

    def pose(self, t):
        p, q = self.at(t)
        return p, files.rotation(q)

    def twist(self, t, half_s=0.05):
        """Mean angular and linear velocity around t, in the camera's axes."""
        (p0, r0), (p1, r1), (_, r) = self.pose(t - half_s), self.pose(t + half_s), self.pose(t)
        d = r0.T @ r1
        w = np.array([d[2, 1] - d[1, 2], d[0, 2] - d[2, 0], d[1, 0] - d[0, 1]]) / 2
        return w / (2 * half_s), r.T @ (p1 - p0) / (2 * half_s)


class Chunk:
    def __init__(self, folder):
        with h5py.File(folder / "events.h5") as file:
            self.data = {name: file["events"][name][:] for name in ("t", "x", "y", "p", "depth", "x_rect", "y_rect")}
        self.truth = CameraPath(np.loadtxt(folder / "groundtruth.txt"))
        calibration = (folder / "calibration.yaml").read_text()
        lists = [[float(v) for v in m.split(",")] for m in re.findall(r"\[([^\]]*)\]", calibration)]
        self.raw, self.distortion, self.rectified = lists[0], lists[1], lists[2]
        self.r_rect_raw = np.array(lists[3]).reshape(3, 3)
        f, _, cx, cy = self.rectified
        d = self.data
        ray = np.stack([(d["x_rect"] - cx) / f, (d["y_rect"] - cy) / f, np.ones(len(d["t"]))], -1)
        self.in_cam = (ray * d["depth"][:, None]) @ self.r_rect_raw  # raw camera axes
        self.t = d["t"] * 1e-6

    def in_world(self, trajectory, keep):
        p, r = trajectory.pose(self.t[keep])
        return np.einsum("nij,nj->ni", r, self.in_cam[keep]) + p

    def project(self, world, trajectory, t):
        """Rectified pixels at time t."""
        p, r = trajectory.pose(t)
        x = (world - p) @ r @ self.r_rect_raw.T
        f, _, cx, cy = self.rectified
        return f * x[:, :2] / x[:, 2:] + (cx, cy), x[:, 2]

    def warped_image(self, trajectory, keep, t):
        pixel, _ = self.project(self.in_world(trajectory, keep), trajectory, t)
        image = np.zeros((HEIGHT, WIDTH))
        x0 = np.floor(pixel).astype(int)
        u = pixel - x0
        for dx in (0, 1):
            for dy in (0, 1):
                x, y = x0[:, 0] + dx, x0[:, 1] + dy
                inside = (x >= 0) & (y >= 0) & (x < WIDTH) & (y < HEIGHT)
                w = np.abs(1 - dx - u[:, 0]) * np.abs(1 - dy - u[:, 1])
                np.add.at(image, (y[inside], x[inside]), w[inside])
        return image


def blurred(image, sigma_px=1.0):
    k = np.exp(-0.5 * (np.arange(-4, 5) / sigma_px) ** 2)
    k /= k.sum()
    rows = np.apply_along_axis(np.convolve, 1, image, k, "same")
    return np.apply_along_axis(np.convolve, 0, rows, k, "same")


def sharpness(image):
    return float(blurred(image)[MARGIN_PX:-MARGIN_PX, MARGIN_PX:-MARGIN_PX].var())


def contour_points(chunk, until_s):
    """Ridge of the image of warped events, with the depth of the events there; world coordinates."""
    keep = chunk.t < until_s
    middle = (chunk.t[0] + until_s) / 2
    world = chunk.in_world(chunk.truth, keep)
    pixel, depth = chunk.project(world, chunk.truth, middle)
    image = blurred(chunk.warped_image(chunk.truth, keep, middle))
    gy, gx = np.gradient(image)
    hxx, hxy, hyy = np.gradient(gx, axis=1), np.gradient(gx, axis=0), np.gradient(gy, axis=0)
    mean, half = (hxx + hyy) / 2, np.hypot((hxx - hyy) / 2, hxy)
    curvature = mean - half  # across the ridge: most negative
    angle = 0.5 * np.arctan2(2 * hxy, hxx - hyy) + np.pi / 2  # axis of the smaller eigenvalue
    nx, ny = np.cos(angle), np.sin(angle)
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = -(gx * nx + gy * ny) / curvature  # to the ridge's top, in px along the normal
    ridge = (curvature < -0.05) & (np.abs(offset) <= 0.5) & (image > 0.35)
    ridge[:MARGIN_PX], ridge[-MARGIN_PX:], ridge[:, :MARGIN_PX], ridge[:, -MARGIN_PX:] = False, False, False, False
    rows = []
    f, _, cx, cy = chunk.rectified
    p, r = chunk.truth.pose(middle)
    for y, x in np.argwhere(ridge):
        at = np.array([x + offset[y, x] * nx[y, x], y + offset[y, x] * ny[y, x]])
        near = (np.abs(pixel - at) < 1.5).all(axis=1)
        if near.sum() < 4 or np.ptp(np.percentile(depth[near], (10, 90))) > 0.1 * np.median(depth[near]):
            continue
        z = np.median(depth[near])

        def world_of(v):
            return p + r @ chunk.r_rect_raw.T @ (np.array([(v[0] - cx) / f, (v[1] - cy) / f, 1.0]) * z)

        point = world_of(at)
        normal = world_of(at + (nx[y, x], ny[y, x])) - point
        tangent = world_of(at + (-ny[y, x], nx[y, x])) - point
        tangent -= tangent @ normal / (normal @ normal) * normal
        rows.append(np.hstack([point, normal / np.linalg.norm(normal), tangent / np.linalg.norm(tangent)]))
    return np.array(rows)


def write_recording(chunk, points, from_s, folder):
    folder.mkdir(parents=True, exist_ok=True)
    keep = chunk.t >= from_s
    with h5py.File(folder / "events.h5", "w") as file:
        file.attrs["width"], file.attrs["height"] = np.uint32(WIDTH), np.uint32(HEIGHT)
        for name, kind in (("t", "i8"), ("x", "u2"), ("y", "u2"), ("p", "u1")):
            file.create_dataset(f"events/{name}", data=chunk.data[name][keep].astype(kind), chunks=True)
    truth = chunk.truth
    np.savetxt(folder / "groundtruth.tum", np.hstack([truth.t[:, None], truth.p, truth.q]), fmt="%.9f")
    (folder / "camchain-imucam.yaml").write_text(
        "cam0:\n  camera_model: pinhole\n  distortion_model: equidistant\n"
        f"  intrinsics: {chunk.raw}\n  distortion_coeffs: {chunk.distortion}\n  resolution: [{WIDTH}, {HEIGHT}]\n")
    header = "ply\nformat ascii 1.0\nelement vertex %d\n" % len(points)
    header += "".join(f"property float {name}\n" for name in "x y z nx ny nz tx ty tz".split()) + "end_header\n"
    body = "\n".join(" ".join(f"{v:.6f}" for v in row) for row in points)
    (folder / "contours.ply").write_text(header + body + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("evpose"), parser.add_argument("chunk", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--map-s", type=float, default=0.06), parser.add_argument("--json", action="store_true")
    parser.add_argument("--set", action="append", default=[])
    args = parser.parse_args()
    chunk = Chunk(args.chunk)
    from_s = chunk.t[0] + args.map_s
    points = contour_points(chunk, from_s)
    write_recording(chunk, points, from_s, args.out / "recording")
    # The points stand where events were, half a pixel more or less, which is 4 mm at 2 m.
    command = [args.evpose, "-q", "track", args.out / "recording", "--init", "groundtruth", "-o", args.out / "run",
               "--force", "--set", "registration.map_sigma_m=0.004"]
    for value in args.set:
        command += ["--set", value]
    tracked = subprocess.run([str(c) for c in command], capture_output=True, text=True, stdin=subprocess.DEVNULL)
    if tracked.returncode not in (0, 1):
        sys.exit(tracked.stderr.strip())
    summary = json.loads((args.out / "run" / "summary.json").read_text())
    estimate = CameraPath(np.loadtxt(args.out / "run" / "trajectory_camera.tum"))
    keep = (chunk.t >= estimate.t[0]) & (chunk.t <= estimate.t[-1])
    middle = (estimate.t[0] + estimate.t[-1]) / 2
    still = CameraPath(np.array([[0, 0, 0, 0, 0, 0, 0, 1.0], [1e3, 0, 0, 0, 0, 0, 0, 1.0]]))
    figures = {"contour_points": len(points), "status": summary["status"],
               "tracked_s": round(float(estimate.t[-1] - estimate.t[0]), 4),
               **{k: summary["accuracy"][k] for k in ("ate_mean_mm", "ate_max_mm", "are_mean_deg")},
               **{f"sharpness_{name}": round(sharpness(chunk.warped_image(path, keep, middle)), 4)
                  for name, path in (("estimate", estimate), ("truth", chunk.truth), ("no_motion", still))}}
    for name, path in (("estimate", estimate), ("truth", chunk.truth)):
        w, v = path.twist(middle)
        figures[f"twist_{name}"] = {"w_rad_s": np.round(w, 3).tolist(), "v_m_s": np.round(v, 3).tolist()}
    figures["twist_contrast_maximum"] = {"w_rad_s": README_TWIST[0], "v_m_s": README_TWIST[1]}
    (args.out / "figures.json").write_text(json.dumps(figures, indent=1))
    print(json.dumps(figures) if args.json else "\n".join(f"{k:24} {v}" for k, v in figures.items()))


if __name__ == "__main__":
    main()
