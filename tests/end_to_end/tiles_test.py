#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A map built tile by tile, as jobs of their own, has the bytes of the map built in one run. tiles_test.py EVPOSE ROOT

The jobs are run in another order, and by the examples for GNU parallel, Slurm and Kubernetes as far as what runs them is
here. Where it cannot go on, one line says so, with exit status 2, and nothing is left behind.
"""
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

try:
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing}: scripts/packages.sh test")
    sys.exit(77)

from corridor import corridor

EVPOSE = ROOT = None
SETTINGS = ["--set", "tile_points=40000"]


def street(length_m=24, per_m2=1200):
    """A floor, a kerb and a wall along x; far behind the end a tree, which is flat nowhere."""
    random = np.random.default_rng(4)

    def face(size, axis, at):
        points = random.uniform(0, size, (int(per_m2 * np.prod([s for s in size if s > 0])), 3))
        points[:, axis] = at + random.normal(0, 0.004, len(points))
        return points

    faces = [face((length_m, 4, 0), 2, 0), face((length_m, 0, 3), 1, 4), face((length_m, 0, 0.5), 1, 0)]
    tree = random.uniform(0, 1, (30_000, 3)) * [12, 12, 12] + [length_m + 30, 0, 0]
    points = np.concatenate([*faces, tree])
    rows = np.zeros(len(points), [("xyz", "<f4", 3), ("intensity", "u1")])
    rows["xyz"] = points + [1000, 2000, 50]
    rows["intensity"] = random.integers(0, 200, len(rows))
    random.shuffle(rows)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz")
    return (header + "property uchar intensity\nend_header\n").encode() + rows.tobytes()


FLIGHT = """
scene_file: scene.yaml
duration_s: 0.6
camera: {size: custom, width: 240, height: 180, focal_px: 170}
trajectory: {kind: traverse, centre_x_m: 12, centre_y_m: 0, centre_z_m: 1.4, size_forward_m: 8, size_left_m: 0.6, size_up_m: 0.4,
  speed_m_s: 6}
lidar: {on: true, flight: {kind: traverse, duration_s: 1, centre_x_m: 9, centre_y_m: 0, centre_z_m: 1.4, size_forward_m: 14,
  size_left_m: 0.6, size_up_m: 0.4, speed_m_s: 14}}
"""


class FlightTest(unittest.TestCase):
    """A flight across the borders of tiles gives the poses of the map that is read as a whole."""

    def run_program(self, *words, statuses=(0,)):
        done = subprocess.run([EVPOSE, "-q", *map(str, words)], capture_output=True, text=True, timeout=120)
        self.assertIn(done.returncode, statuses, done.stdout + done.stderr)

    def test_poses_do_not_tell_whether_the_map_is_read_by_place(self):
        with tempfile.TemporaryDirectory() as scratch:
            root = pathlib.Path(scratch)
            (root / "scene.yaml").write_text(corridor(20))
            (root / "flight.yaml").write_text(FLIGHT)
            self.run_program("simulate", root / "flight.yaml", "-o", root / "flight")
            self.run_program("map", "build", root / "flight/map_raw.ply", "--plan", root / "tiles", "--set", "tile_points=10000")
            plan = (root / "tiles/plan.yaml").read_text()
            anchor = np.array(json.loads(re.search(r"anchor: (\[.*?\])", plan)[1]))[:2]
            cores = np.array([json.loads(row)[:4] for row in re.findall(r"^  - (\[.*\])", plan, re.MULTILINE)])
            for tile in range(len(cores)):
                self.run_program("map", "build", root / "tiles", "--tile", tile)
            self.run_program("map", "merge", root / "tiles", "-o", root / "map.h5")

            places = np.loadtxt(root / "flight/groundtruth.tum")[:, None, 1:3] - anchor
            tile_at = ((places >= cores[:, :2]) & (places < cores[:, 2:])).all(2).argmax(1)
            self.assertGreater(len(set(tile_at)), 1, "no border is passed")
            poses = []
            for words in ([], ["--learn-map", root / "learnt.h5"]):  # the second wants all of the map
                self.run_program("track", root / "flight", "--map", root / "map.h5", "-o", root / "run", "--force", *words,
                                 statuses=(0, 1))
                poses.append((root / "run/trajectory.tum").read_bytes())
            self.assertGreater(poses[0].count(b"\n"), 100)
            self.assertEqual(*poses)


class TilesTest(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.root = pathlib.Path(scratch.name)
        self.cloud = self.root / "street.ply"
        self.cloud.write_bytes(street())
        self.tiles = self.root / "tiles"

    def run_map(self, *words, status=0):
        done = subprocess.run([EVPOSE, "map", *map(str, words)], capture_output=True, text=True, timeout=120)
        self.assertEqual(done.returncode, status, done.stdout + done.stderr)
        return done

    def plan(self):
        self.run_map("build", self.cloud, "--plan", self.tiles, *SETTINGS)
        count = len(list(self.tiles.glob("tile_*.ply")))
        self.assertGreater(count, 3)
        return count

    def whole(self, *more):
        self.run_map("build", self.cloud, "-o", self.root / "whole.h5", *SETTINGS, *more)
        return (self.root / "whole.h5").read_bytes()

    def merged(self, *more):
        self.run_map("merge", self.tiles, "-o", self.root / "merged.h5", *more)
        return (self.root / "merged.h5").read_bytes()

    def refused(self, *words, says):
        before = sorted(path.name for path in self.root.rglob("*"))
        error = self.run_map(*words, status=2).stderr
        self.assertRegex(error, r"^evpose: .+: .+; .+\n$", "WHERE: WHAT; FIX")
        self.assertEqual(error.count("\n"), 1, error)
        for expression in says:
            self.assertRegex(error, expression)
        self.assertEqual(sorted(path.name for path in self.root.rglob("*")), before, "left behind")

    def test_jobs_in_any_order_make_the_map_of_one_run(self):
        count = self.plan()
        said = "".join(self.run_map("build", self.tiles, "--tile", tile, "--threads", 1 + tile % 2).stderr
                       for tile in reversed(range(count)))
        self.assertRegex(said, "adds nothing to the map", "the tree has a tile of its own")
        self.assertEqual(self.merged("--level"), self.whole("--level"))

    def test_what_cannot_be_is_refused(self):
        self.refused("build", self.tiles, "--tile", 0, says=["no folder of tiles", "--plan"])
        self.refused("merge", self.tiles, says=["no folder of tiles", "--plan"])
        count = self.plan()
        self.refused("build", self.cloud, "--plan", self.tiles, *SETTINGS, says=["already"])
        self.refused("build", self.tiles, "--tile", count, says=[f"0 to {count - 1}"])
        self.refused("build", self.tiles, "--tile", 0, *SETTINGS, says=["--set", "those of the plan"])
        self.refused("build", self.cloud, "--plan", self.root / "b", "--viewpoint", "0,0,0", says=["--viewpoint"])
        self.refused("merge", self.tiles, "-o", self.root / "m.h5", says=["tile 0 of", "no such file", "--tile 0"])
        self.run_map("build", self.tiles, "--tile", 0)
        self.refused("merge", self.tiles, "-o", self.root / "m.h5", says=["tile 1 of", "--tile 1"])
        (self.tiles / "tile_2.ply").write_bytes((self.tiles / "tile_2.ply").read_bytes()[:-100])
        self.refused("build", self.tiles, "--tile", 2, says=["tile_2.ply", "truncated"])

    def example(self, name, program):
        if shutil.which(program) is None:
            self.skipTest(f"{program} is not here: scripts/packages.sh test")
        done = subprocess.run(["bash", ROOT / "examples" / name, self.cloud, self.tiles, self.root / "merged.h5", *SETTINGS],
                              capture_output=True, text=True, timeout=240,
                              env={"PATH": f"{pathlib.Path(EVPOSE).parent}:/usr/bin:/bin", "HOME": str(self.root)})
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertEqual((self.root / "merged.h5").read_bytes(), self.whole())

    def test_gnu_parallel(self):
        self.example("map_tiles_parallel.sh", "parallel")

    def test_the_other_examples_name_the_same_commands(self):
        """Neither Slurm nor Kubernetes is here: what they would run is read out of the files."""
        self.plan()
        job = (ROOT / "examples/map_tiles_kubernetes.yaml").read_text()
        self.assertIn("completionMode: Indexed", job)
        words = re.search(r'args: (\[.*\])', job).group(1)
        words, = json.loads(words)
        script = (ROOT / "examples/map_tiles_slurm.sh").read_text()
        commands = re.findall(r"^srun (evpose map build .*)$", script, re.MULTILINE)
        for variable, command in (("JOB_COMPLETION_INDEX", words), ("SLURM_ARRAY_TASK_ID", *commands)):
            subprocess.run(["bash", "-n", "-c", command], check=True)
            done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, cwd=self.root, timeout=120,
                                  env={"PATH": f"{pathlib.Path(EVPOSE).parent}:/usr/bin:/bin", variable: "1",
                                       "TILES": str(self.tiles)})
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertRegex(done.stdout, "^tile 1 of")


if __name__ == "__main__":
    EVPOSE, ROOT = sys.argv.pop(1), pathlib.Path(sys.argv.pop(1))
    unittest.main()
