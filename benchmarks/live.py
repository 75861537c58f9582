# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/live.md and soak.md: delay, shedding and memory of evpose serve.

Delay is from an update's instant to its MAVLink bytes, read from the socket by `evpose mavlink check`; until it is handed
to the outputs, as serve says, where the health lets no pose out. Three outputs are on: MAVLink at 300 Hz, the viewer with
a browser's connection that reads, and a run folder.
"""
import base64
import os
import pathlib
import re
import socket
import subprocess
import threading
import time

import harness
import live_starts
import tables

RATE_HZ = 300
LISTEN_S = 9
# Recording, its seconds, million events a second of noise added; and whether the start is off and has to be searched.
RUNS = [("room_spiral", 3.35, 0, False), ("room_spiral", 3.35, 0, True), ("room_hover", 2.6, 0, False),
        ("courtyard_landing", 4.0, 0, False), ("room_720p", 1.0, 0, False), ("room_spiral", 3.35, 8.5, False),
        ("room_spiral", 3.35, 38.5, False)]
# It is the truth. Were it not known, the first view would be aligned first, in the tracker's thread.
KNOWN_CALIBRATION = "fusion.calibration.on=false"
SOAK_MINUTES = 30
SOAK_NOISE_MEV_S = 19.4  # with room_hover 20 in all


def free_port(kind):
    with socket.socket(socket.AF_INET, kind) as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def read_stream(port, stop):
    """What a browser does: opens the stream and reads."""
    key = base64.b64encode(os.urandom(16)).decode()
    request = (f"GET /stream HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
               f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\n\r\n").encode()
    for _ in range(200):
        try:
            with socket.create_connection(("127.0.0.1", port), timeout=0.5) as s:
                s.sendall(request)
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

    def __init__(self, bench, recording, seconds, out, *settings, start=()):
        link, page = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_STREAM)
        self.check = self._start(bench.evpose, "mavlink", "check", f"udpin://127.0.0.1:{link}", "--seconds", seconds)
        time.sleep(0.2)
        set_words = [w for s in (f"mavlink.rate_hz={RATE_HZ}", *settings) for w in ("--set", s)]
        self.process = self._start(bench.evpose, "-q", "serve", recording.folder, "--map", recording.contours, "--occluders",
                                   recording.mesh, "--mavlink", f"udp://127.0.0.1:{link}", "--view", page, "-o", out,
                                   "--force", *start, *set_words)
        self.stop = threading.Event()
        self.reader = threading.Thread(target=read_stream, args=(page, self.stop))
        self.reader.start()

    @staticmethod
    def _start(*words):
        return subprocess.Popen([str(w) for w in words], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)

    def finish(self):
        """What serve printed, and what the check heard."""
        printed = self.process.communicate()[0]
        self.stop.set()
        self.reader.join()
        return printed, self.check.communicate()[0]


def found(pattern, text, program):
    match = re.search(pattern, text)
    if not match:
        raise harness.Failure(f"{program} does not say {pattern}")
    return match


def measure_delay(bench, name, seconds, noise_mev_s, searched):
    recording = bench.peer(name)
    start = live_starts.starts(recording, 1)[live_starts.OFF_SAID] if searched else ()
    with bench.folder() as scratch:
        printed, heard = Served(bench, recording, LISTEN_S, scratch / "run", f"replay.add_noise_mev_s={noise_mev_s}",
                                KNOWN_CALIBRATION, start=start).finish()
    delay = re.search(r"p50 ([\d.]+) ms, p99 ([\d.]+) ms", heard)
    by_serve = found(r"p50 ([\d.]+) ms, p99 ([\d.]+) ms", printed, "serve")
    arrived, shed = (int(n) for n in found(r"events: (\d+) arrived, (\d+) shed", printed, "serve").groups())
    updates = found(r"(\d+) updates", printed, "serve")[1]
    looked_at = found(r"contours looked at: (?:([\d.]+) %|all)", printed, "serve")[1] or "100"
    tracking = re.search(r"tracking ([\d.]+) %", printed)
    missed = found(r"(\d+) missed", heard, "mavlink check")[1]
    sent = f"{delay[1]} / {delay[2]}" if delay else f"{by_serve[1]} / {by_serve[2]}, no pose sent"
    words = name + (" and noise" if noise_mev_s else "") + (f", start {live_starts.OFF_SAID}" if searched else "")
    return [words, f"{arrived / seconds / 1e6:.1f}", sent,
            f"{updates} of {round(RATE_HZ * seconds)}", missed, f"{100 * shed / arrived:.1f} %",
            f"{float(looked_at):.0f} %", f"{tracking[1] if tracking else 0} %"]


def make(bench):
    rows = [bench.once(f"live: {run}", lambda: measure_delay(bench, *run)) for run in (RUNS[4:5] if bench.quick else RUNS)]
    heads = ["recording", "events, Mev/s", "delay p50 / p99, ms", "updates", "MAVLink lost", "events shed",
             "contours looked at", "tracking"]
    return bench.write_page("live", {"delay": tables.table(heads, rows)}, harness.machine())


def measure_soak(bench, minutes):
    with bench.folder() as scratch:
        served = Served(bench, bench.peer("room_hover"), 60 * minutes + 5, scratch / "run", "replay.loop=true",
                        f"replay.add_noise_mev_s={SOAK_NOISE_MEV_S}", KNOWN_CALIBRATION)
        samples = []
        for _ in range(max(10, round(60 * minutes))):
            time.sleep(1)
            samples.append(memory_mb(served.process))
        served.process.terminate()
        printed, heard = served.finish()
    # What stands behind it is of the run folder, which goes away.
    served_lines = re.split(r"^\w+ at the end;", printed, flags=re.MULTILINE)[0]
    return {"memory_mb": samples, "serve": served_lines, "check": heard}


def make_soak(bench):
    minutes = 0.2 if bench.quick else SOAK_MINUTES
    soak = bench.once(f"soak: {minutes}, {SOAK_NOISE_MEV_S}", lambda: measure_soak(bench, minutes))
    samples = soak["memory_mb"]
    tenth = max(1, len(samples) // 10)
    lines = [f"Memory over {minutes} minutes: {sum(samples[tenth:2 * tenth]) / tenth:.1f} MB after a tenth of the time, "
             f"{sum(samples[-tenth:]) / tenth:.1f} MB over the last tenth, largest {max(samples):.1f} MB.", "",
             "```", *soak["serve"].splitlines(), "", *soak["check"].splitlines(), "```"]
    return bench.write_page("soak", {"half an hour": lines}, harness.machine())
