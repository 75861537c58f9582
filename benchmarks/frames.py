# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/frames.md: frames alone, events alone and both, on simulated flights with hover, rest and darkness."""
import harness
import tables

FRAMES = ("frames.rate_hz=30", "frames.exposure_ms=4")
DARK = ("frames.rate_hz=30", "frames.exposure_ms=25", "frames.full_well_e=500", "world.lamp_lux=2", "world.window_cd_m2=2")
# Name: scenario, seconds, settings.
FLIGHTS = {"hover": ("hover", 5, FRAMES),
           "rest, then flight": ("indoor_spiral", 5, (*FRAMES, "trajectory.rest_s=2.5")),
           "dark": ("indoor_spiral", 5, DARK),
           "spiral": ("indoor_spiral", 5, FRAMES),
           "aggressive": ("aggressive", 5, FRAMES)}
SEEDS = (101, 102)  # that no default was chosen on
USES = {"events alone": "off", "frames alone": "alone", "both": "fused"}
HEAD = ["flight", "seed", *(f"{name}: ATE mm, ARE deg, NEES/6" for name in USES), "both to the better"]


def measure(bench, recording):
    """Of each use of the frames: mean ATE, mean ARE, NEES/6, coverage, status."""
    out = {}
    for name, use in USES.items():
        with bench.folder() as scratch:
            summary = bench.track(recording.folder, recording.contours, scratch / "run", "--occluders", recording.mesh,
                                  "--set", f"frames.use={use}", "--set", "overlays=0")
        accuracy = summary.get("accuracy", {})
        out[name] = {key: accuracy.get(key) for key in ("ate_mean_mm", "are_mean_deg", "nees6_mean")}
        out[name] |= {"coverage": summary.get("coverage"), "status": summary["status"]}
    return out


def cell(figures):
    if figures["ate_mean_mm"] is None:
        return f"- ({figures['status']})"
    lost = "" if figures["coverage"] > 0.99 else f" ({100 * figures['coverage']:.0f} %)"
    return f"{figures['ate_mean_mm']:.2f}, {figures['are_mean_deg']:.3f}, {figures['nees6_mean']:.2f}{lost}"


def row(name, seed, measured):
    ate = {use: measured[use]["ate_mean_mm"] for use in USES}
    ratio = "-" if None in ate.values() else f"{ate['both'] / min(ate['events alone'], ate['frames alone']):.2f}"
    return [name, str(seed), *(cell(measured[use]) for use in USES), ratio]


def make(bench):
    wanted = {"hover": FLIGHTS["hover"]} if bench.quick else FLIGHTS
    rows = []
    for name, (scenario, seconds, settings) in wanted.items():
        for seed in SEEDS[:1] if bench.quick else SEEDS:
            flight = bench.simulated(scenario, seconds, (*harness.TINY, *settings, *harness.seeds(seed)), "frames_" + name.split(",")[0])
            rows.append(row(name, seed, bench.once(f"frames: {name}, {seed}", lambda: measure(bench, flight))))
    return bench.write_page("frames", {"flights": tables.table(HEAD, rows)})
