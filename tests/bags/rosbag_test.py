#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Our ROS 1 bags as ROS's own reader sees them, and its bags as we do: rosbag_test.py MAKE_BAGS FOLDER"""
import pathlib
import struct
import subprocess
import sys

try:
    import genpy.dynamic
    import rosbag
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

START = 1_700_000_000_000_000_000
PACKETS, EVENTS = 300, 300_000
MD5 = {
    "dvs_msgs/EventArray": "5e8beee5a6c107e504c2e78903c224b8",
    "event_camera_msgs/EventPacket": "8a6101b351a64529ac77bd8b71074e52",
    "sensor_msgs/Imu": "6a62c6daae103f4ff57a132d6f95cec2",
    "geometry_msgs/PoseStamped": "d3812c3cbc69362b77dc0b19b345f8f5",
}


def vector(v):
    return v.x, v.y, v.z


def event(n):
    return START + n * 13_000, n * 7 % 640, n * 11 % 480, n % 3 == 0


def events_of(message):
    """Rows (t, x, y, on) of either kind of message."""
    assert (message.width, message.height) == (640, 480)
    if message._type == "dvs_msgs/EventArray":
        return [(e.ts.to_nsec(), e.x, e.y, e.polarity) for e in message.events]
    assert message.encoding == "mono" and not message.is_bigendian
    return [(message.time_base + (word & 0xFFFFFFFF), word >> 32 & 0xFFFF, word >> 48 & 0x7FFF, bool(word >> 63))
            for (word,) in struct.iter_unpack("<Q", message.events)]


def check_types(bag):
    for connection in bag._connections.values():
        computed = genpy.dynamic.generate_dynamic(connection.datatype, connection.msg_def)[connection.datatype]
        assert computed._md5sum == connection.md5sum == MD5[connection.datatype], connection.datatype


def check(path):
    with rosbag.Bag(path) as bag:  # reads the index
        check_types(bag)
        counts = {name: topic.message_count for name, topic in bag.get_type_and_topic_info().topics.items()}
        assert counts["/imu"] == counts["/pose"] == PACKETS, counts
        for i, (_, m, t) in enumerate(bag.read_messages("/imu")):
            assert m.header.stamp.to_nsec() == t.to_nsec() == START + i * 5_000_001
            assert m.header.seq == i and m.header.frame_id == "imu"
            assert vector(m.angular_velocity) == (0.5 * i, -0.25, 0.125)
            assert vector(m.linear_acceleration) == (i / 8, 2, -9.75)
            assert m.orientation_covariance[0] == -1
        for i, (_, m, t) in enumerate(bag.read_messages("/pose")):
            assert m.header.stamp.to_nsec() == START + i * 7_000_003
            assert vector(m.pose.position) == (i / 4, -2, 3)
            q = m.pose.orientation
            assert (q.x, q.y, q.z, q.w) == ((0, 0, 0, 1) if i % 2 == 0 else (-0.5, 0.5, -0.5, 0.5))
        rows = [row for _, m, _ in bag.read_messages("/events") for row in events_of(m)]
        assert len(rows) == EVENTS, len(rows)
        for n, row in enumerate(rows):
            assert row == event(n), (n, row)
        late = START + 1_000_000_000  # the index is what finds messages by time
        found = [t.to_nsec() for _, _, t in bag.read_messages("/imu", start_time=genpy.Time(late // 10**9))]
        assert 0 < len(found) < PACKETS and found[0] >= late


def rewrite(source, target, compression):
    with rosbag.Bag(source) as ours, rosbag.Bag(target, "w", compression=compression) as theirs:
        for topic, message, t in ours.read_messages(raw=True):
            theirs.write(topic, message, t, raw=True)


def main(make_bags, folder):
    pathlib.Path(folder).mkdir(parents=True, exist_ok=True)
    subprocess.run([make_bags, folder], check=True)
    for name in ("plain.bag", "lz4.bag", "packets.bag"):
        check(f"{folder}/{name}")
        print(f"{name}: as written")
    for compression in ("none", "bz2", "lz4"):
        target = f"{folder}/theirs_{compression}.bag"
        rewrite(f"{folder}/plain.bag", target, compression)
        subprocess.run([make_bags, f"{folder}/plain.bag", target], check=True)
        print(f"rewritten with {compression}: the same")


if __name__ == "__main__":
    main(*sys.argv[1:])
