#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The figures of docs/results/live.md: delay, shedding and memory of evpose serve.

    live_figures.py EVPOSE SHARED               delay at 1x and under load, a minute
    live_figures.py EVPOSE SHARED --soak 30     memory over so many minutes of a hover in a loop; --speed 0.5: half as fast

Delay is from an update's instant to its MAVLink bytes, read from the socket by `evpose mavlink check`; three outputs are
on: MAVLink at 300 Hz, the viewer with a browser's connection that reads, and a run folder.
"""
import argparse
import base64
import os
import pathlib
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time


def free_port(kind):
    with socket.socket(socket.AF_INET, kind) as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def read_stream(port, stop):
    """What a browser does: opens the stream and reads."""
    for _ in range(200):
        try:
            with socket.create_connection(("127.0.0.1", port), timeout=0.5) as s:
                key = base64.b64encode(os.urandom(16)).decode()
                s.sendall((f"GET /stream HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                           f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\n\r\n").encode())
                while not stop.is_set():
                    try:
                        if not s.recv(1 << 16):
                            return
                    except socket.timeout:
                        pass
                return
        except OSError:
            time.sleep(0.05)


def memory_mb(process):
    for line in pathlib.Path(f"/proc/{process.pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024
    return 0.0


class Served:
    """serve with its outputs, and what was heard of it."""

    def __init__(self, evpose, shared, recording, scene, seconds, out, *settings):
        link, page = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_STREAM)
        maps = shared / "data/peer/maps"
        self.check = subprocess.Popen([evpose, "mavlink", "check", f"udpin://127.0.0.1:{link}", "--seconds", str(seconds)],
                                      stdout=subprocess.PIPE, text=True)
        time.sleep(0.2)
        command = [evpose, "-q", "serve", shared / "data/peer" / recording, "--map", maps / f"{scene}_contours.ply",
                   "--occluders", maps / f"{scene}_mesh.ply", "--mavlink", f"udp://127.0.0.1:{link}", "--view", page,
                   "--set", "mavlink.rate_hz=300"]
        command += ["-o", out] if out else []
        for setting in settings:
            command += ["--set", setting]
        self.process = subprocess.Popen([str(w) for w in command], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        self.stop = threading.Event()
        self.reader = threading.Thread(target=read_stream, args=(page, self.stop))
        self.reader.start()

    def finish(self):
        printed = self.process.communicate()[0]
        self.stop.set()
        self.reader.join()
        return printed, self.check.communicate()[0]


def figures(evpose, shared):
    print("| recording | events, Mev/s | delay p50 / p99, ms | updates | MAVLink lost | events shed |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as scratch:
        runs = [("room_spiral", 3.35, 0), ("room_hover", 2.6, 0), ("courtyard_landing", 4.0, 0), ("room_720p", 1.0, 0),
                ("room_spiral", 3.35, 8.5), ("room_spiral", 3.35, 38.5)]
        for number, (recording, seconds, noise) in enumerate(runs):
            scene = recording.split("_")[0]
            served = Served(evpose, shared, recording, scene, 9, f"{scratch}/{number}", f"replay.add_noise_mev_s={noise}")
            printed, heard = served.finish()
            delay = re.search(r"p50 ([\d.]+) ms, p99 ([\d.]+) ms", heard)
            events = re.search(r"events: (\d+) arrived, (\d+) shed", printed)
            updates = re.search(r"(\d+) updates", printed)
            missed = re.search(r"(\d+) missed", heard)
            words = f"{delay[1]} / {delay[2]}" if delay else "no pose was sent"
            possible = round(300 * seconds)
            print(f"| {recording}{' and noise' if noise else ''} | {int(events[1]) / seconds / 1e6:.1f} | "
                  f"{words} | {updates[1]} of {possible} | {missed[1]} | {100 * int(events[2]) / int(events[1]):.1f} % |", flush=True)


def soak(evpose, shared, minutes, speed):
    with tempfile.TemporaryDirectory() as scratch:
        served = Served(evpose, shared, "room_hover", "room", 60 * minutes + 5, f"{scratch}/run", "replay.loop=true",
                        f"replay.speed={speed}")
        samples = []
        for _ in range(round(60 * minutes)):
            time.sleep(1)
            samples.append(memory_mb(served.process))
        served.process.terminate()
        printed, heard = served.finish()
    tenth = max(1, len(samples) // 10)
    print(f"memory: {sum(samples[tenth:2 * tenth]) / tenth:.1f} MB after a tenth of {minutes} minutes, "
          f"{sum(samples[-tenth:]) / tenth:.1f} MB over the last tenth, largest {max(samples):.1f} MB")
    print(printed + heard)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("evpose")
    parser.add_argument("shared", type=pathlib.Path)
    parser.add_argument("--soak", type=float, metavar="MINUTES")
    parser.add_argument("--speed", type=float, default=1)
    arguments = parser.parse_args()
    if arguments.soak:
        soak(arguments.evpose, arguments.shared, arguments.soak, arguments.speed)
    else:
        figures(arguments.evpose, arguments.shared)


if __name__ == "__main__":
    sys.exit(main())
