#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The layer check finds each kind of fault, and nothing in a tree without one."""
import pathlib
import tempfile
import unittest

import layers


class LayersTest(unittest.TestCase):
    def faults(self, files):
        """Faults of a tree that holds one clean file and `files` (text by path)."""
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            tree = {"src/evpose/tracker/clean.cpp": '#include "evpose/map/clean.h"\n#include <vector>\n'}
            tree.update(files)
            for path, text in tree.items():
                (root / path).parent.mkdir(parents=True, exist_ok=True)
                (root / path).write_text(text)
            return layers.check(root)

    def one(self, path, text, *words):
        found = self.faults({path: text})
        self.assertEqual(len(found), 1, found)
        for word in words:
            self.assertIn(word, found[0])

    def test_a_clean_tree_has_no_faults(self):
        self.assertEqual(self.faults({
            "src/evpose/eval/a.cpp": '#include "evpose/io/files/a.h"\n#include "evpose/eval/a.h"\n',
            "src/evpose/io/maps/a.cpp": '#include "evpose/io/files/a.h"\n#include "evpose/io/maps/a.h"\n',
            "src/evpose/io/maps/CMakeLists.txt": "evpose_module(io_maps\n  LINKS evpose::map evpose::io_files)\n",
            "src/evpose/io/CMakeLists.txt": "target_link_libraries(evpose_io INTERFACE evpose::io_maps)\n",
            "apps/evpose/main.cpp": "#include <CLI/CLI.hpp>\n#include \"commands.h\"\n",
        }), [])

    def test_including_from_above_is_a_fault_and_names_the_line(self):
        self.one("src/evpose/map/a.h", '#pragma once\n#include "evpose/tracker/a.h"\n',
                 "src/evpose/map/a.h:2", "map must not see tracker")

    def test_modules_of_one_line_do_not_see_each_other(self):
        self.one("src/evpose/camera/a.h", '#include "evpose/imu/imu.h"\n', "camera must not see imu")
        self.one("src/evpose/eval/a.h", '#include "evpose/sim/a.h"\n', "eval must not see sim")

    def test_rooms_of_a_module_see_only_lower_ones(self):
        self.one("src/evpose/io/files/a.h", '#include "evpose/io/maps/a.h"\n', "io/files must not see io/maps")
        self.one("src/evpose/io/maps/a_test.cpp", '#include "evpose/io/events/a.h"\n',
                 "io/maps must not see io/events")
        self.one("src/evpose/io/maps/a.h", '#include "evpose/sim/a.h"\n', "io/maps must not see sim")

    def test_rooms_of_a_module_link_only_lower_ones(self):
        self.one("src/evpose/io/files/CMakeLists.txt", "evpose_module(io_files\n  LINKS evpose::io_maps)\n",
                 "CMakeLists.txt:2", "io/files must not link io/maps")
        self.one("src/evpose/io/files/CMakeLists.txt", "evpose_module(io_files LINKS evpose::io)\n",
                 "io/files must not link io")
        self.one("src/evpose/map/CMakeLists.txt", "evpose_module(map LINKS evpose::io_maps)\n",
                 "map must not link io/maps")

    def test_every_file_of_a_module_of_rooms_stands_in_one(self):
        self.one("src/evpose/io/a.h", "\n", "io has rooms")
        self.one("src/evpose/io/attic/a.h", "\n", "io has rooms")

    def test_every_table_of_rooms_has_an_order(self):
        for module, rooms in layers.ROOMS.items():
            lower = set()
            for room, seen in rooms.items():
                self.assertLessEqual(seen, lower, f"{module}/{room} sees what is not listed before it")
                lower.add(room)

    def test_tests_keep_to_the_layers_too(self):
        self.one("src/evpose/event/a_test.cpp", '#include "evpose/io/a.h"\n', "event must not see io")

    def test_linking_from_above_is_a_fault(self):
        self.one("src/evpose/core/CMakeLists.txt", "evpose_module(core\n  LINKS evpose::io)\n",
                 "CMakeLists.txt:2", "core must not link io")

    def test_outside_libraries_stay_with_their_owners(self):
        self.one("src/evpose/tracker/a.cpp", "#include <yaml-cpp/yaml.h>\n", "tracker must not use yaml-cpp")
        self.one("src/evpose/eval/a.cpp", "#include <hdf5.h>\n", "eval must not use HDF5")
        self.one("src/evpose/tracker/a.cpp", "#include <ceres/ceres.h>\n", "tracker must not use Ceres")

    def test_only_io_opens_files(self):
        self.one("src/evpose/eval/a.cpp", 'std::ifstream in("x");\n', "eval must not open files")
        self.assertEqual(self.faults({"src/evpose/eval/a.cpp": "// an ifstream would be wrong here\n"}), [])

    def test_the_embeddable_part_does_not_print(self):
        self.one("src/evpose/fusion/a.cpp", "#include <iostream>\n", "fusion must not print")

    def test_a_new_module_needs_its_line(self):
        self.one("src/evpose/utils/a.h", "\n", "unknown module")


if __name__ == "__main__":
    unittest.main()
