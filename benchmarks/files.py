# SPDX-License-Identifier: BSD-3-Clause
"""Files that benchmarks read: PLY vertices, TUM trajectories, camera chains, events."""
import re

import h5py
import numpy as np

from harness import Failure

PLY_TYPES = {"float": "f4", "float32": "f4", "double": "f8", "float64": "f8", "uchar": "u1", "uint8": "u1", "char": "i1",
             "int8": "i1", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "short": "i2", "ushort": "u2"}


class Ply:
    """Vertices of a little-endian binary PLY file, as columns; what stands around them is kept."""

    def __init__(self, path):
        data = path.read_bytes()
        end = data.index(b"end_header\n") + len(b"end_header\n")
        self.header = data[:end]
        lines = self.header.decode().splitlines()
        if "format binary_little_endian 1.0" not in lines:
            raise Failure(f"{path}: not a little-endian binary PLY file")
        count, fields, inside = 0, [], False
        for words in (line.split() for line in lines):
            if words[:1] == ["element"]:
                inside = words[1] == "vertex"
                count = int(words[2]) if inside else count
            elif words[:1] == ["property"] and inside:
                fields.append((words[2], "<" + PLY_TYPES[words[1]]))
        self.vertices = np.frombuffer(data, dtype=fields, count=count, offset=end).copy()
        self.rest = data[end + self.vertices.nbytes:]

    def columns(self, *names):
        return np.stack([self.vertices[name] for name in names], axis=1).astype(float)

    def points(self):
        return self.columns("x", "y", "z")

    def write(self, path):
        path.write_bytes(self.header + self.vertices.tobytes() + self.rest)


def write_points(path, points_of_parts, count):
    """A PLY file of `count` points, x, y, z in float, from an iterable of arrays."""
    header = ("ply\nformat binary_little_endian 1.0\nelement vertex " + str(count) +
              "\nproperty float x\nproperty float y\nproperty float z\nend_header\n")
    with open(path, "wb") as file:
        file.write(header.encode())
        for points in points_of_parts:
            file.write(np.ascontiguousarray(points, "<f4").tobytes())


def rotation(q):
    """Matrices of unit quaternions (x, y, z, w in the last axis), in the last two axes."""
    x, y, z, w = np.moveaxis(np.asarray(q, float), -1, 0)
    rows = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


class Trajectory:
    """Poses of a TUM file's rows; linear in position, normalised linear in the quaternion (poses lie close)."""

    def __init__(self, rows):
        self.t, self.p, self.q = rows[:, 0], rows[:, 1:4], rows[:, 4:8].copy()
        for k in range(1, len(self.q)):
            if self.q[k] @ self.q[k - 1] < 0:
                self.q[k] *= -1

    def at(self, t):
        """Positions and unit quaternions."""
        p = np.stack([np.interp(t, self.t, c) for c in self.p.T], -1)
        q = np.stack([np.interp(t, self.t, c) for c in self.q.T], -1)
        return p, q / np.linalg.norm(q, axis=-1, keepdims=True)


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
        rows = re.search(r"T_cam_imu:\s*\n((?:\s*-\s*\[[^\]]*\]\s*\n?){4})", text)
        self.T_cam_body = np.eye(4) if rows is None else np.array(  # without an IMU the camera is the body
            [[float(v) for v in row.split(",")] for row in re.findall(r"\[([^\]]*)\]", rows[1])])

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


class Events:
    """Columns of an events.h5: times in microseconds of the recording's clock, pixels, polarity."""

    def __init__(self, path, begin_us=None, end_us=None):
        with h5py.File(path, "r") as file:
            t = file["events/t"][:].astype(np.int64)
            t += int(file["t_offset"][()]) if "t_offset" in file else 0
            part = slice(*(None if limit is None else int(np.searchsorted(t, limit)) for limit in (begin_us, end_us)))
            self.t = t[part]
            self.x, self.y, self.on = (file["events/" + name][part] for name in "xyp")
