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


class TablesTest(unittest.TestCase):
    def test_a_row_for_each_variant_and_a_column_for_each_recording(self):
        self.assertEqual(tables.pivot(PRINTED, ["mm", "deg"]), (
            "| variant | spiral | hover |\n|---|---|---|\n"
            "| all | 0.85, 0.02 | 1.29, 0.03 |\n| without IMU | 1.06, 0.03 | - |\n"))

    def test_the_other_way_and_rows_left_out(self):
        self.assertEqual(tables.pivot(PRINTED, ["mm"], leave_out=["without IMU"], by_heading=True),
                         "| recording | all |\n|---|---|\n| spiral | 0.85 |\n| hover | 1.29 |\n")

    def test_a_figure_that_is_not_there_is_a_fault(self):
        with self.assertRaises(KeyError):
            tables.pivot(PRINTED, ["mean mm"])


if __name__ == "__main__":
    unittest.main()
