# SPDX-License-Identifier: BSD-3-Clause
"""docs/images/viewer_run.png, viewer_live.png, report_desktop.png, report_phone.png: the pages of `evpose view` and
`evpose serve --view` of room_spiral, and the first two screens of its report."""
import signal
import socket
import subprocess
import sys
import time

import harness

sys.path.insert(0, str(harness.ROOT / "tests/browser"))
import chromium  # noqa: E402

WIDTH, HEIGHT = 1440, 900
SHOWN_S = 1.7  # of the recorded run
DATA = "(document.documentElement ?? { dataset: {} }).dataset"
SEEK = """
(slider => {
  slider.value = %s;
  slider.dispatchEvent(new Event("input"));
})(document.getElementById("time"))
"""


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


def shoot(bench, browser, output, words, ready, script=""):
    """A picture of the page that `evpose WORDS` serves, as soon as it is ready after the script."""
    program = subprocess.Popen([str(w) for w in (bench.evpose, "-q", *words)], stdin=subprocess.DEVNULL,
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        port = words[-1]
        wait_for_server(port)
        page = browser.open(f"http://127.0.0.1:{port}/", WIDTH, HEIGHT)
        page.wait_for(f"Number({DATA}.plots) === 6", 60)
        if script:
            page.run(script)
        if not page.wait_for(ready, 120):
            raise harness.Failure(f"the page of evpose {words[0]} is never ready")
        page.screenshot(output)
        page.close()
    finally:
        program.send_signal(signal.SIGINT)
        program.wait()


def shoot_report(bench, browser, report):
    for name, width, height, mobile in (("desktop", WIDTH, 1620, False), ("phone", 390, 1300, True)):
        page = browser.open(report.resolve().as_uri(), width, height, mobile)
        if not page.wait_for("document.documentElement?.dataset.ready"):
            raise harness.Failure(f"{report} is never ready")
        page.screenshot(bench.image(f"report_{name}.png"), whole=False)
        page.close()


def make(bench):
    name = chromium.find()
    if not name:
        raise harness.Failure("chromium is not installed: scripts/packages.sh test")
    recording = bench.peer("room_spiral")
    map_words = ["--map", recording.contours, "--occluders", recording.mesh]
    bench.scratch.mkdir(parents=True, exist_ok=True)
    run = bench.scratch / "viewer" / recording.name
    run.parent.mkdir(exist_ok=True)
    bench.run("track", recording.folder, *map_words, "--init", "groundtruth", "-o", run, "--force")
    output = bench.image("viewer_run.png")
    with chromium.Browser(name) as browser:
        shoot(bench, browser, output, ["view", run, "--port", free_port()],
              f"Math.abs({DATA}.pictured - {SHOWN_S}) < 0.1", SEEK % SHOWN_S)
        shoot_report(bench, browser, run / "report.html")
        live = ["serve", recording.folder, *map_words, "--init", "groundtruth", "--set", "replay.speed=0.05",
                "--view", free_port()]
        shoot(bench, browser, bench.image("viewer_live.png"), live, f"Number({DATA}.t) > {SHOWN_S}")
    return output
