#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Holds the links of the documentation: links.py ROOT

Every relative link of a Markdown page leads to a file, and its anchor to a heading; every path of the tree that a page
names exists, but in the first paragraph of a results page, which tells of an earlier commit. Every path below docs/
that a source names exists. Every `design.md N.M` that a source cites is a heading of docs/design.md. Prints one line
per fault; exit status 1 if there is one.
"""
import pathlib
import re
import sys

LINK = re.compile(r"\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+\s+(.+?)\s*$", re.MULTILINE)
CODE_BLOCK = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
NAMED = re.compile(r"\bdocs/[A-Za-z0-9_/.-]+\.(?:md|svg|png)\b")
CITED = re.compile(r"\bdesign(?:\.md)?,? (?:section )?(\d+(?:\.\d+)?)((?:(?:,| and| to) \d+\.\d+)*)")
SOURCES = {".h", ".cpp", ".py", ".sh", ".cmake", ".txt", ".in", ".launch", ".yaml", ".js", ".html"}
FOLDERS = ["apps", "benchmarks", "cmake", "examples", "python", "ros", "scenarios", "scripts", "src", "tests", "web"]
PATH = re.compile(r"(?<![\w/.-])(?:" + "|".join([*FOLDERS, "docs"]) + r")/[\w./-]*\w(?![\w*{/])")
HISTORY = re.compile(r"\AMade by .*?\n\n", re.DOTALL)
SKIPPED = {"node_modules", "build", "__pycache__"}


def anchors(page):
    """Anchors of a page's headings, as GitHub makes them."""
    words = (re.sub(r"[`*]|\]\([^)]*\)|\[", "", heading) for heading in HEADING.findall(CODE_BLOCK.sub("", page)))
    return {re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-") for text in words}


def pages(root):
    yield from sorted(root.glob("*.md"))
    yield from sorted((root / "docs").rglob("*.md"))


def sources(root):
    for folder in FOLDERS:
        for path in sorted((root / folder).rglob("*")):
            if path.suffix in SOURCES and path.is_file() and not SKIPPED & set(path.relative_to(root).parts):
                yield path


def line_of(text, position):
    return text.count("\n", 0, position) + 1


def check_page(root, path):
    text = CODE_BLOCK.sub(lambda block: "\n" * block[0].count("\n"), path.read_text())
    for match in LINK.finditer(text):
        if re.match(r"[a-z]+:", match[1]):
            continue
        target, _, anchor = match[1].partition("#")
        file = (path.parent / target).resolve() if target else path
        where = f"{path.relative_to(root)}:{line_of(text, match.start())}"
        if not file.exists():
            yield f"{where}: no such file: {target}"
        elif anchor and file.suffix == ".md" and anchor not in anchors(file.read_text()):
            yield f"{where}: no such heading: {match[1]}"
    history = HISTORY.match(path.read_text())
    for match in PATH.finditer(path.read_text(), history.end() if history else 0):
        if not (root / match[0]).exists():
            yield f"{path.relative_to(root)}:{line_of(path.read_text(), match.start())}: no such file: {match[0]}"


def check_source(root, path, sections):
    text = path.read_text(errors="replace")
    for match in NAMED.finditer(text):
        if not (root / match[0]).exists():
            yield f"{path.relative_to(root)}:{line_of(text, match.start())}: no such page: {match[0]}"
    for match in CITED.finditer(text):
        for number in [match[1], *re.findall(r"\d+\.\d+", match[2])]:
            if number not in sections:
                yield f"{path.relative_to(root)}:{line_of(text, match.start())}: design.md has no section {number}"


def check(root):
    """All faults of the tree below `root`, as lines of text."""
    design = root / "docs/design.md"
    text = CODE_BLOCK.sub("", design.read_text()) if design.exists() else ""
    sections = {number.rstrip(".") for number in re.findall(r"^#+ (\d+(?:\.\d+)?)\b", text, re.MULTILINE)}
    faults = [fault for page in pages(root) for fault in check_page(root, page)]
    for path in sources(root):
        if path.name not in ("links.py", "links_test.py"):
            faults += check_source(root, path, sections)
    return faults


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    found = check(pathlib.Path(sys.argv[1]).resolve())
    print("\n".join(found) or "every link leads somewhere")
    sys.exit(1 if found else 0)
