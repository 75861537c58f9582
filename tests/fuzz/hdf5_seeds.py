# SPDX-License-Identifier: BSD-3-Clause
"""Small HDF5 files of every layout. In the library's oldest form: the newer ones have checksums, behind which a
fuzzer does not come."""
import io
import zlib

try:
    import h5py
    import numpy as np
except ImportError:  # the targets then start from nothing
    h5py = None


def written(fill):
    content = io.BytesIO()
    with h5py.File(content, "w", libver=("earliest", "v108")) as file:
        fill(file)
    return content.getvalue()


def columns(file):
    """Ours and DSEC's."""
    n = 12
    for name, form, values in (("x", "u2", range(n)), ("y", "u2", range(n)), ("t", "i8", range(0, 50 * n, 50)),
                               ("p", "u1", [i & 1 for i in range(n)])):
        packing = {"chunks": (8,), "compression": "gzip", "shuffle": True} if name == "t" else {}
        file.create_dataset("events/" + name, data=np.array(list(values), form), **packing)
    file["ms_to_idx"] = np.array([0, n], "u8")
    file["t_offset"] = np.int64(1000)
    file.attrs["width"], file.attrs["height"] = np.uint32(64), np.uint32(48)


def metavision(file):
    rows = np.array([(i, 2 * i, i & 1, 100 * i) for i in range(8)],
                    [("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")])
    file["CD/events"] = rows
    file["EXT_TRIGGER/events"] = np.array([(1, 100, 0)], [("p", "<i2"), ("t", "<i8"), ("id", "<i2")])
    file.attrs["geometry"] = np.bytes_(b"64x48")


def mvsec(file):
    file["davis/left/events"] = np.array([[i, i, 1.5e9 + 1e-3 * i, 1] for i in range(4)])
    file["davis/left/imu"] = np.ones((2, 6))
    file["davis/left/imu_ts"] = np.array([1.5e9, 1.5e9 + 0.01])


def contour_map(file, pages=False):
    meta = file.create_group("meta")
    meta.attrs["format"], meta.attrs["units"] = np.bytes_(b"evpose-map"), np.bytes_(b"m")
    meta.attrs["version_major"], meta.attrs["crc"] = np.uint32(1), np.uint32(0)
    meta.attrs["anchor"] = np.zeros(3)
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "f4")
    datasets = {
        "points/xyz": square, "points/tangent": square[[1, 3, 1, 3]], "points/normal_a": square[[3, 1, 3, 1]],
        "contours/start": np.array([0, 2], "u8"), "contours/count": np.array([2, 2], "u4"),
        "contours/kind": np.array([1, 2], "u1"), "contours/plane_a": np.array([0, 0], "i4"),
        "contours/plane_b": np.array([-1, -1], "i4"), "contours/length": np.array([1, 1], "f4"),
        "contours/sigma": np.array([0.01, 0.01], "f4"), "contours/contrast_sign": np.array([1, 0], "i1"),
        "contours/flags": np.array([0, 1], "u2"),
        "planes/normal": np.array([[0, 0, 1]], "f4"), "planes/d": np.array([0.0]),
        "planes/inliers": np.array([9], "u4"), "planes/rms": np.array([0.01], "f4"),
        "polygons/vertices": square, "polygons/start": np.array([0], "u8"), "polygons/count": np.array([4], "u4"),
        "polygons/plane": np.array([0], "i4"), "polygons/hole_of": np.array([-1], "i4"),
        "polygons/double_sided": np.array([0], "u1"),
    }
    if pages:  # the first has a contour and no surface
        ends = {"points": [2, 4], "contours": [1, 2], "planes": [0, 1], "polygons": [0, 1], "vertices": [0, 4]}
        datasets |= {f"pages/{name}_end": np.array(rows, "u8") for name, rows in ends.items()}
        datasets |= {"pages/box": np.array([[0, 0, 1, 1]] * 2, "f4"), "pages/crc32": np.zeros(2, "u4"),
                     "contours/plane_a": np.array([-1, 0], "i4")}
    for name, values in datasets.items():
        file[name] = values
        file[name].attrs["crc32"] = np.uint32(zlib.crc32(values.tobytes()))


SEEDS = {} if h5py is None else {
    "hdf5_events": [lambda: written(columns), lambda: written(metavision), lambda: written(mvsec)],
    "hdf5_map": [lambda: written(contour_map), lambda: written(lambda file: contour_map(file, True))],
}
