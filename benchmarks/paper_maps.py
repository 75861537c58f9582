# SPDX-License-Identifier: BSD-3-Clause
"""The paper's map (`evpose map build --preset paper`) beside ours, docs/results/paper-map.md: errors, and tracking with both."""
import harness
import maps
import tables

KINDS = {"paper": ("--preset", "paper"), "ours": ()}
FORMS = {"paper": ("--preset", "paper"), "defaults": ()}


def measure(bench, place, recordings):
    """Of each kind of map: what `map compare` says, and figures of tracking by form and recording."""
    out = {}
    cloud = bench.shared / f"data/peer/maps/{place}_map_raw.ply"
    with bench.folder() as scratch:
        for kind, words in KINDS.items():
            built = scratch / f"{kind}.h5"
            bench.run("map", "build", cloud, "-o", built, *words)
            score = bench.run("map", "compare", built, recordings[0].contours, "--cloud", cloud)
            tracking = {r.name: {form: maps.track(bench, r, built, scratch, "--set", "overlays=0", *settings)
                                 for form, settings in FORMS.items()} for r in recordings}
            out[kind] = {"score": score, "tracking": tracking}
    return out


def sections(bench):
    places = {}
    for recording in bench.peers():
        places.setdefault(harness.PEER[recording.name], []).append(recording)
    measured = {place: bench.once(f"paper maps: {place}", lambda: measure(bench, place, recordings))
                for place, recordings in places.items()}
    errors = [maps.score_row(f"{place}, {kind}", m["score"]) for place, kinds in measured.items() for kind, m in kinds.items()]
    rows = [[name, *(measured[place][kind]["tracking"][name][form] for kind in KINDS for form in FORMS)]
            for place, recordings in places.items() for name in (r.name for r in recordings)]
    heads = ["recording", *(f"map: {kind}, form: {form}" for kind in KINDS for form in FORMS)]
    return {"errors": tables.table(maps.SCORE, errors), "tracking": tables.table(heads, rows)}
