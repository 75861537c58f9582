#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The check of links finds each kind of fault, and nothing in a tree without one."""
import pathlib
import tempfile
import unittest

import links

DESIGN = "# Design\n\n## 5. Specification\n\n### 5.2 Registration (paper 4.2, eq. 1)\n"


class LinksTest(unittest.TestCase):
    def faults(self, files):
        """Faults of a tree that holds docs/design.md and `files` (text by path)."""
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            for path, text in {"docs/design.md": DESIGN, **files}.items():
                (root / path).parent.mkdir(parents=True, exist_ok=True)
                (root / path).write_text(text)
            return links.check(root)

    def one(self, path, text, *words):
        found = self.faults({path: text})
        self.assertEqual(len(found), 1, found)
        for word in words:
            self.assertIn(word, found[0])

    def test_a_clean_tree_has_no_faults(self):
        self.assertEqual(self.faults({
            "README.md": "[design](docs/design.md), [registration](docs/design.md#52-registration-paper-42-eq-1)\n",
            "docs/use/map.md": "# Map\n\n[here](#map), [up](../design.md), [away](https://example.org/x#y)\n",
            "src/evpose/map/map.h": "// design.md 5.2; docs/use/map.md\n",
        }), [])

    def test_a_link_to_nothing_is_a_fault_and_names_the_line(self):
        self.one("docs/use/map.md", "# Map\n\n[away](gone.md)\n", "docs/use/map.md:3", "gone.md")

    def test_links_start_from_the_page_that_holds_them(self):
        self.one("docs/use/map.md", "[design](design.md)\n", "no such file: design.md")

    def test_an_anchor_without_a_heading_is_a_fault(self):
        self.one("README.md", "[design](docs/design.md#53-polarity)\n", "no such heading", "53-polarity")

    def test_what_stands_in_a_block_of_code_is_no_link_and_no_heading(self):
        self.one("docs/page.md", "```\n[a](gone.md)\n# Heading\n```\n[b](#heading)\n", "docs/page.md:5")

    def test_a_page_that_names_a_file_that_is_gone_is_a_fault(self):
        self.one("docs/page.md", "Run `scripts/gone.sh`.\n", "docs/page.md:1", "scripts/gone.sh")
        self.one("docs/page.md", "```\n\nbenchmarks/gone.py all\n```\n", "docs/page.md:3", "benchmarks/gone.py")

    def test_a_results_page_may_name_what_made_it_then(self):
        self.assertEqual(self.faults({"docs/page.md": "Made by `scripts/gone.sh`\nat commit `abc`.\n\n# Page\n",
                                      "README.md": "`docs/images/map_*.png`, apps/src\n", "apps/src": ""}), [])

    def test_a_source_that_names_a_page_that_is_gone_is_a_fault(self):
        self.one("src/evpose/serve/a.h", "\n/// See docs/live.md.\n", "src/evpose/serve/a.h:2", "docs/live.md")

    def test_a_cited_section_must_be_a_heading(self):
        self.one("src/evpose/map/a.h", "// design.md 5.9\n", "no section 5.9")
        self.one("src/evpose/map/a.h", "// as design.md 5.2 and 5.6 ask for\n", "no section 5.6")
        self.one("src/evpose/map/a.h", "// (EV-Pose, Map Construction; design 5.10)\n", "no section 5.10")


if __name__ == "__main__":
    unittest.main()
