# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/paper-evaluation.md: the evaluation of EV-Pose with its form and with the defaults: distributions of the error,
relative errors, rates of updates; docs/results/real.md: real recordings."""
import json
import pathlib
import subprocess
import sys

import drawing
import files
import harness
import numpy as np
import paper_real
import tables

FORMS = paper_real.FORMS
PLACES = {"indoors": ["room_spiral", "room_720p", "room_people", "room_hover"], "outdoors": ["courtyard_landing"]}
QUANTILES = (10, 25, 50, 75, 90, 95, 100)
RATES_HZ = (100, 200, 300)
COLOURS = {"paper": "#d1622b", "defaults": "#1f77d0"}
# What `--preset paper` sets, for programs that take settings alone.
PAPER_SETTINGS = ("registration.kind=temporal_field", "temporal_field.kernel=bilinear", "temporal_field.eta_s=0.01",
                  "events.noise_filter.support_min_s=0.01", "events.noise_filter.support_max_s=0.01", "fusion.kind=graph")


def angle_deg(q, p):
    return np.degrees(2 * np.arccos(np.clip(np.abs(np.sum(q * p, axis=-1)), 0, 1)))


def pose_errors(run, truth):
    """Of every pose of a run, mm and degrees."""
    rows = np.loadtxt(pathlib.Path(run) / "trajectory.tum", ndmin=2)
    p, q = files.Trajectory(np.loadtxt(truth)).at(rows[:, 0])
    return 1e3 * np.linalg.norm(rows[:, 1:4] - p, axis=1), angle_deg(rows[:, 4:8], q)


def tracked(bench, recording, words):
    """Summary of a run and the quantiles of its errors, in steps of a per cent."""
    with bench.folder() as scratch:
        summary = bench.track(recording.folder, recording.contours, scratch / "run", "--occluders", recording.mesh,
                              "--set", "overlays=0", *words)
        errors = pose_errors(scratch / "run", recording.truth)
    return {"accuracy": summary.get("accuracy", {}), "coverage": summary["coverage"], "status": summary["status"],
            "poses": len(errors[0]),
            "quantiles": [[round(float(v), 4) for v in np.percentile(e, range(101))] for e in errors]}


def measure(bench, recording, form, *extra):
    key = f"paper evaluation: {recording.name}, {form} {' '.join(extra)}"
    return bench.once(key, lambda: tracked(bench, recording, (*FORMS[form], *extra)))


def joined(measured, of):
    """Errors of several runs as one sample; each run by as many values as it has poses."""
    parts = [np.interp(np.linspace(0, 100, m["poses"]), range(101), m["quantiles"][of]) for m in measured]
    return np.sort(np.concatenate(parts))


def distributions(bench, peers):
    rows, curves = [], {}
    for place, names in PLACES.items():
        for form in FORMS:
            runs = [measure(bench, r, form) for r in peers if r.name in names]
            if not runs:
                continue
            for of, what in enumerate(("ATE mm", "ARE deg")):
                errors = curves[place, form, of] = joined(runs, of)
                rows.append([place, form, what, *(f"{v:.3g}" for v in np.percentile(errors, QUANTILES))])
    draw(bench.image("paper_cdf.svg"), curves)
    return tables.table(["place", "form", "error", *(f"{q} %" for q in QUANTILES)], rows)


def draw(path, curves):
    """Share of the poses with an error up to the axis's value, which is logarithmic."""
    width, height, left, top, gap = 300, 200, 60, 50, 70
    limits, units = ((0.1, 100), (1e-3, 1)), ("ATE, mm", "ARE, deg")
    places = list(dict.fromkeys(place for place, _, _ in curves))
    svg = drawing.Svg(left + 2 * (width + gap), top + len(places) * (height + gap))
    svg.text(left, 20, "Share of poses with an error up to ...", size=15)
    for k, (form, colour) in enumerate(COLOURS.items()):
        svg.text(left + 300 + 90 * k, 20, form, fill=colour)
    for i, place in enumerate(places):
        for of in range(2):
            x0, y0 = left + of * (width + gap), top + i * (height + gap)
            low, high = np.log10(limits[of])
            svg.frame(x0, y0, width, height)
            svg.text(x0 + width / 2, y0 + height + 32, f"{place}: {units[of]}", "middle")
            for decade in range(round(low), round(high) + 1):
                x = x0 + width * (decade - low) / (high - low)
                svg.line(x, y0, x, y0 + height)
                svg.text(x, y0 + height + 15, f"{10.0 ** decade:g}", "middle", 10)
            for share in (0, 50, 100):
                svg.text(x0 - 6, y0 + height * (1 - share / 100) + 4, f"{share} %", "end", 10)
            for form, colour in COLOURS.items():
                if (place, form, of) not in curves:
                    continue
                errors = np.percentile(curves[place, form, of], range(101))
                at = np.clip((np.log10(np.maximum(errors, 1e-9)) - low) / (high - low), 0, 1)
                svg.curve(x0 + width * at, y0 + height * (1 - np.arange(101) / 100), colour)
    svg.write(path)


def relative(bench, peers):
    keys = {"RTE 10 ms mm": "rte_10ms_mm", "RTE 100 ms mm": "rte_100ms_mm", "RTE 1 s mm": "rte_1s_mm",
            "RRE 10 ms deg": "rre_10ms_deg", "RRE 100 ms deg": "rre_100ms_deg", "RRE 1 s deg": "rre_1s_deg"}
    rows = []
    for recording in peers:
        for form in FORMS:
            a = measure(bench, recording, form)["accuracy"]
            rows.append([recording.name, form, *(f"{a[k]:.3f}" if a.get(k) is not None else "-" for k in keys.values())])
    return tables.table(["recording", "form", *keys], rows)


def errors(m):
    a = m["accuracy"]
    if "ate_mean_mm" not in a:
        return f"- ({m['status']})"
    return f"{a['ate_mean_mm']:.2f}, {a['are_mean_deg']:.3f}, {100 * m['coverage']:.0f}"


def rates(bench, peers):
    rows = [[f"{form}, {rate} Hz", *(errors(measure(bench, r, form, *([] if rate == 300 else ["--set", f"rate_hz={rate}"])))
                                    for r in peers)] for form in FORMS for rate in RATES_HZ]
    return tables.table(["form", *(r.name for r in peers)], rows)


def real_chunk(bench):
    rows = []
    for form, settings in (("paper", PAPER_SETTINGS), ("defaults", ())):
        def run(settings=settings):
            with bench.folder() as scratch:
                words = [sys.executable, pathlib.Path(__file__).with_name("mvsec_chunk.py"), bench.evpose,
                         bench.shared / "data/real/mvsec_indoor_flying1_chunk", scratch, "--json",
                         *(w for s in settings for w in ("--set", s))]
                done = subprocess.run([str(w) for w in words], capture_output=True, text=True)
            if done.returncode != 0:
                raise harness.Failure(f"mvsec_chunk.py: {harness.last_line(done.stderr)}")
            return json.loads(done.stdout)
        f = bench.once(f"paper evaluation: real chunk, {form}", run)
        rows.append([form, f["status"], f"{f['ate_mean_mm']:.2f}", f"{f['ate_max_mm']:.2f}", f"{f['are_mean_deg']:.3f}",
                     f"{f['sharpness_estimate']:.4f}", f"{f['sharpness_truth']:.4f}"])
    return tables.table(["form", "status", "mean ATE mm", "largest mm", "mean ARE deg", "sharpness", "with the truth"], rows)


def sections(bench):
    peers = bench.peers()
    return {"distributions": distributions(bench, peers), "relative": relative(bench, peers), "rates": rates(bench, peers)}


def make_real(bench):
    """docs/results/real.md."""
    return bench.write_page("real", {"real chunk": real_chunk(bench), "board": paper_real.boards(bench),
                                     "star": paper_real.star(bench)})
