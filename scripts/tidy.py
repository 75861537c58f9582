#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Runs clang-tidy over the sources of a build: scripts/tidy.py BUILD [NAME ...]

Only files whose path contains one of the NAMEs; without any, all of apps and src but the unit tests. A file that
passed is not looked at again until it, what it includes, its flags or .clang-tidy change.
"""
import concurrent.futures
import hashlib
import json
import os
import pathlib
import shlex
import shutil
import subprocess
import sys
import time

TOOL = "clang-tidy-14"
ROOT = pathlib.Path(__file__).resolve().parent.parent


def sources(build, names):
    for entry in json.loads((build / "compile_commands.json").read_text()):
        path = pathlib.Path(entry["file"])
        inside = any((ROOT / part) in path.parents for part in ("apps", "src"))
        wanted = any(name in str(path) for name in names) if names else not path.stem.endswith("_test")
        if inside and wanted:
            yield entry


def preprocessed(entry):
    command = shlex.split(entry["command"])
    if os.path.basename(command[0]) == "ccache":
        command = command[1:]
    output = command.index("-o")
    command = command[:output] + command[output + 2:]
    # -C keeps comments, in which NOLINT lives.
    return subprocess.run(command + ["-E", "-C"], cwd=entry["directory"], capture_output=True, check=True).stdout


def check(entry, build, passed):
    key = hashlib.sha256(preprocessed(entry) + entry["command"].encode() + (ROOT / ".clang-tidy").read_bytes())
    stamp = passed / key.hexdigest()
    if stamp.exists():
        return ""
    # The flags are those of GCC, some of which clang does not know.
    run = subprocess.run([TOOL, "--quiet", "-p", str(build), "--extra-arg=-Wno-unknown-warning-option", entry["file"]],
                         capture_output=True, text=True)
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
    entries = list(sources(build, sys.argv[2:]))
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        faults = list(filter(None, pool.map(lambda entry: check(entry, build, passed), entries)))
    print("\n".join(faults))
    print(f"{len(entries)} files, {len(faults)} with faults, {time.monotonic() - start:.0f} s")
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
