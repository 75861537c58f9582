#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Writes small sound files of every format as seeds for the fuzzers: make_seeds.py FOLDER

One folder for each target, named after it. A target without seeds here starts from nothing.
"""
import pathlib
import struct
import sys
import zlib

import bag_seeds
import hdf5_seeds


def raw(header, words, form):
    return header.encode() + b"".join(struct.pack(form, w) for w in words)


def evt2():
    head = "% evt 2.0\n% format EVT2;height=480;width=640\n% end\n"
    words = [0x80000001]
    for i in range(40):
        words.append((i & 1) << 28 | (i & 63) << 22 | (i * 7 % 640) << 11 | i * 5 % 480)
    return raw(head, words + [0xA0000601, 0x80000002, 0x10000000, 0xE0000014, 0xF0000001], "<I")


def evt21(order):
    words = [8 << 60 | 3 << 32]
    for i in range(20):
        words.append((i & 1) << 60 | (i & 63) << 54 | 32 << 43 | (i * 5) << 32 | 0x80000101)
    words.append(10 << 60 | 5 << 54 | 6 << 40 | 1 << 32)
    if order == "legacy":
        words = [(w >> 32) | (w & 0xFFFFFFFF) << 32 for w in words]
    return raw(f"% evt 2.1\n% format EVT21;endianness={order};height=720;width=1280\n% end\n", words, "<Q")


def evt3_words():
    words = [0x8001, 0x6000]
    for i in range(30):
        words += [i, 0x2000 | (i & 1) << 11 | i * 3, 0x6000 | 2 * i]
    return words + [0x3010, 0x4FFF, 0x4123, 0x5081, 0xA601, 0xE014, 0xF001, 0xF002, 0x7003, 0x8FFF, 0x8000, 0x2001]


def evt3():
    return raw("% evt 3.0\n% format EVT3;height=480;width=640\n% end\n", evt3_words(), "<H")


def dat(version, kind=0x0C):
    out = f"% Data file\n% Version {version}\n% Width 640\n% Height 480\n".encode() + bytes([kind, 8])
    for i in range(30):
        word = i * 3 | i << 14 | (i & 1) << 28 if version == 2 else i * 3 | i << 9 | (i & 1) << 17
        out += struct.pack("<II", 4294967290 + 3 * i & 0xFFFFFFFF if kind == 0x0C else i, word)
    return out


def table(fields):
    """A FlatBuffers table of (format, value) or None by slot, its numbers inline; returns bytes, position."""
    offsets, body = [], b""
    for field in fields:
        if field is None:
            offsets.append(0)
            continue
        form, value = field
        while (4 + len(body)) % struct.calcsize(form):
            body += b"\0"
        offsets.append(4 + len(body))
        body += struct.pack(form, value)
    vtable = struct.pack(f"<{2 + len(offsets)}H", 4 + 2 * len(offsets), 4 + len(body), *offsets)
    vtable += b"\0" * (-len(vtable) % 4)
    return vtable + struct.pack("<i", len(vtable)) + body, len(vtable), offsets


def message(identifier, fields, references):
    """A root table whose slots in `references` point to bytes that follow it; with its size before it."""
    data, position, offsets = table(fields)
    out = bytearray(struct.pack("<I", 8 + position) + identifier + data)
    for slot, content in references.items():
        out += b"\0" * (-len(out) % 8)
        at = 8 + position + offsets[slot]
        struct.pack_into("<I", out, at, len(out) - at)
        out += content
    return bytes(out)


def vector_of_tables(tables):
    out = bytearray(struct.pack("<I", len(tables)) + b"\0" * (4 * len(tables)))
    for i, fields in enumerate(tables):
        data, position, _ = table(fields)
        struct.pack_into("<I", out, 4 + 4 * i, len(out) + position - (4 + 4 * i))
        out += data
    return bytes(out)


def aedat4():
    xml = '<dv version="2.0"><node name="outInfo">'
    for number, kind in enumerate(["EVTS", "FRME", "IMUS", "TRIG"]):
        xml += f'<node name="{number}"><attr key="typeIdentifier" type="string">{kind}</attr><node name="info">'
        xml += '<attr key="sizeX" type="int">346</attr><attr key="sizeY" type="int">260</attr></node></node>'
    xml += "</node></dv>"
    header = message(b"IOHE", [None, ("<q", -1), ("<I", 0)],
                     {2: struct.pack("<I", len(xml)) + xml.encode() + b"\0"})
    events = b"".join(struct.pack("<qhhB3x", 1000000 + 5 * i, 3 * i, 2 * i, i & 1) for i in range(20))
    packets = [
        (0, message(b"EVTS", [("<I", 0)], {0: struct.pack("<I", 20) + events})),
        (2, message(b"IMUS", [("<I", 0)],
                    {0: vector_of_tables([[("<q", 1000000)] + [("<f", 0.5)] * 7] * 2)})),
        (3, message(b"TRIG", [("<I", 0)], {0: vector_of_tables([[("<q", 1000100), ("<b", 1)]])})),
        (1, message(b"FRME", [("<q", 1000000)] + [None] * 4 + [None, ("<h", 4), ("<h", 2), None, None, ("<I", 0)],
                    {10: struct.pack("<I", 8) + bytes(range(8))})),
    ]
    out = b"#!AER-DAT4.0\r\n" + struct.pack("<I", len(header)) + header
    for stream, content in packets:
        content = struct.pack("<I", len(content)) + content
        out += struct.pack("<ii", stream, len(content)) + content
    return out


def aedat3():
    out = b"#!AER-DAT3.1\r\n#Format: RAW\r\n#!END-HEADER\r\n"

    def packet(kind, size, events):
        return struct.pack("<hhiiiiii", kind, 1, size, 4, 0, len(events), len(events), len(events)) + b"".join(events)

    out += packet(1, 8, [struct.pack("<Ii", 1 | (i & 1) << 1 | i << 2 | i << 17, 10 * i) for i in range(20)])
    out += packet(0, 8, [struct.pack("<Ii", 1 | 2 << 1, 50)])
    return out + packet(3, 36, [struct.pack("<Ii7f", 1, 60, 0, 0, 1, 1, 2, 3, 25)])


def aedat2():
    out = b"#!AER-DAT2.0\n# AEChip: eu.seebetter.ini.chips.davis.DAVIS240C\n"
    for i in range(20):
        out += struct.pack(">II", i << 22 | i << 12 | (i & 1) << 11, 100 + i)
    for kind in range(7):
        out += struct.pack(">II", 0x80000C00 | kind << 28 | 77 << 12, 130)
    return out + struct.pack(">II", 0x400, 140)


def es(kind):
    out = b"Event Stream" + bytes([2, 0, 0, kind])
    if kind == 0:
        return out + bytes([5, 6 << 1]) + b"abcdef" + bytes([255, 254, 3, 0])
    out += struct.pack("<HH", 320, 240)
    for i in range(20):
        out += bytes([(i % 20) << 1 | i & 1]) + struct.pack("<HH", 3 * i, 2 * i)
    return out + bytes([255, 254, 252]) + bytes([8]) + struct.pack("<HH", 1, 1)


def bin40():
    return b"".join(bytes([i, 2 * i, (i & 1) << 7, 0, 5 * i]) for i in range(30)) + bytes([0, 240, 0, 0, 0])


def ecf(flags):
    out = struct.pack("<IQ", 4 << 2 | flags, 1000) + bytes([0x02, 0xF3, 0x12])
    if flags == 2:
        return out + struct.pack("<3I", 0x12345678, 0x9ABCDEF0, 0x13579BDF)
    out += struct.pack("<HH", 7 << 5 | 31, 4)
    if flags == 1:
        return out + struct.pack("<3H", 1, 2, 3)
    return out + struct.pack("<HH", 9 << 5 | 0x1C, 1 << 5) + bytes([0x82, 0x02])


def blosc_chunk():
    """A Blosc frame of 512 plain bytes."""
    return b"\x01" + struct.pack("<BBBBIII", 2, 1, 0x02, 8, 512, 512, 512 + 16) + bytes(range(256)) * 2


def lz4_chunk():
    return b"\x02" + struct.pack(">QII", 512, 512, 512) + bytes(range(256)) * 2


T = "[0,-1,0,0, 0,0,-1,0.02, 1,0,0,-0.1, 0,0,0,1]"


def opencv(name, rows, cols, data):
    return f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   data: {data}\n"


CALIBRATIONS = [
    f"cam0:\n  camera_model: pinhole\n  distortion_model: radtan\n  distortion_coeffs: [0.1, 0.02, 0, 0]\n"
    f"  intrinsics: [100, 101, 50, 40]\n  resolution: [102, 82]\n  T_cam_imu: {T}\n  timeshift_cam_imu: 0.001\n"
    f"cam1:\n  camera_model: ds\n  distortion_model: none\n  intrinsics: [-0.2, 0.5, 100, 101, 50, 40]\n"
    f"  resolution: [102, 82]\n  T_cn_cnm1: {T}\n",
    "accelerometer_noise_density: 1\naccelerometer_random_walk: 1\ngyroscope_noise_density: 1\n"
    "gyroscope_random_walk: 1\nupdate_rate: 200\n",
    '{"value0": {"T_imu_cam": [{"px": 0.1, "py": 0, "pz": 0, "qx": -0.5, "qy": 0.5, "qz": -0.5, "qw": 0.5}], '
    '"intrinsics": [{"camera_type": "kb4", "intrinsics": {"fx": 100, "fy": 101, "cx": 50, "cy": 40, "k1": 0, '
    '"k2": 0, "k3": 0, "k4": 0}}], "resolution": [[102, 82]], "cam_time_offset_ns": 3}}',
    "image_width: 102\nimage_height: 82\ncamera_name: a\n"
    "camera_matrix: {rows: 3, cols: 3, data: [100, 0, 50, 0, 101, 40, 0, 0, 1]}\ndistortion_model: plumb_bob\n"
    "distortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0.02, 0, 0, 0]}\n"
    "T_b_c: {rows: 3, cols: 4, data: [0,0,1,0, -1,0,0,0, 0,-1,0,0]}\n",
    "%YAML:1.0\n" + opencv("body_T_cam0", 4, 4, T) + opencv("extrinsicRotation", 3, 3, "[1,0,0,0,1,0,0,0,1]") +
    opencv("extrinsicTranslation", 3, 1, "[0,0,0]") + "td: 0.1\n",
    "%YAML:1.0\n---\n" + opencv("K", 3, 3, "[100,0,50,0,101,40,0,0,1]") + opencv("distortion", 4, 1, "[0,0,0,0]") +
    "height: 82\nwidth: 102\n",
    f"intrinsics:\n  cam0: {{camera_model: pinhole, distortion_model: none, camera_matrix: [1, 1, 1, 1], "
    f"resolution: [2, 2], camera_type: event}}\nextrinsics: {{T_10: {T}}}\n",
    "cameras:\n- camera: {label: dvs, image_height: 82, image_width: 102, type: pinhole, intrinsics: "
    f"{{data: [100, 101, 50, 40]}}}}\n  T_B_C: {{data: {T}}}\n",
    f"cam0: {{T_cam_body: {T}}}\ncam2: {{T_cam0_cam2: {T}}}\n",
    "199.09 198.82 132.19 110.71 -0.3684 0.1509 -0.0002961 -0.000759 0.0\n",
]



def mavlink():
    """A published heartbeat, cut by the first byte into pieces of ten."""
    heartbeat = bytes.fromhex("fd090000072ac500000000000000120800040388 92".replace(" ", ""))
    return b"\x09" + heartbeat + b"\xfd\x00" + heartbeat


def live_packets():
    def packet(kind, number, base, payload):
        return struct.pack("<IB3xIIq", 0x31505645, kind, number, len(payload), base) + payload

    events = b"".join(struct.pack("<IHH", 5 * i, 3 * i, 2 * i | (i & 1) << 15) for i in range(20))
    words = struct.pack(f"<{len(evt3_words())}H", *evt3_words())
    return (b"\x30" + packet(1, 0, 1000, events) + packet(2, 1, 2000, struct.pack("<q6d", 2000, *range(6))) +
            packet(3, 2, 0, words))


def corner():
    """Points along three edges that meet."""
    return [[0.1 * i if k == axis else 0.0 for k in range(3)] for axis in range(3) for i in range(8)]


def ply(kind):
    head = f"ply\nformat {kind} 1.0\nelement vertex 24\n"
    head += "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz")) + "property uchar kind\nend_header\n"
    rows = [(*p, 0.6, 0.0, 0.8, 1) for p in corner()]
    if kind == "ascii":
        return (head + "".join(" ".join(map(str, row)) + "\n" for row in rows)).encode()
    return head.encode() + b"".join(struct.pack("<6fB" if "little" in kind else ">6fB", *row) for row in rows)


def pcd(kind):
    head = ("VERSION .7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 24\nHEIGHT 1\n"
            f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 24\nDATA {kind}\n").encode()
    rows = [(*p, 0.5) for p in corner()]
    if kind == "ascii":
        return head + "".join(" ".join(map(str, row)) + "\n" for row in rows).encode()
    if kind == "binary":
        return head + b"".join(struct.pack("<4f", *row) for row in rows)
    columns = b"".join(struct.pack("<24f", *column) for column in zip(*rows))
    packed = b"".join(bytes([len(columns[i:i + 32]) - 1]) + columns[i:i + 32] for i in range(0, len(columns), 32))
    return head + struct.pack("<II", len(packed), len(columns)) + packed  # LZF of literals only


def las():
    head = bytearray(227)
    head[0:4], head[24:26] = b"LASF", b"\x01\x02"
    struct.pack_into("<HI", head, 94, 227, 227)
    struct.pack_into("<BHI", head, 104, 0, 20, 24)
    struct.pack_into("<6d", head, 131, 0.001, 0.001, 0.001, 100, 200, 0)
    return bytes(head) + b"".join(struct.pack("<3iH6x", *(round(1000 * v) for v in p), 7) for p in corner())


def png(kind, bits, samples, more=b"", interlaced=0):
    """6 x 5 pixels of that colour type."""
    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    def rows(width, height):
        return height * (b"\x00" + bytes(range(1, 1 + (width * bits * samples + 7) // 8))) if width else b""

    passes = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]
    data = b"".join(rows(len(range(x, 6, dx)), len(range(y, 5, dy))) for x, y, dx, dy in passes) if interlaced else rows(6, 5)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 6, 5, bits, kind, 0, 0, interlaced)) + more +
            chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b""))


def palette():
    data = b"PLTE" + bytes(range(48))
    return struct.pack(">I", 48) + data + struct.pack(">I", zlib.crc32(data))


SEEDS = {
    "png": [lambda: png(0, 8, 1), lambda: png(0, 16, 1), lambda: png(0, 1, 1), lambda: png(2, 8, 3), lambda: png(6, 16, 4),
            lambda: png(3, 4, 1, palette()), lambda: png(0, 8, 1, interlaced=1)],
    "frame_list": [lambda: b"#timestamp [ns],filename\n0,fuzz\n33000000,fuzz,4000000\n",
                   lambda: b"1403636579763555584,fuzz\n1403636579813555456, fuzz , 12\n", lambda: b"5,fuzz\n4,fuzz\n"],
    "clouds": [lambda: ply("ascii"), lambda: ply("binary_little_endian"), lambda: ply("binary_big_endian"),
               lambda: pcd("ascii"), lambda: pcd("binary"), lambda: pcd("binary_compressed"), las],
    "mavlink": [mavlink],
    "live_packets": [live_packets, lambda: live_packets()[:190], lambda: b"\xff" + live_packets()[1:]],
    "calibrations": [lambda text=text: text.encode() for text in CALIBRATIONS],
    "events_raw": [evt2, lambda: evt21("legacy"), lambda: evt21("little"), evt3],
    "events_dat": [lambda: dat(1), lambda: dat(2), lambda: dat(2, 0x0E)],
    "events_aedat4": [aedat4],
    "events_aedat3": [aedat3],
    "events_aedat2": [aedat2],
    "events_es": [lambda: es(0), lambda: es(1), lambda: es(2), lambda: es(4)],
    "events_bin40": [bin40],
    "events_text": [lambda: b"0.000001 3 4 1\n0.5 6 7 0\n1.25 1 1 1\n",
                    lambda: b"%geometry:640,480\n3,4,1,1500\n5,6,0,1501\n"],
    "ecf": [lambda: ecf(0), lambda: ecf(1), lambda: ecf(2)],
    "hdf5_chunks": [lambda: b"\x00" + b"\x1f" + bytes(32) + b"\xe0\x00\x00" * 3, blosc_chunk, lz4_chunk,
                    lambda: b"\x03" + bytes.fromhex("28b52ffd60000115000000010000"), lambda: b"\x04" + ecf(0)],
    "evt3_pieces": [lambda: b"\x21" + struct.pack(f"<{len(evt3_words())}H", *evt3_words())],
}


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    for target, makers in (SEEDS | bag_seeds.SEEDS | hdf5_seeds.SEEDS).items():
        folder = pathlib.Path(sys.argv[1]) / target
        folder.mkdir(parents=True, exist_ok=True)
        for number, make in enumerate(makers):
            (folder / f"seed{number}").write_bytes(make())


if __name__ == "__main__":
    main()
