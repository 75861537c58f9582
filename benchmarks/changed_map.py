# SPDX-License-Identifier: BSD-3-Clause
"""Maps of a scene that has changed: some contours of a map file moved, as furniture is between two flights."""
import copy
import shutil
import zlib

import h5py
import numpy as np

MARKING = 3  # kind
NEAREST_M, FARTHEST_M = 0.02, 0.08  # of a move
SAME_M, PARALLEL_COS, ALONG_M = 0.008, 0.95, 0.03  # of two pieces of contour that are one


class Contours:
    """The points of a map file, with what its contours say of each."""

    def __init__(self, path):
        with h5py.File(path) as file:
            self.places, self.tangents, self.normals, self.lengths, self.sigmas = (
                file[f"points/{name}"][:] for name in ("xyz", "tangent", "normal_a", "length", "sigma"))
            self.places += file["meta"].attrs["anchor"].astype("f4")  # floats tell 1 um in a place of some metres
            counts = file["contours/count"][:]
            self.contour = np.repeat(np.arange(len(counts)), counts)
            self.kinds = np.repeat(file["contours/kind"][:], counts)
            self.looks = file["points/looks"][:] if "points/looks" in file else np.zeros(len(self.places), int)

    def part(self, which):
        out = copy.copy(self)
        vars(out).update({name: values[which] for name, values in vars(self).items()})
        return out

    def told_in_place(self):
        """Those that flights have told, but markings, which no cloud has."""
        return (self.looks > 0) & (self.kinds != MARKING)

    def across_mm(self, others, within_m):
        """Distance across itself of each from the nearest parallel one of the others; None: there is none."""
        partner = self.beside(others, within_m)
        ways = others.places[partner] - self.places
        off = np.linalg.norm(ways - (ways * self.tangents).sum(1)[:, None] * self.tangents, axis=1)
        return [1e3 * float(d) if k >= 0 else None for k, d in zip(partner, off)]

    def length_m(self, which):
        return float(self.lengths[which].sum())

    def beside(self, others, within_m=SAME_M):
        """For each point, the nearest parallel point of the others no further off across it; -1: none."""
        cells = {}
        for i, cell in enumerate(map(tuple, np.floor(others.places / ALONG_M).astype(int))):
            cells.setdefault(cell, []).append(i)
        steps = [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)]
        out = np.full(len(self.places), -1)
        for i, (place, tangent) in enumerate(zip(self.places, self.tangents)):
            cell = np.floor(place / ALONG_M).astype(int)
            near = [k for step in steps for k in cells.get(tuple(cell + step), [])]
            near = [k for k in near if abs(others.tangents[k] @ tangent) > PARALLEL_COS]
            if near:
                ways = others.places[near] - place
                off = np.linalg.norm(ways - np.outer(ways @ tangent, tangent), axis=1)
                best = int(off.argmin())
                out[i] = near[best] if off[best] < within_m else -1
        return out


def file_checksum(file):
    """Of the whole map file (docs/use/formats.md), from the checksums of its datasets and its attributes."""
    names = []
    file.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
    lines = [f"/{name} {','.join(map(str, file[name].shape))} {int(file[name].attrs['crc32']):08x}" for name in sorted(names)]
    for name in sorted(file["meta"].attrs):
        if name != "crc":
            values = np.atleast_1d(file["meta"].attrs[name]).ravel()
            words = [v.decode() if isinstance(v, bytes) else v if isinstance(v, str) else f"{float(v):.17g}" for v in values]
            lines.append(f"{name}={','.join(words)}")
    return zlib.crc32("".join(line + "\n" for line in lines).encode())


def move_contours(source, target, share, seed):
    """A copy of the map with that share of its contours moved across themselves, 2 to 8 cm in their surface; which of its
    points moved."""
    shutil.copy(source, target)
    given, random = Contours(source), np.random.default_rng(seed)
    count = given.contour.max() + 1
    moved = random.random(count) < share
    step = random.uniform(NEAREST_M, FARTHEST_M, count) * random.choice([-1, 1], count)
    first = np.unique(given.contour, return_index=True)[1]
    across = given.normals[first]
    unknown = np.linalg.norm(across, axis=1) < 0.5
    across[unknown] = np.cross(given.tangents[first][unknown], [0.3, 0.5, 0.8])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    places = given.places + (moved * step)[given.contour, None] * across[given.contour]
    with h5py.File(target, "r+") as file:
        places = places - file["meta"].attrs["anchor"]
        file["points/xyz"][:] = places.astype("<f4")
        file["points/xyz"].attrs.modify("crc32", np.uint32(zlib.crc32(places.astype("<f4").tobytes())))
        if "pages" in file:
            raise ValueError("a map in pages has checksums of its pages, too")
        file["meta"].attrs.modify("crc", np.uint32(file_checksum(file)))
    return moved[given.contour]
