# SPDX-License-Identifier: BSD-3-Clause
"""Markdown tables of the results pages: many tables of one shape become one.

`evpose bench` prints a table for each recording, with a row for each variant and a column for each figure. A page shows
a row for each variant and a column for each recording (or the other way), and the few figures that it is about.
"""


def read(markdown):
    """Tables by the heading above them, each a list of rows: {heading: [{column: cell}]}."""
    found, heading, columns = {}, "", None
    for line in markdown.splitlines():
        if line.startswith("#"):
            heading, columns = line.lstrip("#").strip(), None
        elif not line.startswith("|"):
            columns = None
        elif columns is None:
            columns = cells_of(line)
        elif not set(line) <= set("|-:"):
            found.setdefault(heading, []).append(dict(zip(columns, cells_of(line))))
    return found


def cells_of(line):
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def table(header, rows):
    """Lines of a Markdown table from names of columns and lists of cells."""
    return ["| " + " | ".join(header) + " |", "|" + "---|" * len(header),
            *("| " + " | ".join(map(str, row)) + " |" for row in rows)]


def pivot(measured, cell, key="variant"):
    """One table from {recording: {variant: row}}: a row for each variant, a column for each recording, `cell(row)` in each."""
    names = list(dict.fromkeys(name for rows in measured.values() for name in rows))
    return table([key, *measured], [[n, *(cell(rows[n]) if n in rows else "-" for rows in measured.values())] for n in names])


def transposed(measured, cell, key="recording"):
    """As `pivot`, the other way: a row for each recording, a column for each variant."""
    names = list(dict.fromkeys(name for rows in measured.values() for name in rows))
    return table([key, *names], [[recording, *(cell(rows[n]) if n in rows else "-" for n in names)]
                                 for recording, rows in measured.items()])
