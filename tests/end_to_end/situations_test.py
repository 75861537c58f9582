#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""What goes wrong, and the line that it gets: situations_test.py EVPOSE ROOT [--write]

Makes each situation of situations.py of one simulated flight, runs the command, and holds the exit status, the line
and what stood in the folder before; docs/results/bad-inputs.md must say the same. --write writes that page anew.
"""
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import unittest

try:
    import numpy as np
    import h5py  # noqa: F401: situations.py needs it
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)

import situations

EVPOSE, ROOT = sys.argv[1], pathlib.Path(sys.argv[2])
PAGE = ROOT / "docs/results/bad-inputs.md"
DURATION_S = 1.1
FLIGHT = f"""
scene_file: {ROOT.resolve()}/tests/end_to_end/hall.yaml
duration_s: {DURATION_S}
camera: {{size: custom, width: 320, height: 240, focal_px: 230}}
trajectory: {{kind: lissajous, centre_x_m: 0, centre_y_m: 0, centre_z_m: 1.4, size_forward_m: 1.6, size_left_m: 2,
  size_up_m: 0.9, speed_m_s: 0.7, rate_deg_s: 70, sway_deg: 14}}
lidar: {{on: true, flight: {{duration_s: 1, centre_x_m: 0, centre_y_m: 0, centre_z_m: 1.4, size_forward_m: 4,
  size_left_m: 3, size_up_m: 1}}}}
"""
OWN = {"camchain-imucam.yaml", "imu.yaml", "imu.csv", "events.h5"}
HEAD = """Made by `tests/end_to_end/situations_test.py EVPOSE . --write`, and held by the test `end_to_end.situations`.

# Bad input

What goes wrong, the command, what it prints, and its exit status: 1 ran, but the result is not to be used, or a check
found a problem; 2 bad input. Nothing that was there before is overwritten, and of a run with status 2 nothing is left
behind. `flight` is a simulated recording of {duration_s} s without ground truth, `spoilt` a copy of it with the fault,
`spoilt.ply`, `spoilt.h5` and `spoilt.tum` copies of its map and start. A run with status 1 prints more than this.
"""


def run(place, words, inside=""):
    command = [*shlex.split(inside), EVPOSE, *words]
    return subprocess.run([str(word) for word in command], cwd=place, capture_output=True, text=True, timeout=120,
                          stdin=subprocess.DEVNULL)


def made(place, *words):
    done = run(place, words)
    assert done.returncode == 0, f"{words}: {done.stderr}"


def make_flight(place):
    """The flight as a user has it, and its files in other formats."""
    (place / "flight.yaml").write_text(FLIGHT)
    made(place, "simulate", "flight.yaml", "-o", "made")
    (place / "flight.yaml").unlink()
    (place / "flight").mkdir()
    for name in OWN:
        shutil.copy(place / "made" / name, place / "flight" / name)
    shutil.copy(place / "made/contours.ply", place / "contours.ply")
    shutil.copy(place / "made/map_raw.ply", place / "cloud.ply")
    shutil.copy(place / "made/groundtruth.tum", place / "start.tum")
    made(place, "map", "import", "contours.ply", "--occluders", "made/mesh.ply", "-o", "map.h5")
    made(place, "map", "board", "--checkerboard", "9x7", "--square", "0.08", "-o", "board.h5")
    for name in ("events.raw", "events.bag"):
        made(place, "convert", "flight/events.h5", name, "--offset", "0.001")  # bags hold no times before zero
    made(place, "map", "build", "cloud.ply", "--plan", "planned", "--set", "tile_points=10000")
    shutil.rmtree(place / "made")


def contents(place):
    return {path.relative_to(place): path.read_bytes() for path in sorted(place.rglob("*")) if path.is_file()}


def told(done):
    """What the table shows: the line on stderr, or what a bad run or a check says and tells to do."""
    if done.returncode == 2:
        return done.stderr.splitlines()[-1]
    lines = [line.strip() for line in done.stdout.splitlines()]
    if any(line.startswith("PROBLEM") for line in lines):
        first = next(k for k, line in enumerate(lines) if line.startswith("PROBLEM"))
        return " ".join([re.sub(r"  +", " ", lines[first]), lines[first + 1]])
    first = next((k for k, line in enumerate(lines) if "less than 90 %" in line), None)
    if first is None:
        return done.stderr.strip()
    last = next((k for k, line in enumerate(lines) if line.startswith("do:")), first)
    return "; ".join(lines[first:last + 1]).replace(":;", ":")


def row(situation, line):
    cells = [situation.what, f"`evpose {situation.command}`", line, str(situation.status)]
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


class SituationsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        cls.base = pathlib.Path(scratch.name) / "base"
        cls.base.mkdir()
        make_flight(cls.base)

    def setUp(self):
        self.place = self.base.parent / "place"
        shutil.copytree(self.base, self.place)
        self.addCleanup(shutil.rmtree, self.place)

    def test_without_a_fault_it_is_tracked(self):
        shutil.copytree(self.place / "flight", self.place / "spoilt")
        done = run(self.place, shlex.split(situations.TRACK))
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        done = run(self.place, shlex.split(situations.CHECK))
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def hold(self, situation):
        """Runs it and asserts; what it printed, or None where this machine cannot make it."""
        situation.prepare(self.place)
        before = contents(self.place)
        done = run(self.place, shlex.split(situation.command), situation.inside)
        if situation.inside and "unshare" in done.stderr:
            return None
        line = told(done)
        self.assertEqual(done.returncode, situation.status, f"{line}\n{done.stdout}{done.stderr}")
        for expression in situation.says:
            self.assertRegex(line, re.compile(expression, re.IGNORECASE))
        if situation.status == 2:
            self.assertRegex(done.stderr, r"\A(evpose: warning: .+\n)*evpose: .+: .+; .+\n\Z", "WHERE: WHAT; FIX")
            self.assertEqual(contents(self.place), before, "changed by a command that was refused")
        for path, content in before.items():
            self.assertEqual((self.place / path).read_bytes(), content, path)
        return line

    def test_each_situation_gets_its_line(self):
        out = [HEAD.format(duration_s=DURATION_S)]
        skipped = set()
        for title, section in situations.SECTIONS.items():
            out += [f"## {title}\n", "| situation | command | what is printed | status |", "|---|---|---|---|"]
            for situation in section:
                with self.subTest(situation.what):
                    shutil.rmtree(self.place)
                    shutil.copytree(self.base, self.place)
                    line = self.hold(situation)
                    if line is None:
                        skipped.add(situation.what)
                        print(f"skipped: {situation.what}: no rights to mount", file=sys.stderr)
                    out.append(row(situation, line or ""))
            out.append("")
        self.compare("\n".join(out).rstrip() + "\n", skipped)

    def compare(self, page, skipped):
        """Numbers may differ in the last digit between machines."""
        if WRITE:
            self.assertFalse(skipped, "the page needs them all")
            PAGE.write_text(page)
            return
        def lines(text):
            kept = [line for line in text.splitlines() if not any(line.startswith(f"| {name} |") for name in skipped)]
            return [re.sub(r"\d+(\.\d+)?", "#", line) for line in kept]
        self.maxDiff = None
        self.assertEqual(lines(PAGE.read_text()), lines(page), "docs/results/bad-inputs.md is out of date: --write")

    def test_there_are_as_many_as_promised_and_none_twice(self):
        every = [s.what for section in situations.SECTIONS.values() for s in section]
        self.assertGreaterEqual(len(every), 30)
        self.assertEqual(len(every), len(set(every)))


if __name__ == "__main__":
    WRITE = "--write" in sys.argv
    sys.argv = sys.argv[:1] + [word for word in sys.argv[3:] if word != "--write"]
    unittest.main()
