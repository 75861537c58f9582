#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The ROS node under a master of its own: node_test.py EVPOSE_ROS EVPOSE SOURCE

A bag goes in by topics, and what the node publishes goes into a bag and out again through evpose. Skipped (exit
status 77) where ROS's Python is missing.
"""
import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

NODE, EVPOSE, SOURCE = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])
sys.path.insert(0, str(SOURCE / "tests/end_to_end"))
with socket.socket() as s:
    s.bind(("127.0.0.1", 0))
    PORT = s.getsockname()[1]
SCRATCH = tempfile.TemporaryDirectory()
ROOT = pathlib.Path(SCRATCH.name)
os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{PORT}", ROS_IP="127.0.0.1", ROS_HOME=str(ROOT), ROS_LOG_DIR=str(ROOT))
os.environ.pop("ROS_HOSTNAME", None)
try:
    import numpy as np
    import rosbag
    import rospy
    from diagnostic_msgs.msg import DiagnosticArray
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import PointCloud2
    from tf2_msgs.msg import TFMessage
    from recording import Recording, position
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)


def rotation(q):
    x, y, z, w = q.x, q.y, q.z, q.w
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def wait(condition, what, seconds=30):
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until, what
        time.sleep(0.05)


def play(bag_path):
    """Every message of the bag, at its own pace."""
    publishers, start = {}, None
    with rosbag.Bag(str(bag_path)) as bag:
        messages = [(topic, m, t.to_sec()) for topic, m, t in bag.read_messages(["/events", "/imu"])]
    for topic, m, _ in messages:
        if topic not in publishers:
            publishers[topic] = rospy.Publisher(topic.strip("/"), type(m), queue_size=1000)
    wait(lambda: all(p.get_num_connections() > 0 for p in publishers.values()), "the node subscribes")
    for topic, m, t in messages:
        start = start if start is not None else time.monotonic() - t
        time.sleep(max(0.0, start + t - time.monotonic()))
        publishers[topic].publish(m)
    return {topic: sum(1 for other, _, _ in messages if other == topic) for topic in publishers}


def check(recording, folder, processes):
    bag_in = ROOT / "in.bag"
    subprocess.run([EVPOSE, "-q", "convert", folder, bag_in], check=True, capture_output=True, timeout=60)
    master = subprocess.Popen(["rosmaster", "--core", "-p", str(PORT)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    processes.append(master)

    def is_up():
        with socket.socket() as s:
            return s.connect_ex(("127.0.0.1", PORT)) == 0

    no_master = subprocess.run([NODE], capture_output=True, text=True, timeout=20) if not is_up() else None
    assert no_master is None or (no_master.returncode == 2 and "no ROS master" in no_master.stderr), no_master
    wait(is_up, "the master starts")
    rospy.init_node("evpose_test", disable_signals=True)
    heard = {"odom": [], "tf": [], "map": [], "diagnostics": []}
    lock = threading.Lock()

    def keep(name):
        def take(message):
            with lock:
                heard[name].append(message)
        return take

    for topic, kind, name in (("odom", Odometry, "odom"), ("/tf", TFMessage, "tf"), ("map", PointCloud2, "map"),
                              ("/diagnostics", DiagnosticArray, "diagnostics")):
        rospy.Subscriber(topic, kind, keep(name), queue_size=2000)
    refused = subprocess.run([NODE, "__name:=incomplete"], capture_output=True, text=True, timeout=20)
    assert refused.returncode == 2 and "~map" in refused.stderr, refused
    # As evpose starts it: the process becomes the node.
    node = subprocess.Popen([EVPOSE, "serve", "ros://events,imu", "--ros", "--map", f"{folder}/contours.ply", "--calibration",
                             f"{folder}/camchain-imucam.yaml", "--imu-model", f"{folder}/imu.yaml", "--init", "0,0,1,0,0,0,1",
                             "--set", "rate_hz=300", "--set", "registration.max_iterations=6"],
                            env={**os.environ, "PATH": f"{pathlib.Path(NODE).parent}:{os.environ['PATH']}"})
    processes.append(node)
    sent = play(bag_in)
    assert sent["/imu"] == len(recording.imu), sent
    wait(lambda: len(heard["odom"]) >= 100 and heard["diagnostics"], f"poses come: {len(heard['odom'])}")
    time.sleep(1)
    node.send_signal(signal.SIGINT)
    assert node.wait(10) == 0

    with lock:
        odom, transforms = heard["odom"], [t for m in heard["tf"] for t in m.transforms]
        stamps = np.array([m.header.stamp.to_sec() for m in odom])
        assert np.all(np.diff(stamps) > 0)
        assert abs(np.median(np.diff(stamps)) - 1 / 300) < 1e-4, "300 Hz of data time"
        errors = [np.linalg.norm(np.array([m.pose.pose.position.x, m.pose.pose.position.y, m.pose.pose.position.z]) -
                                 position(m.header.stamp.to_sec())) for m in odom]
        assert np.median(errors) < 0.1, np.median(errors)
        # The velocity in base_link, turned into the map, is the slope of the positions.
        a, b = odom[len(odom) // 2], odom[len(odom) // 2 + 3]
        linear = a.twist.twist.linear
        turned = rotation(a.pose.pose.orientation) @ [linear.x, linear.y, linear.z]
        pa, pb = a.pose.pose.position, b.pose.pose.position
        slope = np.array([pb.x - pa.x, pb.y - pa.y, pb.z - pa.z]) / (b.header.stamp - a.header.stamp).to_sec()
        assert np.linalg.norm(turned - slope) < 0.3, (turned, slope)
        by_stamp = {t.header.stamp.to_nsec(): t for t in transforms}
        assert len(by_stamp) > 90
        for m in odom:
            t = by_stamp.get(m.header.stamp.to_nsec())
            if t is None:
                continue
            assert (t.header.frame_id, t.child_frame_id) == ("map", "base_link")
            p, q = t.transform.translation, m.pose.pose.position
            assert (p.x, p.y, p.z) == (q.x, q.y, q.z) and t.transform.rotation == m.pose.pose.orientation
        assert heard["map"][0].width == len(recording.contours)
        assert np.allclose(np.array(odom[0].pose.covariance).reshape(6, 6), np.array(odom[0].pose.covariance).reshape(6, 6).T)
        bag_out = ROOT / "out.bag"
        with rosbag.Bag(str(bag_out), "w") as bag:
            for m in odom:
                bag.write("/odom", m, m.header.stamp)
    assert rosbag.Bag(str(bag_out)).get_message_count("/odom") == len(odom)
    print(f"{len(odom)} poses and {len(transforms)} transforms; median error {1000 * np.median(errors):.1f} mm")


def main():
    recording = Recording()
    folder = recording.write(ROOT / "recording")
    processes = []
    try:
        check(recording, folder, processes)
    finally:
        for process in reversed(processes):
            if process.poll() is None:
                process.terminate()
                process.wait()


if __name__ == "__main__":
    main()
    os._exit(0)  # rospy's threads wait for a master that is gone
