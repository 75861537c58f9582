#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`evpose bench unseen` with one small flight: unseen_test.py EVPOSE"""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

EVPOSE = sys.argv.pop(1)
SEED = 1
GIVEN = ("truth", "built_map", "handed_over")


class Unseen(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.place = pathlib.Path(folder.name)

    def unseen(self, *words):
        return subprocess.run([EVPOSE, "bench", "unseen", "--quick", "--seeds", "1", "--from", str(SEED),
                               *map(str, words)], capture_output=True, text=True, timeout=280)

    def made(self, output, *words):
        done = self.unseen("-o", self.place / output, *words)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def files(self, output):
        return {p.relative_to(self.place / output): p.read_bytes() for p in (self.place / output).rglob("*") if p.is_file()}

    def test_a_seed_is_flown_tracked_kept_and_gone_on_from(self):
        flights = self.place / "flights"
        self.made("first", "--keep", flights)
        line = json.loads((self.place / "first/results.jsonl").read_text())
        self.assertEqual(line["seed"], SEED)
        for given in GIVEN:
            self.assertEqual(line[given]["fault"], "")
            self.assertGreater(line[given]["poses"], 100)
            self.assertGreater(line[given]["ate_mm"], 0)
        self.assertNotEqual(line["truth"]["ate_mm"], line["built_map"]["ate_mm"])
        self.assertNotEqual(line["truth"]["ate_mm"], line["handed_over"]["ate_mm"])
        first = self.files("first")
        page = first[pathlib.Path("README.md")].decode()
        self.assertIn("Seed 1:", page)
        for name in (f"seeds/000{SEED}_truth_course.svg", f"seeds/000{SEED}_built_map_moment.png"):
            self.assertIn(name, page)
            self.assertIn(pathlib.Path(name), first)

        # The flight is taken from its folder, by another number of threads.
        compared = self.made("second", "--keep", flights, "--threads", "2", "--compare", self.place / "first/results.jsonl")
        self.assertEqual(self.files("second"), first)
        self.assertIn("| true contours | 1 |", compared)
        self.assertIn("1.000 (1.000 .. 1.000)", compared)

        # A finished seed needs no flight.
        for path in (flights / f"quick_flight_000{SEED}").iterdir():
            path.unlink()
        self.made("first", "--keep", flights)
        self.assertEqual(self.files("first"), first)
        self.assertEqual(list((flights / f"quick_flight_000{SEED}").iterdir()), [])

        # Other settings fly it again, unless its result is given.
        self.made("third", "--known", self.place / "first/results.jsonl", "--set", "rate_hz=200", "--minutes", "1e-9")
        taken = json.loads((self.place / "third/results.jsonl").read_text())
        self.assertEqual(taken, line)
        self.assertIn("1 of the seeds were flown by another program", (self.place / "third/README.md").read_text())

    def test_time_that_is_up_begins_no_seed(self):
        self.made("none", "--minutes", "1e-9")
        self.assertEqual((self.place / "none/results.jsonl").read_text(), "")
        self.assertIn("0 of 1 seeds", (self.place / "none/README.md").read_text())

    def test_bad_input_is_refused_in_one_line_before_the_work(self):
        for words in (["--compare", self.place / "gone.jsonl"], ["--set", "no.such=1"], ["--rebuild-maps"], ["--from", "-1"]):
            done = self.unseen("-o", self.place / "refused", *words)
            self.assertEqual(done.returncode, 2, words)
            self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
            self.assertFalse((self.place / "refused").exists())


if __name__ == "__main__":
    unittest.main()
