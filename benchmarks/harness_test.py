#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Pages, what is kept between runs, and the files that benchmarks read and write."""
import pathlib
import re
import struct
import sys
import tempfile
import unittest
import zlib

try:
    import numpy as np

    import drawing
    import files
    import harness
    import run
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)

PAGE = """Made by hand.

# Title

Words before.

<!-- figures: one -->

| old |

<!-- end -->

Words after.

<!-- figures: two -->
<!-- end -->
"""


class BenchTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        (self.root / "docs/results").mkdir(parents=True)
        self.page = self.root / "docs/results" / "page.md"
        self.page.write_text(PAGE)
        (self.root / "evpose").write_text("#!/bin/sh\necho told \"$@\"\n")
        (self.root / "evpose").chmod(0o755)
        self.bench = self.bench_at()

    def bench_at(self, quick=False):
        return harness.Bench(self.root / "evpose", self.root / "none", self.root, self.root / "scratch", self.root / "docs",
                             quick)


class Pages(BenchTest):
    def test_figures_are_replaced_and_words_stay(self):
        for content in ("| new |", "| newer |"):
            self.bench.write_page("page", {"one": [content]})
            text = self.page.read_text()
            self.assertIn(f"<!-- figures: one -->\n\n{content}\n\n<!-- end -->", text)
            self.assertNotIn("| old |", text)
            self.assertTrue("Words before." in text and "Words after." in text and "# Title" in text)
            self.assertEqual(text.count("Made by"), 1)

    def test_the_first_line_names_command_and_commit(self):
        self.bench.write_page("page", {})
        first = self.page.read_text().splitlines()[0]
        self.assertRegex(first, r"^Made by `benchmarks/run\.py page` at commit `\w+`( with changes)?, \d{4}-\d\d-\d\d\.$")

    def test_figures_without_a_place_are_a_fault(self):
        with self.assertRaisesRegex(harness.Failure, "no place for `three`"):
            self.bench.write_page("page", {"three": ["| new |"]})
        self.assertEqual(self.page.read_text(), PAGE)

    def test_every_page_of_results_has_one_maker_and_names_it(self):
        marked = {path.stem for path in (harness.ROOT / "docs/results").glob("*.md") if "<!-- figures:" in path.read_text()}
        self.assertEqual(marked, {name for name in run.BENCHMARKS if not re.search("picture", name)})
        for name in marked:
            text = (harness.ROOT / f"docs/results/{name}.md").read_text()
            self.assertTrue(text.startswith("Made by `"), name)
            self.assertEqual(text.count("<!-- figures:"), text.count("<!-- end -->"), name)


class Kept(BenchTest):
    def measured(self, bench, key="figure"):
        return bench.once(key, lambda: self.values.append(0) or len(self.values))

    def test_what_was_measured_is_not_measured_again(self):
        self.values = []
        self.assertEqual([self.measured(self.bench), self.measured(self.bench_at())], [1, 1])

    def test_another_program_another_figure_or_a_quick_run_is_measured(self):
        self.values = []
        self.measured(self.bench)
        self.assertEqual(self.measured(self.bench, "other"), 2)
        self.assertEqual(self.measured(self.bench_at(quick=True)), 3)
        (self.root / "evpose").write_text("#!/bin/sh\necho otherwise\n")
        self.assertEqual(self.measured(self.bench_at()), 4)

    def test_what_failed_is_tried_again(self):
        def fail():
            raise harness.Failure("no")

        with self.assertRaises(harness.Failure):
            self.bench.once("figure", fail)
        self.assertEqual(self.bench.once("figure", lambda: 1), 1)


class Running(BenchTest):
    def test_what_the_program_prints_comes_back(self):
        self.assertEqual(self.bench.run("eval", 1), "told -q eval 1\n")

    def test_bad_input_is_a_failure_in_the_programs_words(self):
        (self.root / "evpose").write_text("#!/bin/sh\necho 'evpose: x: what; fix' >&2\nexit 2\n")
        with self.assertRaisesRegex(harness.Failure, "evpose: x: what; fix"):
            self.bench.run("track")


class Files(BenchTest):
    def test_points_that_were_written_are_read(self):
        points = np.arange(12, dtype="<f4").reshape(4, 3)
        files.write_points(self.root / "a.ply", [points[:3], points[3:]], 4)
        ply = files.Ply(self.root / "a.ply")
        np.testing.assert_array_equal(ply.points(), points)
        ply.vertices["y"] += 1
        ply.write(self.root / "b.ply")
        np.testing.assert_array_equal(files.Ply(self.root / "b.ply").points() - points, [[0, 1, 0]] * 4)

    def test_a_quarter_turn_about_z(self):
        half = np.sqrt(0.5)
        np.testing.assert_allclose(files.rotation([0, 0, half, half]) @ [1, 0, 0], [0, 1, 0], atol=1e-12)

    def test_poses_between_two_lie_on_the_shorter_way(self):
        path = files.Trajectory(np.array([[0, 0, 0, 0, 0, 0, 0, 1], [1, 2, 0, 0, 0, 0, 0, -1.0]]))
        position, attitude = path.at(0.25)
        np.testing.assert_allclose(position, [0.5, 0, 0])
        np.testing.assert_allclose(np.abs(attitude), [0, 0, 0, 1])

    def test_every_filter_of_a_grey_png_is_undone(self):
        image = np.random.default_rng(3).integers(0, 256, (5, 7), np.uint8)
        rows, above = b"", np.zeros(7, int)
        for way, row in enumerate(image.astype(int)):
            left, corner = np.r_[0, row[:-1]], np.r_[0, above[:-1]]
            guess = [drawing.predicted(way, *three) for three in zip(left, above, corner)]
            rows += bytes([way]) + ((row - guess) % 256).astype(np.uint8).tobytes()
            above = row
        (self.root / "a.png").write_bytes(drawing.png_head(7, 5, 8, 0) + drawing.png_chunk(b"IDAT", zlib.compress(rows)) +
                                          drawing.png_chunk(b"IEND", b""))
        np.testing.assert_array_equal(drawing.read_grey_png(self.root / "a.png"), image)

    def test_what_is_written_as_a_grey_png_is_read_back(self):
        for kind in (np.uint8, np.uint16):
            image = np.random.default_rng(4).integers(0, np.iinfo(kind).max, (5, 7), kind)
            drawing.write_grey_png(self.root / "b.png", image)
            np.testing.assert_array_equal(drawing.read_grey_png(self.root / "b.png"), image)

    def test_chunks_of_a_png_carry_length_and_checksum(self):
        chunk = drawing.png_chunk(b"IEND", b"")
        self.assertEqual(chunk, struct.pack(">I", 0) + b"IEND" + bytes.fromhex("ae426082"))


if __name__ == "__main__":
    unittest.main()
