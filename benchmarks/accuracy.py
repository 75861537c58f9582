# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/accuracy.md: every shared recording, tracked with the shipped defaults from ground truth, no alignment."""
import dataclasses
import json
import pathlib
import shutil
import subprocess
import sys

import harness
import tables

FIELD = ["--set", "registration.kind=temporal_field"]
# The calibration files of the recordings state nothing; harness.py sets that they are known.
UNSURE = ["--set", "fusion.calibration.on=true"]


@dataclasses.dataclass(frozen=True)
class Variant:
    name: str
    settings: tuple = ()
    occluders: bool = True
    imu: bool = True


def everywhere(decay_s):
    return (*FIELD, "--set", f"temporal_field.eta_s={decay_s}")


VARIANTS = [
    Variant("each event once"),
    Variant("each event once, no occluders", occluders=False),
    Variant("temporal field", tuple(FIELD)),
    Variant("temporal field, bilinear", (*FIELD, "--set", "temporal_field.kernel=bilinear")),
    Variant("temporal field, 5 ms everywhere", everywhere(0.005)),
    Variant("temporal field, 30 ms everywhere", everywhere(0.03)),
    Variant("preset paper", ("--preset", "paper")),
    Variant("each event once, no IMU", imu=False),
    Variant("each event once, no IMU, the lens not known", tuple(UNSURE), imu=False),
    Variant("each event once, no IMU, the lens not known, no offsets", (*UNSURE, "--set", "fusion.segment_offsets=off"), imu=False),
    Variant("temporal field, no IMU", tuple(FIELD), imu=False),
]
# Of the second table.
DETAILED = ["each event once", "temporal field", "preset paper", "each event once, no IMU",
            "each event once, no IMU, the lens not known", "each event once, no IMU, the lens not known, no offsets",
            "temporal field, no IMU"]


def without_imu(folder, target):
    target.mkdir()
    for name in ("events.h5", "groundtruth.tum", "camchain-imucam.yaml"):
        shutil.copy(folder / name, target / name)
    return target


def measure(bench, recording, variant):
    with bench.folder() as scratch:
        folder = recording.folder if variant.imu else without_imu(recording.folder, scratch / "recording")
        occluders = ["--occluders", recording.mesh] if variant.occluders else []
        summary = bench.track(folder, recording.contours, scratch / "run", *occluders, *variant.settings)
        return {"all": summary, "later": bench.later_accuracy(scratch / "run", recording.truth)}


def mean_errors(row, later=False):
    accuracy = row["later"] if later else row["all"]["accuracy"]
    if accuracy is None:
        return "-"
    mark = "" if row["all"]["status"] == "tracking" else " *"
    return f"{accuracy['ate_mean_mm']:.2f}, {accuracy['are_mean_deg']:.3f}{mark}"


def consistency(row):
    return f"{row['all']['accuracy']['nees6_mean']:.2f}, {row['all']['accuracy']['lag_ms']:.2f}"


def shared_tables(bench):
    measured = {}
    for recording in bench.peers():
        measured[recording.name] = {
            variant.name: bench.once(f"accuracy: {recording.name}, {variant.name}",
                                     lambda: measure(bench, recording, variant))
            for variant in (VARIANTS[:2] + VARIANTS[-1:] if bench.quick else VARIANTS)}
    first = VARIANTS[0].name
    errors = tables.pivot(measured, mean_errors)
    later = [f"{first}, after {harness.START_S} s", *(mean_errors(rows[first], True) for rows in measured.values())]
    errors.insert(3, "| " + " | ".join(later) + " |")
    detailed = {name: {v: row for v, row in rows.items() if v in DETAILED} for name, rows in measured.items()}
    return [*errors, "", "NEES/6, lag ms:", "", *tables.pivot(detailed, consistency)]


def real_chunk(bench):
    """Of MVSEC, from events alone."""
    def measure_chunk():
        with bench.folder() as scratch:
            done = subprocess.run([sys.executable, pathlib.Path(__file__).with_name("mvsec_chunk.py"), bench.evpose,
                                   bench.shared / "data/real/mvsec_indoor_flying1_chunk", scratch, "--json"],
                                  capture_output=True, text=True)
        if done.returncode != 0:
            raise harness.Failure(f"mvsec_chunk.py: {harness.last_line(done.stderr)}")
        return json.loads(done.stdout)

    figures = bench.once("accuracy: real chunk", measure_chunk)
    return tables.table(["figure", "value"], [(k, v) for k, v in figures.items() if not isinstance(v, dict)])


def make(bench):
    return bench.write_page("accuracy", {"recordings": shared_tables(bench), "real flight": real_chunk(bench)})
