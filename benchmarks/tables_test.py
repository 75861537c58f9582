#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Tables of results pages."""
import unittest

import tables

PRINTED = """### spiral

| variant | status | mm | deg |
|---|---|---|---|
| all | tracking | 0.85 | 0.02 |
| without IMU | tracking | 1.06 | 0.03 |

### hover

| variant | status | mm | deg |
|---|---|---|---|
| all | tracking | 1.29 | 0.03 |
"""


def measured():
    return {heading: {row["variant"]: row for row in rows} for heading, rows in tables.read(PRINTED).items()}


class TablesTest(unittest.TestCase):
    def test_what_is_written_is_read_again(self):
        lines = tables.table(["variant", "mm"], [["all", "0.85"], ["", "-"]])
        self.assertEqual(tables.read("\n".join(lines)), {"": [{"variant": "all", "mm": "0.85"}, {"variant": "", "mm": "-"}]})

    def test_a_row_for_each_variant_and_a_column_for_each_recording(self):
        self.assertEqual(tables.pivot(measured(), lambda row: f"{row['mm']}, {row['deg']}"), [
            "| variant | spiral | hover |", "|---|---|---|",
            "| all | 0.85, 0.02 | 1.29, 0.03 |", "| without IMU | 1.06, 0.03 | - |"])

    def test_the_other_way(self):
        self.assertEqual(tables.transposed(measured(), lambda row: row["mm"]), [
            "| recording | all | without IMU |", "|---|---|---|", "| spiral | 0.85 | 1.06 |", "| hover | 1.29 | - |"])

    def test_a_figure_that_is_not_there_is_a_fault(self):
        with self.assertRaises(KeyError):
            tables.pivot(measured(), lambda row: row["mean mm"])


if __name__ == "__main__":
    unittest.main()
