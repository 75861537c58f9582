# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/simulator.md: scenarios of `evpose simulate`, tracked from ground truth, scored after 0.3 s.

Making a recording takes half a minute of two cores per second of 640x480, two minutes at 1280x720, and half an hour for
the hover. Maps with errors are the true contours whose segments of 12 cm are moved across their direction.
"""
import dataclasses

import numpy as np

import files
import harness
import tables

SEGMENT_M = 0.12
SECONDS, HOVER_S = 5, 30
SPEEDS = ["speed_1", "speed_2", "speed_3"]
OTHERS = ["turning_1", "turning_2", "turning_3", "aggressive", "slow", "hover"]
HARD = ["hdr_window", "hdr_lights_off", "hdr_flicker", "fan", "people", "car"]
PLAIN = ["indoor_spiral", "outdoor_spiral", "landing"]
LARGE, SMALL = ("camera.size=720p",), ("camera.size=vga",)
LAMPS = (f"lamps.off_at_s={0.4 * SECONDS}", f"lamps.on_at_s={0.7 * SECONDS}")


@dataclasses.dataclass(frozen=True)
class Flight:
    name: str
    scenario: str
    settings: tuple = SMALL
    seconds: float = SECONDS
    rate_hz: int = 0         # of updates; 0: as shipped
    map_error_mm: int = 0    # 1 sigma of each segment


def flights():
    out = [Flight(f"{s}, 1280x720", s, LARGE) for s in PLAIN + SPEEDS]
    out += [Flight(s, s, SMALL + LAMPS if s == "hdr_lights_off" else SMALL) for s in PLAIN + SPEEDS + OTHERS + HARD]
    out += [Flight(f"imu_1khz, {rate} Hz", "imu_1khz", rate_hz=rate) for rate in (100, 200, 300, 1000)]
    out += [Flight(f"{s}, map {mm} mm off", s, map_error_mm=mm) for mm in (3, 5) for s in PLAIN]
    return [*out, Flight(f"hover of {HOVER_S} s, 320x240", "hover", tuple(harness.TINY), HOVER_S)]


def move_segments(source, target, sigma_m):
    """Writes the contours with each segment of a contour moved at random across its direction."""
    ply = files.Ply(source)
    position, tangent = ply.points(), ply.columns("tx", "ty", "tz")
    axis = np.abs(tangent).argmax(1)
    cell = np.floor(position[np.arange(len(position)), axis] / SEGMENT_M).astype(int)
    _, segment = np.unique(np.stack([ply.vertices["contour"], cell], 1), axis=0, return_inverse=True)
    shift = np.random.default_rng(1).normal(0, sigma_m, (segment.max() + 1, 3))[segment.ravel()]
    position += shift - (shift * tangent).sum(1, keepdims=True) * tangent
    for k, c in enumerate("xyz"):
        ply.vertices[c] = position[:, k]
    ply.vertices["sigma"] = sigma_m
    ply.write(target)


def measure(bench, flight):
    recording = bench.simulated(flight.scenario, flight.seconds, flight.settings)
    contours = recording.contours
    with bench.folder() as scratch:
        if flight.map_error_mm:
            contours = scratch / "contours.ply"
            move_segments(recording.contours, contours, 1e-3 * flight.map_error_mm)
        rate = ["--set", f"rate_hz={flight.rate_hz}"] if flight.rate_hz else []
        summary = bench.track(recording.folder, contours, scratch / "run", "--occluders", recording.mesh, *rate)
        return {"all": summary, "later": bench.later_accuracy(scratch / "run", recording.truth)}


def row(name, measured):
    summary, later = measured["all"], measured["later"]
    head = [name, summary["status"], f"{summary['coverage']:.2f}"]
    if later is None:
        return [*head, "-", "-", "-", "-"]
    nees = summary.get("accuracy", {}).get("nees6_mean", float("nan"))
    return [*head, f"{later['ate_mean_mm']:.2f}", f"{later['ate_max_mm']:.1f}", f"{later['are_mean_deg']:.3f}", f"{nees:.2f}"]


def make(bench):
    wanted = flights()
    if bench.quick:
        wanted = [flight for flight in wanted if flight.name in ("indoor_spiral", "indoor_spiral, map 5 mm off")]
    rows = [row(flight.name, bench.once(f"simulator: {flight}", lambda: measure(bench, flight))) for flight in wanted]
    heads = ["flight", "status", "coverage", "ATE mean mm", "max mm", "ARE mean deg", "NEES/6"]
    return bench.write_page("simulator", {"flights": tables.table(heads, rows)})
