# SPDX-License-Identifier: BSD-3-Clause
"""Markdown tables of the results pages: many tables of one shape become one.

`evpose bench` prints a table for each recording, with a row for each variant and a column for each figure. A page shows
a row for each variant and a column for each recording (or the other way), and the few figures that it is about.
"""


def tables(markdown):
    """Tables by the heading above them, each a list of rows: {heading: [{column: cell}]}."""
    found, heading, columns = {}, "", None
    for line in markdown.splitlines():
        if line.startswith("#"):
            heading, columns = line.lstrip("#").strip(), None
        elif not line.startswith("|"):
            columns = None
        elif columns is None:
            columns = cells_of(line)
        elif set(line) - set("|-: "):
            found.setdefault(heading, []).append(dict(zip(columns, cells_of(line))))
    return found


def cells_of(line):
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def table(header, rows):
    """A Markdown table from a list of column names and lists of cells."""
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(map(str, row)) + " |" for row in rows]) + "\n"


def pivot(markdown, figures, key="variant", leave_out=(), by_heading=False):
    """One table from many: `figures` (names of columns) in each cell, a row for each value of `key` and a column for
    each heading; with `by_heading` the other way. Rows named in `leave_out` are left out."""
    cells, names, headings = {}, [], []
    for heading, rows in tables(markdown).items():
        headings.append(heading)
        for row in rows:
            if row[key] not in leave_out:
                names += [] if row[key] in names else [row[key]]
                cells[row[key], heading] = ", ".join(row[figure] for figure in figures)
    if by_heading:
        return table(["recording", *names], [[h, *(cells.get((n, h), "-") for n in names)] for h in headings])
    return table([key, *headings], [[n, *(cells.get((n, h), "-") for h in headings)] for n in names])
