#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""ORB-SLAM3, mono-inertial, on recordings that have frames, judged by `evpose eval`.

    benchmarks/orb_slam3.py --orb PATH/mono_inertial_euroc --vocabulary PATH/ORBvoc.txt RECORDING...

Frames, IMU and calibration go to it in EuRoC's layout (`evpose convert --to-format euroc`). Its trajectory is in a frame
of its own: before it is compared it is turned and shifted onto the ground truth as a whole (`--align se3`; `sim3` corrects
its scale, too). What it tells of no pose is left out: coverage stands beside the errors.
"""
import argparse
import decimal
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
HOURS = 2  # for one recording, after which it is given up


class Failure(Exception):
    """Why a recording has no figures, in one line."""


def last_line(text):
    lines = text.strip().splitlines()
    return lines[-1] if lines else "nothing was said"


def evpose(program, *words):
    done = subprocess.run([str(w) for w in (program, "-q", *words)], capture_output=True, text=True, stdin=subprocess.DEVNULL)
    if done.returncode not in (0, 1):
        raise Failure(last_line(done.stderr))
    return done.stdout


def to_tum(rows):
    """Rows of ORB-SLAM3, whose stamps are nanoseconds, with stamps in seconds."""
    out = []
    for row in rows.splitlines():
        values = row.split()
        if len(values) == 8 and not row.startswith("#"):
            out.append(" ".join([f"{decimal.Decimal(values[0]) / 10 ** 9:.9f}", *values[1:]]))
    return "\n".join(out) + "\n" if out else ""


def run(program, orb, vocabulary, recording, align):
    """What `evpose eval` says of ORB-SLAM3's trajectory."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch) / "euroc"
        evpose(program, "convert", recording, folder, "--to-format", "euroc")
        truth = folder / "mav0/state_groundtruth_estimate0/data.csv"
        if not truth.exists():
            raise Failure(f"{recording}: no ground truth to judge by")
        words = [orb, vocabulary, folder / "orb_slam3.yaml", folder, folder / "times.txt", "run"]
        try:
            done = subprocess.run([str(pathlib.Path(w).resolve()) if w != "run" else w for w in words], cwd=scratch,
                                  capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=3600 * HOURS)
        except subprocess.TimeoutExpired as late:
            raise Failure(f"{recording}: not done after {HOURS} hours") from late
        written = pathlib.Path(scratch) / "f_run.txt"
        rows = to_tum(written.read_text()) if written.exists() else ""
        if not rows:
            raise Failure(f"{recording}: no trajectory; ORB-SLAM3 ended with {done.returncode}: "
                          f"{last_line(done.stderr or done.stdout)}")
        trajectory = pathlib.Path(scratch) / "orb.tum"
        trajectory.write_text(rows)
        return json.loads(evpose(program, "eval", trajectory, truth, "--align", align, "--json"))


def row(name, judged):
    a = judged.get("accuracy", judged)
    return (f"| {name} | {a['ate_mean_mm']:.1f} | {a['are_mean_deg']:.3f} | {a['ate_max_mm']:.1f} | "
            f"{100 * judged.get('coverage', float('nan')):.0f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=pathlib.Path)
    parser.add_argument("--orb", default="mono_inertial_euroc", help="ORB-SLAM3's program mono_inertial_euroc")
    parser.add_argument("--vocabulary", type=pathlib.Path, default=pathlib.Path("ORBvoc.txt"), help="its ORBvoc.txt")
    parser.add_argument("--evpose", type=pathlib.Path, default=ROOT / "build/release/apps/evpose/evpose")
    parser.add_argument("--align", choices=("se3", "sim3"), default="se3")
    asked = parser.parse_args()
    orb = shutil.which(asked.orb)
    if orb is None:
        print(f"orb_slam3: ORB-SLAM3 is not installed here: no program {asked.orb}; build it and name it with --orb", file=sys.stderr)
        return 2
    if not asked.vocabulary.exists():
        print(f"orb_slam3: {asked.vocabulary}: no such file; name ORB-SLAM3's ORBvoc.txt with --vocabulary", file=sys.stderr)
        return 2
    print(f"ORB-SLAM3, mono-inertial, aligned by {asked.align.upper().replace('SE3', 'SE(3)').replace('SIM3', 'Sim(3)')}:\n")
    print("| recording | mean ATE mm | mean ARE deg | largest ATE mm | coverage % |\n|---|---|---|---|---|")
    failed = []
    for recording in asked.recordings:
        try:
            print(row(recording.name, run(asked.evpose, orb, asked.vocabulary, recording, asked.align)), flush=True)
        except Failure as why:
            print(f"| {recording.name} | - | - | - | - |", flush=True)
            failed.append(str(why))
    for why in failed:
        print(f"orb_slam3: {why}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
