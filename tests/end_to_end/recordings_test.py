#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The main job on recordings that nobody here made. recordings_test.py EVPOSE SOURCE_FOLDER

Needs the shared data folder (EVPOSE_SHARED, or beside the source folder); skipped by name without it.
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

EVPOSE = SOURCE = SHARED = None
MAPS = {"room_spiral": "room", "room_720p": "room", "room_people": "room", "room_hover": "room",
        "courtyard_landing": "courtyard"}


def track(out, recording, *more):
    maps, name = SHARED / "data/peer/maps", MAPS[recording]
    command = [EVPOSE, "-q", "track", SHARED / "data/peer" / recording, "--map", maps / f"{name}_contours.ply", "-o", out]
    result = subprocess.run([str(word) for word in command + list(more)], capture_output=True, text=True,
                            timeout=300, stdin=subprocess.DEVNULL)
    if result.returncode != 0:
        raise AssertionError(f"{recording}: status {result.returncode}: {result.stderr}{result.stdout}")
    return json.loads((out / "summary.json").read_text())


def occluders(recording):
    return "--occluders", SHARED / f"data/peer/maps/{MAPS[recording]}_mesh.ply"


class RecordingsTest(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.out = pathlib.Path(scratch.name)

    def check(self, summary, most_mm, most_deg, status=("tracking",)):
        self.assertIn(summary["status"], status)
        self.assertGreater(summary["coverage"], 0.98)
        self.assertLess(summary["accuracy"]["ate_mean_mm"], most_mm)
        self.assertLess(summary["accuracy"]["are_mean_deg"], most_deg)

    def test_every_peer_recording_is_tracked_to_its_end(self):
        for recording in MAPS:
            with self.subTest(recording=recording):
                self.check(track(self.out / recording, recording, *occluders(recording)), 3, 0.06)

    def test_contours_alone_are_enough(self):
        for recording in ("room_spiral", "courtyard_landing"):
            with self.subTest(recording=recording):
                self.check(track(self.out / recording, recording), 10, 0.5)

    def test_the_papers_field_tracks_too(self):
        for recording in MAPS:
            with self.subTest(recording=recording):
                summary = track(self.out / recording, recording, "--set", "registration.kind=temporal_field", *occluders(recording))
                # Just above the pad hardly one of its fewer points has events: that may be called degraded.
                self.check(summary, 10, 0.5, ("tracking", "degraded"))

    def test_events_alone_track_a_smooth_flight(self):
        import shutil
        for name in ("events.h5", "groundtruth.tum", "camchain-imucam.yaml"):
            target = self.out / "recording" / name
            target.parent.mkdir(exist_ok=True)
            shutil.copy(SHARED / "data/peer/room_spiral" / name, target)
        maps = SHARED / "data/peer/maps"
        command = [EVPOSE, "-q", "track", self.out / "recording", "--map", maps / "room_contours.ply",
                   "--occluders", maps / "room_mesh.ply", "-o", self.out / "run"]
        result = subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=300)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.check(json.loads((self.out / "run/summary.json").read_text()), 10, 0.5)

    def test_packets_and_threads_change_no_bit(self):
        for field in ("events", "temporal_field"):
            files = {}
            for packet_ms, threads in ((0.1, 1), (1, 1), (10, 1), (1, 2), (10, 2)):
                out = self.out / f"{field}_{packet_ms}_{threads}"
                track(out, "room_people", "--set", f"packet_ms={packet_ms}", "--set", f"threads={threads}",
                      "--set", f"registration.kind={field}", *occluders("room_people"))
                files[packet_ms, threads] = [(out / n).read_bytes() for n in
                                             ("trajectory.tum", "trajectory_camera.tum", "states.csv")]
            for settings, content in files.items():
                self.assertEqual(content, files[1, 1], f"{field}: packets of {settings[0]} ms, {settings[1]} threads")

    def test_eval_agrees_with_the_independent_judge(self):
        track(self.out / "run", "room_people", *occluders("room_people"))
        pair = [str(self.out / "run/trajectory.tum"), str(SHARED / "data/peer/room_people/groundtruth.tum")]
        for align in ("none", "se3", "yaw"):
            ours, judge = (json.loads(subprocess.run(command + pair + ["--align", align, "--json"], check=True,
                                                     capture_output=True, text=True).stdout)
                           for command in ([EVPOSE, "eval"], [sys.executable, str(SHARED / "tools/score.py")]))
            ours = ours.get("accuracy", ours)
            for word in ("ate_mean_mm", "ate_rmse_mm", "ate_max_mm", "are_mean_deg", "lag_ms"):
                self.assertAlmostEqual(ours[word], judge[word], delta=1e-3 + 1e-3 * abs(judge[word]), msg=f"{align} {word}")

    def test_real_hexacopter_from_events_alone(self):
        chunk = SHARED / "data/real/mvsec_indoor_flying1_chunk"
        result = subprocess.run([sys.executable, str(SOURCE / "benchmarks/mvsec_chunk.py"), EVPOSE, str(chunk),
                                 str(self.out), "--json"], capture_output=True, text=True, timeout=300)
        self.assertEqual(result.returncode, 0, result.stderr)
        figures = json.loads(result.stdout)
        self.assertEqual(figures["status"], "tracking")
        self.assertGreater(figures["tracked_s"], 0.15)
        self.assertLess(figures["ate_mean_mm"], 12)
        self.assertLess(figures["are_mean_deg"], 0.7)
        # The motion that was found makes the events as sharp as the true one does.
        gain = figures["sharpness_truth"] - figures["sharpness_no_motion"]
        self.assertGreater(figures["sharpness_estimate"] - figures["sharpness_no_motion"], 0.9 * gain)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    EVPOSE, SOURCE = sys.argv[1], pathlib.Path(sys.argv[2])
    del sys.argv[1:3]
    SHARED = pathlib.Path(os.environ.get("EVPOSE_SHARED") or SOURCE.parent / "shared")
    if not (SHARED / "data/peer").is_dir():
        print(f"skipped: {SHARED / 'data/peer'} is absent")
        sys.exit(77)
    try:
        import h5py  # noqa: F401
        import numpy  # noqa: F401
    except ImportError as missing:
        print(f"skipped: {missing}: scripts/packages.sh test")
        sys.exit(77)
    unittest.main()
