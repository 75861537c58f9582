# SPDX-License-Identifier: BSD-3-Clause
"""Small sound bags, messages, logs and trajectories, as seeds."""
import bz2
import pathlib
import sqlite3
import struct
import tempfile


class Message:
    """Fields one behind the other, packed or aligned as in CDR."""

    def __init__(self, cdr):
        self.cdr, self.data = cdr, bytearray()

    def put(self, form, *values):
        for value in values:
            if self.cdr:
                self.data += b"\0" * (-len(self.data) % struct.calcsize(form))
            self.data += struct.pack("<" + form, value)
        return self

    def string(self, text):
        self.put("I", len(text) + self.cdr)
        self.data += text.encode() + b"\0" * self.cdr
        return self

    def header(self, seconds):
        if not self.cdr:
            self.put("I", 1)
        return self.put("I", seconds, 5).string("f")

    def bytes(self):
        return (b"\0\1\0\0" if self.cdr else b"") + bytes(self.data)


def event_array(cdr):
    m = Message(cdr).header(100).put("I", 48, 64, 6)
    for i in range(6):
        m.put("H", 3 * i, 2 * i).put("I", 100, 1000 * i).put("B", i & 1)
    return m.bytes()


PACKETS = {
        "evt3": struct.pack("<12H", 0x8001, 0x6000, 5, 0x2003, 0x3010, 0x4FFF, 0x5081, 0xA601, 0xE014, 0xF001, 0x8FFF, 0x8000),
        "mono": struct.pack("<3Q", 1000 | 3 << 32 | 4 << 48, 2000 | 5 << 32 | 6 << 48 | 1 << 63, 3000),
        "trigger": struct.pack("<2Q", 1000 | 3 << 48, 2000 | 3 << 48 | 1 << 63),
        "libcaer": struct.pack("<6I", 1 | 3 << 2 | 4 << 17, 0x7FFFFFF0, 3 | 5 << 2, 0x7FFFFFFF, 1, 0),
        "libcaer_cmp": struct.pack("<7H", 0x0001, 0x1002, 0x2005, 0x4810, 0x5005, 0x5081, 0x3007),
}


def event_packet(cdr, encoding):
    m = Message(cdr).header(100).put("I", 480, 640).put("Q", 1, 0 if encoding == "evt3" else 10**17)
    m.string(encoding).put("B", 0).put("I", len(PACKETS[encoding]))
    m.data += PACKETS[encoding]
    return m.bytes()


def imu(cdr):
    return Message(cdr).header(100).put("d", *[0.5] * 37).bytes()


def pose(cdr, child=False):
    m = Message(cdr).header(100)
    if child:
        m.string("c")
    return m.put("d", 1, 2, 3, 0, 0, 0.6, 0.8).bytes()


def image(cdr):
    m = Message(cdr).header(100).put("I", 2, 3).string("bgr8").put("B", 0).put("I", 9, 18)
    m.data += bytes(range(18))
    return m.bytes()


MESSAGES = [
        ("/events", "dvs_msgs/EventArray", event_array),
        ("/packets", "event_camera_msgs/EventPacket", lambda cdr: event_packet(cdr, "evt3")),
        ("/imu", "sensor_msgs/Imu", imu),
        ("/pose", "geometry_msgs/PoseStamped", pose),
        ("/image", "sensor_msgs/Image", image),
]


def fields(**values):
    out = b""
    for name, value in values.items():
        field = name.encode() + b"=" + value
        out += struct.pack("<I", len(field)) + field
    return out


def record(data, **values):
    header = fields(**values)
    return struct.pack("<I", len(header)) + header + struct.pack("<I", len(data)) + data


def rosbag1(compression, first, indexed=True):
    u32 = lambda value: struct.pack("<I", value)
    connections, chunk, index, counts = b"", b"", b"", b""
    for number, (topic, kind, make) in enumerate(MESSAGES[first:]):
        connection = record(fields(topic=topic.encode(), type=kind.encode(), md5sum=b"*", message_definition=b""),
                                                op=b"\7", conn=u32(number), topic=topic.encode())
        connections += connection
        offset = len(chunk + connection)
        chunk += connection + record(make(False), op=b"\2", conn=u32(number), time=struct.pack("<II", 100, 5))
        index += record(struct.pack("<III", 100, 5, offset), op=b"\4", ver=u32(1), conn=u32(number), count=u32(1))
        counts += u32(number) + u32(1)
    packed = bz2.compress(chunk) if compression == b"bz2" else chunk
    count = len(MESSAGES) - first
    # The head is as short as it may be: seeds are to be small.
    head = lambda position: b"#ROSBAG V2.0\n" + record(b"    ", op=b"\3", index_pos=struct.pack("<Q", position),
                                                                                                          conn_count=u32(count), chunk_count=u32(1))
    body = record(packed, op=b"\5", compression=compression, size=u32(len(chunk))) + index
    start = len(head(0))
    info = record(counts, op=b"\6", ver=u32(1), chunk_pos=struct.pack("<Q", start),
                                start_time=struct.pack("<II", 100, 5), end_time=struct.pack("<II", 100, 5), count=u32(count))
    return head(start + len(body) if indexed else 0) + body + connections + info


def mcap_record(op, content):
    return struct.pack("<BQ", op, len(content)) + content


def mcap(first, summary=True, chunked=True):
    text = lambda s: struct.pack("<I", len(s)) + s.encode()
    magic = b"\x89MCAP0\r\n"
    records, described, counts, offsets = b"", b"", b"", b""
    for number, (topic, kind, make) in enumerate(MESSAGES[first:], 1):
        package, name = kind.split("/")
        description = mcap_record(3, struct.pack("<H", number) + text(f"{package}/msg/{name}") + text("ros2msg") + text(""))
        description += mcap_record(4, struct.pack("<HH", number, number) + text(topic) + text("cdr") + text(""))
        described += description
        records += description + mcap_record(5, struct.pack("<HIQQ", number, 0, 10**11, 10**11) + make(True))
        counts += struct.pack("<HQ", number, 1)
        offsets += struct.pack("<HQ", number, 0)
    out = magic + mcap_record(1, text("ros2") + text(""))
    start = len(out)
    if chunked:
        records = mcap_record(6, struct.pack("<QQQI", 10**11, 10**11, len(records), 0) + text("")
                                                    + struct.pack("<Q", len(records)) + records)
    out += records
    length = len(out) - start
    out += mcap_record(15, struct.pack("<I", 0))
    begin = len(out)
    if summary:
        out += described
        count = len(MESSAGES) - first
        out += mcap_record(11, struct.pack("<QHIIIIQQI", count, count, count, 0, 0, 1, 10**11, 10**11, len(counts)) + counts)
        out += mcap_record(8, struct.pack("<QQQQI", 10**11, 10**11, start, length, len(offsets)) + offsets
                                              + struct.pack("<Q", 0) + text("") + struct.pack("<QQ", 0, 0))
    return out + mcap_record(2, struct.pack("<QQI", begin if summary else 0, 0, 0)) + magic


def sqlite(first, index):
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "seed.db3"
        with sqlite3.connect(path) as db:
            db.execute("PRAGMA page_size = 512")
            db.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT,type TEXT,serialization_format TEXT)")
            db.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER,timestamp INTEGER,data BLOB)")
            if index:
                db.execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)")
            for number, (topic, kind, make) in enumerate(MESSAGES[first:]):
                db.execute("INSERT INTO topics VALUES(?,?,?,'cdr')", (number, topic, kind.replace("/", "/msg/")))
                db.execute("INSERT INTO messages VALUES(?,?,?,?)", (number, number, 10**11 + number, make(True)))
        db.close()
        return path.read_bytes()


def dataflash():
    def form(kind, body, name, formats, labels):
        return b"\xA3\x95\x80" + struct.pack("<BB4s16s64s", kind, body + 3, name, formats, labels)

    out = form(0x80, 86, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    out += form(10, 73, b"UNIT", b"QbZ", b"TimeUS,Id,Label") + form(11, 17, b"MULT", b"Qbd", b"TimeUS,Id,Mult")
    out += form(12, 41, b"FMTU", b"QBNN", b"TimeUS,FmtType,UnitIds,MultIds")
    out += form(13, 33, b"IMU", b"QBffffff", b"TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ")
    out += b"\xA3\x95\x0A" + struct.pack("<Qb64s", 1, ord("k"), b"deg/s")
    out += b"\xA3\x95\x0B" + struct.pack("<Qbd", 1, ord("F"), 1e-6)
    out += b"\xA3\x95\x0C" + struct.pack("<QB16s16s", 1, 13, b"s#kkkooo", b"F-------")
    for i in range(4):
        out += b"\xA3\x95\x0D" + struct.pack("<QB6f", 1000 * i, i & 1, 1, 2, 3, 0, 0, -9.8)
    return out


# Frames made by the programs lz4 and zstd.
LZ4 = bytes.fromhex("04224d186440a7140000009f6162636465666768610100ff145061616161610000000087072daf")
ZSTD = bytes.fromhex("28b52ffd643400850000486162636465666768610100282a38027cd5d98e")

SEEDS = {
        "rosbag1": [lambda: rosbag1(b"none", 0), lambda: rosbag1(b"none", 1), lambda: rosbag1(b"bz2", 0),
                                lambda: rosbag1(b"none", 0, indexed=False)],
        "mcap": [lambda: mcap(0), lambda: mcap(1), lambda: mcap(0, summary=False), lambda: mcap(1, False, False)],
        "rosbag2_sqlite": [lambda: sqlite(0, True), lambda: sqlite(1, False)],
        "dataflash": [dataflash],
        "bag_messages": [lambda: b"\0" + event_array(False), lambda: b"\x85" + event_array(True),
                                          lambda: b"\2" + imu(False), lambda: b"\3" + image(False), lambda: b"\4" + pose(False),
                                          lambda: b"\5" + pose(False, True), lambda: b"\x86" + event_packet(True, "libcaer_cmp"),
                                          *[lambda e=e: b"\1" + event_packet(False, e) for e in PACKETS]],
        "decompression": [lambda: b"\0" + LZ4, lambda: b"\1" + ZSTD, lambda: b"\2" + bz2.compress(b"abc" * 30)],
        "trajectory": [lambda: b"# t x y z\n1.5 1 2 3 0 0 0 1\n1.6 1 2 3 0 0.6 0 0.8\n",
                                      lambda: b"#timestamp\n15,1,2,3,1,0,0,0\n16,1,2,3,0.6,0.8,0,0\n",
                                      lambda: b"1000.5 1 2 3 0 0 0 1\n9000.5 1 2 3 0 0 0 1\n",
                                      lambda: b"1 0 0 0 0 1 0 0 0 0 1 0\n", lambda: rosbag1(b"none", 3), lambda: mcap(3)],
        "imu_text": [lambda: b"# t\n1000.5 0 0 0 0 0 9.8 30\n6000.5 0 0 0 0 0 9.8 30\n",
                                  lambda: b"1.001 0 9.8 0 1 2 3\n1.002 0 9.8 0 1 2 3\n"],
}
