#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Runs clang-tidy over the sources of a preset's build: scripts/tidy.py build/PRESET [NAME ...]

Only files whose path contains one of the NAMEs; without any, all of apps and src. Unit tests only by a NAME of theirs.
In batches: most of the time goes into the headers of libraries, which the files of a batch share. Files stand together
only where the names that they define for themselves allow it, and of a batch with faults the files that these name are
looked at again one by one.
What passed is not looked at again until it, what it includes, its flags or .clang-tidy change.
"""
import concurrent.futures
import hashlib
import json
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import time

TOOL = "clang-tidy-14"
ROOT = pathlib.Path(__file__).resolve().parent.parent
MOST_IN_BATCH = 16
WORD = re.compile(r"[A-Za-z_]\w*")
# What a file defines for itself: types, constants and functions at the left margin of its unnamed namespace; macros.
OWN = re.compile(r"^namespace \{$(.*?)^\}  // namespace$", re.MULTILINE | re.DOTALL)
DEFINED = re.compile(r"^(?:(?:struct|class|enum class|enum|union|using|namespace) (\w+)"
                     r"|[\w:][\w:<>,&* ]*?\b(\w+)(?:\(| =|\{|\[|;))", re.MULTILINE)
MACRO = re.compile(r"^#define (\w+)", re.MULTILINE)


def commands(build):
    """As each source would be compiled alone, with no header that GCC has precompiled, which clang cannot read."""
    plain = build / "tidy/plain"
    subprocess.run(["cmake", "--preset", build.name, "-B", str(plain), "-DEVPOSE_UNITY=OFF", "-DEVPOSE_PRECOMPILED=OFF"],
                   cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    return json.loads((plain / "compile_commands.json").read_text())


def sources(entries, names):
    for entry in entries:
        path = pathlib.Path(entry["file"])
        inside = any((ROOT / part) in path.parents for part in ("apps", "src")) and path.suffix == ".cpp"
        tests = any("_test" in name for name in names) or not path.stem.endswith("_test")
        wanted = tests and (not names or any(name in str(path) for name in names))
        if inside and wanted:
            yield entry


def arguments(entry):
    command = shlex.split(entry["command"])
    if os.path.basename(command[0]) == "ccache":
        command = command[1:]
    return command[:command.index("-o")]


def types(names):
    return {name for name in names if name[0].isupper()}


def batches(entries):
    """Groups of entries with the same flags, where no two define the same and none defines a type's name that others use."""
    groups = []
    for entry in entries:
        text = pathlib.Path(entry["file"]).read_text()
        words = set(WORD.findall(text))
        own = "".join(OWN.findall(text))
        defined = {name for found in DEFINED.findall(own) for name in found if name} | set(MACRO.findall(text))
        for group in groups:
            if (len(group["entries"]) < MOST_IN_BATCH and group["flags"] == arguments(entry)
                    and not group["defined"] & defined and not types(group["words"] & defined)
                    and not types(group["defined"] & words)):
                break
        else:
            group = {"entries": [], "flags": arguments(entry), "words": set(), "defined": set()}
            groups.append(group)
        group["entries"].append(entry)
        group["words"] |= words
        group["defined"] |= defined
    return [group["entries"] for group in groups]


def tidy(file, entry, batch):
    # A batch is a file that includes sources. The flags are those of GCC, some of which clang does not know.
    checks = ["--checks=-bugprone-suspicious-include"] if batch else []
    return subprocess.run([TOOL, "--quiet", *checks, file, "--", *arguments(entry)[1:], "-Wno-unknown-warning-option"],
                          cwd=entry["directory"], capture_output=True, text=True)


def check(batch, passed):
    entry = batch[0]
    text = "".join(f'#include "{each["file"]}"\n' for each in batch)
    # -C keeps comments, in which NOLINT lives.
    whole = subprocess.run(arguments(entry) + ["-E", "-C", "-x", "c++", "-"], input=text.encode(),
                           cwd=entry["directory"], capture_output=True, check=True).stdout
    key = hashlib.sha256(whole + entry["command"].encode() + (ROOT / ".clang-tidy").read_bytes()).hexdigest()
    stamp = passed / key
    if stamp.exists():
        return ""
    file = entry["file"]
    if len(batch) > 1:
        file = str(passed / f"{key}.cpp")
        pathlib.Path(file).write_text(text)
    run = tidy(file, entry, len(batch) > 1)
    if len(batch) > 1:
        os.remove(file)
    if run.returncode != 0 and len(batch) > 1:
        named = [each for each in batch if each["file"] in run.stdout] or batch
        rest = [each for each in batch if each not in named]
        return "".join(check(part, passed) for part in [[each] for each in named] + ([rest] if rest else []))
    if run.returncode != 0:
        return run.stdout or run.stderr
    stamp.touch()
    return ""


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    if not shutil.which(TOOL):
        print(f"{TOOL} is not installed: scripts/packages.sh test")
        sys.exit(77)
    build = pathlib.Path(sys.argv[1]).resolve()
    passed = build / "tidy"
    passed.mkdir(exist_ok=True)
    start = time.monotonic()
    entries = list(sources(commands(build), sys.argv[2:]))
    work = sorted(batches(entries), key=len, reverse=True)
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        faults = list(filter(None, pool.map(lambda batch: check(batch, passed), work)))
    print("\n".join(faults))
    print(f"{len(entries)} files in {len(work)} runs, {len(faults)} with faults, {time.monotonic() - start:.0f} s")
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
