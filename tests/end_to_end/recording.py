# SPDX-License-Identifier: BSD-3-Clause
"""A tiny healthy recording, made from scratch: a camera that slides along a wall with a grid of edges.

Its parts are plain attributes, so that a test spoils one of them and writes the rest.
"""
import pathlib

import numpy as np

WIDTH, HEIGHT, FOCAL = 160, 120, 120.0
WALL_M = 3.0
CALIBRATION = f"""cam0:
  camera_model: pinhole
  distortion_coeffs: []
  distortion_model: none
  intrinsics: [{FOCAL}, {FOCAL}, {(WIDTH - 1) / 2}, {(HEIGHT - 1) / 2}]
  resolution: [{WIDTH}, {HEIGHT}]
  T_cam_imu:
  - [0.0, -1.0, 0.0, 0.0]
  - [0.0, 0.0, -1.0, 0.0]
  - [1.0, 0.0, 0.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  timeshift_cam_imu: 0.0
"""
KNOWN = """  intrinsics_sigma: [0, 0, 0, 0]
  T_cam_imu_sigma: [0, 0]
  timeshift_sigma: 0
"""
IMU_MODEL = """accelerometer_noise_density: 0.002
accelerometer_random_walk: 0.0003
gyroscope_noise_density: 0.0004
gyroscope_random_walk: 2.0e-05
update_rate: 500.0
"""


def position(t_s):
    """Of the body in the map: along the wall and up, both smooth; x forward, z up, no rotation."""
    t_s = np.asarray(t_s, dtype=float)
    return np.stack([0 * t_s, 0.15 * np.sin(4 * t_s), 1.0 + 0.1 * np.sin(5 * t_s)], axis=-1)


def acceleration(t_s):
    t_s = np.asarray(t_s, dtype=float)
    return np.stack([0 * t_s, -2.4 * np.sin(4 * t_s), -2.5 * np.sin(5 * t_s)], axis=-1)


def wall_contours():
    """x y z nx ny nz of points each centimetre along a grid of lines on the wall."""
    along, rows = np.arange(-1.5, 1.5, 0.01), []
    for k in range(8):  # not at equal distances: their events would all come at once
        offset = -1.4 + 0.36 * k + 0.0057 * k * k
        upright = np.stack([np.full_like(along, WALL_M), np.full_like(along, offset), along + 1], axis=1)
        level = np.stack([np.full_like(along, WALL_M), along, np.full_like(along, offset + 1)], axis=1)
        rows.append(np.hstack([upright, np.tile([0.0, 1.0, 0.0], (len(along), 1))]))
        rows.append(np.hstack([level, np.tile([0.0, 0.0, 1.0], (len(along), 1))]))
    return np.vstack(rows)


class Recording:
    def __init__(self, duration_s=0.6):
        self.contours = wall_contours()
        self.calibration = CALIBRATION + KNOWN
        self.imu_model = IMU_MODEL
        self.imu_t_ns = np.arange(0, int(duration_s * 1e9) + 1, 2_000_000)
        noise = np.random.default_rng(1).normal(size=(len(self.imu_t_ns), 6))  # no real axis stands still
        self.imu = np.hstack([np.zeros((len(self.imu_t_ns), 3)),
                              acceleration(self.imu_t_ns * 1e-9) + [0, 0, 9.81]])
        self.imu += noise * np.sqrt(500) * np.repeat([0.0004, 0.002], 3)
        self.groundtruth_t_s = np.arange(0, duration_s + 1e-9, 0.01)
        self.t, self.x, self.y, self.p = self._events(duration_s)

    def _events(self, duration_s):
        """An event where a contour passes the middle of a pixel: upright lines that of a column, level ones that of a
        row. Enough for a program that reads, chooses and refuses."""
        upright = self.contours[:, 4] > 0.5  # their normal lies along the wall
        columns, previous = [], None
        for t_us in range(0, int(duration_s * 1e6), 500):
            in_body = self.contours[:, :3] - position(t_us * 1e-6)
            pixel = np.stack([(WIDTH - 1) / 2 - FOCAL * in_body[:, 1] / in_body[:, 0],
                              (HEIGHT - 1) / 2 - FOCAL * in_body[:, 2] / in_body[:, 0]])
            across = np.where(upright, pixel[0], pixel[1])
            if previous is not None:
                middle = np.maximum(np.floor(across), np.floor(previous)).astype(int)
                x = np.where(upright, middle, np.rint(pixel[0])).astype(int)
                y = np.where(upright, np.rint(pixel[1]), middle).astype(int)
                passed = ((np.floor(across) != np.floor(previous)) & (x >= 0) & (x < WIDTH) & (y >= 0)
                          & (y < HEIGHT))
                new = np.unique(y[passed] * WIDTH + x[passed])
                columns.append(np.stack([np.full_like(new, t_us), new % WIDTH, new // WIDTH, (new // 7) % 2]))
            previous = across
        return np.hstack(columns)

    def picture(self, body):
        """The wall as a camera of frames would see it from there: fields of two greys between the contours."""
        fine = 4  # samples along a pixel's side
        u, v = ((np.arange(fine * n) + 0.5) / fine - n / 2 for n in (WIDTH, HEIGHT))
        along, up = body[1] - u / FOCAL * (WALL_M - body[0]), body[2] - v / FOCAL * (WALL_M - body[0])
        offsets = np.unique(self.contours[self.contours[:, 4] > 0.5, 1])
        field = np.searchsorted(offsets, along)[None, :] + np.searchsorted(offsets + 1, up)[:, None]
        grey = (60 + 120 * (field % 2)).reshape(HEIGHT, fine, WIDTH, fine).mean(axis=(1, 3))
        return np.rint(grey).astype(np.uint8)

    def write(self, folder, t_type="i8"):
        import h5py  # here, so that a test without it can say so

        folder = pathlib.Path(folder)
        folder.mkdir(parents=True)
        with h5py.File(folder / "events.h5", "w") as file:
            for name, values, kind in (("t", self.t, t_type), ("x", self.x, "u2"), ("y", self.y, "u2"),
                                       ("p", self.p, "u1")):
                file.create_dataset(f"events/{name}", data=np.asarray(values).astype(kind), chunks=(65536,),
                                    maxshape=(None,))
            file.attrs["width"], file.attrs["height"] = np.uint32(WIDTH), np.uint32(HEIGHT)
        lines = ["#timestamp_ns,wx,wy,wz,ax,ay,az"]
        lines += [f"{t}," + ",".join(f"{value:.7f}" for value in row) for t, row in zip(self.imu_t_ns, self.imu)]
        (folder / "imu.csv").write_text("\n".join(lines) + "\n")
        lines = [f"{t:.9f} " + " ".join(f"{value:.9f}" for value in position(t)) + " 0 0 0 1"
                 for t in self.groundtruth_t_s]
        (folder / "groundtruth.tum").write_text("\n".join(lines) + "\n")
        (folder / "camchain-imucam.yaml").write_text(self.calibration)
        (folder / "imu.yaml").write_text(self.imu_model)
        self.write_contours(folder / "contours.ply")
        return folder

    def write_contours(self, path):
        header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(self.contours)}"]
        header += [f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz")] + ["end_header\n"]
        pathlib.Path(path).write_bytes("\n".join(header).encode() + self.contours.astype("<f4").tobytes())
