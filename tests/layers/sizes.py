#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Holds functions and sources of src and apps to their sizes: sizes.py ROOT

A function is counted from the first line of its signature to its closing brace, a source from its first line to its
last. Prints one line per fault; exit status 1 if there is one.
"""
import pathlib
import re
import sys

FOLDERS = ("src", "apps")
MOST_FUNCTION_LINES = 60
MOST_SOURCE_LINES = 400
MOST_TEST_SOURCE_LINES = 500  # *_test.cpp: a class and its fixture are tested in one place
# Functions that are read as a whole, and must fit a screen.
TIGHTER = {"Tracker::update": 25}

# What is not code: comments, strings (raw ones first), characters (but no digit separators), directives.
NOT_CODE = re.compile(
    r"""//[^\n]*|/\*.*?\*/|R"(?P<fence>[^()\s\\]*)\(.*?\)(?P=fence)"|"(?:\\.|[^"\\\n])*"|"""
    r"""(?<![0-9A-Za-z_])'(?:\\.|[^'\\\n])+'|^[ \t]*\#(?:\\\n|[^\n])*""", re.DOTALL | re.MULTILINE)
ATTRIBUTE = re.compile(r"\[\[.*?\]\]|\b(?:alignas|__attribute__)\s*\((?:[^()]|\([^()]*\))*\)")
OPERATOR = re.compile(r"\boperator\s*(?:\(\s*\)|\[\s*\]|[^\s\w(]+)")
TYPE = re.compile(r"\b(class|struct|union)\b")
SCOPE = re.compile(r"\bnamespace(?:\s+[\w:]+)?\s*$|\bextern\s*\"\s*\"\s*$")
NAME = re.compile(r"((?:[A-Za-z_]\w*(?:<[^<>]*>)?::)*~?(?:operator\s*(?:\(\s*\)|[^\s(]+)|[A-Za-z_]\w*)(?:<[^<>]*>)?)"
                  r"\s*(?:\(|=|$)")
LABEL = re.compile(r"^\s*(?:public|protected|private)\s*:(?!:)")


def blanked(text):
    """The text with everything that is not code replaced by spaces, line for line."""
    def blank(match):
        kept = re.sub(r"[^\n]", " ", match[0])
        return '""' + kept[2:] if match[0].startswith(('"', "R")) and len(kept) > 2 and "\n" not in match[0] else kept
    return NOT_CODE.sub(blank, text)


def without_brackets(head, opening, closing):
    """A head without what stands between such brackets; the brackets stay."""
    depth, out = 0, []
    for character in head:
        if character == closing:
            depth = max(depth - 1, 0)
        if depth == 0:
            out.append(character)
        if character == opening:
            depth += 1
    return "".join(out)


def without_template(head):
    """A head without the parameters of a template in front of it."""
    while match := re.match(r"\s*template\s*<", head):
        depth, at = 1, match.end()
        while at < len(head) and depth > 0:
            depth += {"<": 1, ">": -1}.get(head[at], 0)
            at += 1
        head = head[at:]
    return head


def kind_of(head):
    """What a brace after `head` opens: "scope", "type", "function", "member" (of a constructor) or "value"."""
    if SCOPE.search(head):
        return "scope"
    head = without_template(OPERATOR.sub("operator", ATTRIBUTE.sub("", head)))
    flat = without_brackets(head, "(", ")")
    if re.search(r"\benum\b", flat):
        return "value"
    if TYPE.search(flat) and "(" not in flat:
        return "type"
    if "=" in flat:
        return "function" if re.search(r"=\s*\[", flat) else "value"
    if "(" not in flat:
        return "value"
    after = flat[flat.index("("):]
    initialisers = re.search(r"(?<!:):(?!:)", after)
    return "member" if initialisers and re.search(r"[\w>]\s*$", after) else "function"


def name_of(head):
    """The name of the function that `head` begins, with its class as it is written there."""
    head = without_template(ATTRIBUTE.sub("", head))
    match = NAME.search(head)
    if match and match[1].startswith(("TEST", "TYPED_TEST", "BENCHMARK")):
        return re.sub(r"\s*,\s*", ".", head[match.end():head.rindex(")")].strip())
    return re.sub(r"<[^<>]*>", "", match[1]) if match else "?"


def type_name(head):
    match = re.search(r"\b(?:class|struct|union)\s+([A-Za-z_]\w*)", without_template(ATTRIBUTE.sub("", head)))
    return match[1] if match else ""


def matching_brace(code, at):
    """Place of the brace that closes the one at `at`."""
    depth = 0
    for place in range(at, len(code)):
        depth += {"{": 1, "}": -1}.get(code[place], 0)
        if depth == 0:
            return place
    return len(code) - 1


def functions(text):
    """All functions with a body in a source: (name, first line, number of lines)."""
    code = blanked(text)
    scopes = []  # names of the types around, "" for namespaces
    begin = at = 0
    while at < len(code):
        character = code[at]
        if character == ";":
            begin = at + 1
        elif character == "}":
            if scopes:
                scopes.pop()
            begin = at + 1
        elif character == "(":
            # Arguments may hold braces.
            depth = 0
            while at < len(code):
                depth += {"(": 1, ")": -1}.get(code[at], 0)
                if depth == 0:
                    break
                at += 1
        elif character == "{":
            head = code[begin:at]
            while match := LABEL.match(head):
                begin += match.end()
                head = head[match.end():]
            kind = kind_of(head)
            if kind in ("scope", "type"):
                scopes.append(type_name(head) if kind == "type" else "")
                begin = at + 1
            else:
                end = matching_brace(code, at)
                if kind == "function":
                    first = code.count("\n", 0, begin + len(head) - len(head.lstrip())) + 1
                    inside = [scope for scope in scopes if scope]
                    yield "::".join(inside + [name_of(head)]), first, code.count("\n", 0, end) + 2 - first
                    begin = end + 1
                at = end
        at += 1


def check_source(name, text):
    """What is too long in one source, as lines of text."""
    lines = len(text.splitlines())
    most = MOST_TEST_SOURCE_LINES if name.endswith("_test.cpp") else MOST_SOURCE_LINES
    if lines > most:
        yield f"{name}: {lines} lines, at most {most}: split it by what its parts are about"
    for function, first, length in functions(text):
        most = min([MOST_FUNCTION_LINES] + [limit for tight, limit in TIGHTER.items()
                                            if f"::{function}".endswith(f"::{tight}")])
        if length > most:
            yield f"{name}:{first}: {function} has {length} lines, at most {most}"


def check(root):
    """All faults of the tree below `root`, as lines of text."""
    faults = []
    for folder in FOLDERS:
        for path in sorted((root / folder).rglob("*")):
            if path.suffix in (".h", ".cpp"):
                faults += check_source(path.relative_to(root).as_posix(), path.read_text())
    return faults


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    found = check(pathlib.Path(sys.argv[1]).resolve())
    print("\n".join(found) or "every function and every source keeps to its size")
    sys.exit(1 if found else 0)
