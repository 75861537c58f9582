#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The table of docs/results/fuzzing.md from the logs of scripts/fuzz.sh: table.py FOLDER

Executions of all logs of a target are added up, also of one that has not ended or has found something.
"""
import collections
import pathlib
import re
import sys


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    executions = collections.Counter()
    for path in sorted(pathlib.Path(sys.argv[1]).glob("*.log")):
        target, text = path.name.split("-")[0], path.read_text(errors="replace")
        counts = re.findall(r"^(?:#|stat::number_of_executed_units: )(\d+)\b", text, re.M)
        executions[target] += max(map(int, counts), default=0)
        if faults := text.count("SUMMARY: "):
            print(f"{path.name}: {faults} found", file=sys.stderr)
    print("| target | executions |\n|---|---|")
    for target, count in executions.most_common():
        print(f"| {target} | {count:,} |")


if __name__ == "__main__":
    main()
