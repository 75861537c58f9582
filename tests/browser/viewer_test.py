#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The viewer in headless Chromium: viewer_test.py EVPOSE FOLDER

Connects to a replay, shows a pose that moves, pictures and plots, scrubs, survives a restart of the server, and plays
a recorded run; nothing is asked of any other host. Screenshots stay in FOLDER. Without Chromium the test is skipped
(exit status 77), but not where CI=true.
"""
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import time

import chromium

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "end_to_end"))
try:
    from recording import Recording
    import h5py  # noqa: F401: the recordings need it
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)

EVPOSE, FOLDER = sys.argv[1], pathlib.Path(sys.argv[2]).resolve()
DATA = "(document.documentElement ?? { dataset: {} }).dataset"
SCRUB = """
(() => {
  const slider = document.getElementById("time");
  slider.value = %s * slider.max;
  slider.dispatchEvent(new Event("input"));
  return Number(slider.value);
})()
"""
COLOURS = """
(() => {
  const canvas = document.getElementById("%s"), copy = document.createElement("canvas");
  [copy.width, copy.height] = [200, 150];
  const context = copy.getContext("2d");
  return new Promise((done) => requestAnimationFrame(() => {
    if (window.drawNow) window.drawNow();
    context.drawImage(canvas, 0, 0, 200, 150);
    const data = context.getImageData(0, 0, 200, 150).data, seen = new Set();
    for (let i = 0; i < data.length; i += 4) seen.add((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]);
    done(seen.size);
  }));
})()
"""
OVERFLOW = "document.documentElement.scrollWidth - document.documentElement.clientWidth"


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def wait_for_server(port):
    for _ in range(300):
        with socket.socket() as s:
            if s.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)


class Program:
    def __init__(self, *arguments):
        self.process = subprocess.Popen([EVPOSE, *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGINT)
        self.process.wait(20)


def expect(condition, what):
    if not condition:
        raise AssertionError(what)


def look(page, name, port):
    page.screenshot(FOLDER / f"{name}.png")
    expect(not page.errors() and not page.run(f"{DATA}.errors"), f"{name}: {page.errors()} {page.run(f'{DATA}.errors')}")
    expect(page.run(OVERFLOW) <= 0, f"{name}: sticks out of the screen")
    others = [u for u in page.requests() if not u.startswith((f"http://127.0.0.1:{port}/", f"ws://127.0.0.1:{port}/"))]
    expect(not others, f"{name}: asked for {others}")


def live(browser, recording):
    port = free_port()
    serve = ["serve", recording, "--map", recording / "contours.ply", "--view", port, "--set", "replay.loop=true",
             "--set", "replay.speed=0.2"]
    with Program(*serve):
        wait_for_server(port)
        page = browser.open(f"http://127.0.0.1:{port}/", 1440, 900)
        expect(page.wait_for(f"{DATA}.connection === 'connected'", 30), "connects: " + str(page.run(f"{DATA}.connection")))
        expect(page.wait_for(f"Number({DATA}.pictures) > 1 && Number({DATA}.plots) === 6", 30), "pictures and plots come")
        before = page.run(f"{DATA}.pose")
        expect(page.wait_for(f"{DATA}.pose !== '{before}'", 30), "the pose moves")
        expect(page.run(COLOURS % "picture") > 3, "the picture shows events")
        expect(page.run("(s => s.value === s.max && s.clientWidth > 1200)(document.getElementById('time'))"),
               "the slider stands at the right end, across the page")
        look(page, "live", port)
        expect(page.wait_for(f"Math.abs({SCRUB % 0.5} - {DATA}.t) < 0.1", 10), "scrubs")
        page.run("document.getElementById('live').click()")
    expect(page.wait_for(f"{DATA}.connection.startsWith('not connected')", 30), "notices that the server has gone")
    with Program(*serve):
        expect(page.wait_for(f"{DATA}.connection === 'connected' && Number({DATA}.loaded) === 2", 60), "connects again")
        rows = page.run(f"{DATA}.rows")
        expect(page.wait_for(f"{DATA}.rows !== '{rows}'", 30), "goes on")
        page.close()
        phone = browser.open(f"http://127.0.0.1:{port}/", 390, 844, mobile=True)
        expect(phone.wait_for(f"Number({DATA}.pictures) > 1 && Number({DATA}.plots) === 6", 60), "on a phone")
        look(phone, "phone", port)
        phone.close()


def plays(page):
    """From the start to the end at twice the speed; the pictures follow."""
    slider = "document.getElementById('time')"
    expect(float(page.run(f"{DATA}.t")) == 0, "starts at the run's start")
    page.run("document.getElementById('speed').value = 2, document.getElementById('play').click()")
    expect(page.wait_for(f"Number({DATA}.t) > 0.1", 30), "plays")
    stopped = "document.getElementById('play').textContent === 'play'"
    expect(page.wait_for(f"{slider}.value === {slider}.max && {stopped}", 60), "plays to the end and stops")
    # How many come on the way depends on the machine.
    expect(page.wait_for(f"Number({DATA}.pictures) > 0 && Number({DATA}.matched) > 50", 60), "pictures of the run")
    expect(page.run(COLOURS % "picture") > 3, "the picture shows events")


def recorded(browser, recording):
    subprocess.run([EVPOSE, "-q", "track", recording, "--map", recording / "contours.ply", "-o", FOLDER / "run", "--force"],
                   check=True, capture_output=True, timeout=60)
    port = free_port()
    with Program("view", FOLDER / "run", "--port", port):
        wait_for_server(port)
        page = browser.open(f"http://127.0.0.1:{port}/", 1440, 900)
        expect(page.wait_for(f"{DATA}.connection === 'recorded' && Number({DATA}.plots) === 6", 60), "loads the run")
        plays(page)
        end = page.run(f"{DATA}.pose")
        pictures = page.run(f"{DATA}.pictures")
        wanted = page.run(SCRUB % 0.75)
        expect(abs(float(page.run(f"{DATA}.t")) - wanted) < 0.01, "scrubs the run")
        expect(page.wait_for(f"Number({DATA}.pictures) > {pictures}", 60), "another picture")
        expect(page.run(f"{DATA}.pose") != end, "to another pose")
        look(page, "run", port)
        page.close()
        phone = browser.open(f"http://127.0.0.1:{port}/", 390, 844, mobile=True)
        expect(phone.wait_for(f"Number({DATA}.pictures) > 0 && Number({DATA}.plots) === 6", 60), "a run on a phone")
        look(phone, "run-phone", port)
        expect(phone.run("document.getElementById('time').clientWidth") > 340, "the slider spans the phone")
        phone.close()


def without_pictures(browser):
    """The recording has gone: all but the pictures is there, and why."""
    shutil.move(FOLDER / "recording/events.h5", FOLDER / "events.h5")
    port = free_port()
    with Program("view", FOLDER / "run", "--port", port):
        wait_for_server(port)
        page = browser.open(f"http://127.0.0.1:{port}/", 1440, 900)
        expect(page.wait_for(f"({DATA}.connection ?? '').startsWith('recorded; no pictures: ')", 60), "says why")
        expect(page.run("document.getElementById('picture-card').clientHeight") == 0, "no empty card")
        page.close()


def main():
    program = chromium.find()
    if not program:
        print("browser.viewer: chromium is missing (apt-get install chromium)")
        return 1 if os.environ.get("CI") == "true" else 77
    shutil.rmtree(FOLDER, ignore_errors=True)
    FOLDER.mkdir(parents=True)
    recording = Recording().write(FOLDER / "recording")
    with chromium.Browser(program) as browser:
        live(browser, recording)
        recorded(browser, recording)
        without_pictures(browser)
    print("follows, plays, scrubs, survives a restart")
    return 0


if __name__ == "__main__":
    sys.exit(main())
