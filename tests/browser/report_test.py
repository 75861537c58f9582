#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Draws made-up reports in headless Chromium and looks at them: report_test.py MAKE_REPORTS FOLDER

Every plot must be drawn and show something, no script may fail, nothing may be asked of a network, nothing may stick
out of a phone's screen. Screenshots stay in FOLDER. Without Chromium the test is skipped (exit status 77), but not
where CI=true.
"""
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import zlib

import chromium

RUN_PLOTS = ["trajectory", "top", "ate", "are", "position-axes", "rotation-axes", "cdf-ate", "cdf-are", "velocity",
             "attitude", "gyro-bias", "accel-bias", "calibration-time", "calibration-turn", "calibration-shift",
             "calibration-gravity", "calibration-pinhole", "calibration-distortion", "latency", "events", "points"]
EVAL_PLOTS = RUN_PLOTS[:8]
RUN_SECTIONS = ["Trajectory", "What the tracker saw", "Start", "Error against ground truth", "Motion", "Biases of the IMU",
                "Calibration", "Work and health"]
EVAL_SECTIONS = ["Trajectory", "Error against ground truth"]
MOST_BYTES = 2_500_000
VIEWS = {"wide": {"width": 1440, "height": 900}, "dark": {"width": 1440, "height": 900, "dark": True},
         "phone": {"width": 390, "height": 844, "mobile": True}}

# Number of colours inside the axes of each plot (titles and legends do not count): 1 where nothing is drawn.
LOOK = """
(async (paint) => {
  const colours = async (div) => {
    const image = new Image();
    image.src = await Plotly.toImage(div, { format: "png", width: 400, height: 300 });
    await image.decode();
    const canvas = document.createElement("canvas");
    canvas.width = 400;
    canvas.height = 300;
    const context = canvas.getContext("2d");
    context.drawImage(image, 0, 0);
    const data = context.getImageData(80, 80, 280, 140).data;
    const seen = new Set();
    for (let i = 0; i < data.length; i += 4) {
      if (data[i + 3] > 0) seen.add((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]);
    }
    return seen.size;
  };
  const out = { plots: {}, images: [...document.images].map((i) => i.naturalWidth) };
  for (const div of document.querySelectorAll(".plot")) {
    out.plots[div.id] = { drawn: div.dataset.drawn, colours: paint ? await colours(div) : null, height: div.clientHeight };
  }
  const root = document.documentElement;
  out.overflow = root.scrollWidth - root.clientWidth;
  out.sections = [...document.querySelectorAll("h2")].map((h) => h.textContent);
  // What is wider than its place must say so, in words that are seen; what is not must not.
  out.scrolls = [...document.querySelectorAll(".scroll, .strip")].map((box) => ({
    wide: box.clientWidth > 0 && box.scrollWidth > box.clientWidth + 2,
    told: box.previousElementSibling.classList.contains("hint") && box.previousElementSibling.clientHeight > 0,
    shaded: box.classList.contains("more-right"),
  }));
  out.markup = document.querySelectorAll("room").length;
  return out;
})(%s)
"""


def look(page, url, plots, sections, paint):
    """Faults of a page, in words. `paint`: each plot is painted once more to see that it shows something."""
    if not page.wait_for("document.documentElement?.dataset.ready"):
        yield "never ready"
        return
    if (state := page.run("document.documentElement.dataset.ready")) != "ok":
        yield f"{state}: " + str(page.run("document.documentElement.dataset.errors"))
    seen = page.run(LOOK % str(paint).lower())
    if list(seen["plots"]) != plots:
        yield f"plots {list(seen['plots'])} instead of {plots}"
    if seen["sections"] != sections:
        yield f"sections {seen['sections']} instead of {sections}"
    for number, box in enumerate(seen["scrolls"]):
        if not box["wide"] == box["told"] == box["shaded"]:
            yield f"sideways scroll of table or strip {number}: {box}"
    for name, plot in seen["plots"].items():
        if plot.get("drawn") != "yes" or (paint and plot["colours"] < 3) or plot["height"] < 150:
            yield f"plot {name} is empty: {plot}"
    if (requests := page.requests()) != [url]:
        yield f"asked for {requests}"
    if errors := page.errors():
        yield f"script errors: {errors}"
    if 0 in seen["images"]:
        yield "a picture is broken"
    if seen["overflow"] > 0:
        yield f"{seen['overflow']} px stick out at the right"
    if seen["markup"]:
        yield "text was taken for markup"


def busy_share(png):
    """Share of bytes of a PNG's filtered rows that are not zero: near 0 for a blank picture."""
    data = png.read_bytes()
    at, packed = 8, b""
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        if kind == b"IDAT":
            packed += data[at + 8:at + 8 + size]
        at += size + 12
    rows = zlib.decompress(packed)
    return 1 - rows.count(0) / len(rows)


def main():
    make_reports, folder = sys.argv[1], pathlib.Path(sys.argv[2]).resolve()
    program = chromium.find()
    if not program:
        print("browser.report: chromium is missing (apt-get install chromium)")
        return 1 if os.environ.get("CI") == "true" else 77
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    subprocess.run([make_reports, folder], check=True)
    faults = []
    with chromium.Browser(program) as browser:
        for name, plots, sections in (("run/report.html", RUN_PLOTS, RUN_SECTIONS),
                                      ("eval.html", EVAL_PLOTS, EVAL_SECTIONS)):
            if (size := (folder / name).stat().st_size) > MOST_BYTES:
                faults.append(f"{name} has {size} bytes")
            url = (folder / name).as_uri()
            for view, size in VIEWS.items():
                page = browser.open(url, **size)
                faults += [f"{name}, {view}: {fault}" for fault in look(page, url, plots, sections, view != "phone")]
                picture = folder / f"{pathlib.Path(name).stem}-{view}.png"
                page.screenshot(picture)
                if busy_share(picture) < 0.01:
                    faults.append(f"{picture.name} is blank")
                page.close()
    print("\n".join(faults) or "all plots drawn, nothing asked of a network")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
