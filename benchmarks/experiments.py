# SPDX-License-Identifier: BSD-3-Clause
"""Pages of docs/results whose figures `evpose bench` prints, and the picture of the ablation."""
import concurrent.futures
import re

import drawing
import harness
import learn
import tables

FLIGHT_S, LANDING_S = 5, 8
# Name, scenario, size of the image, seconds.
FLIGHTS = [("indoor_spiral_720p", "indoor_spiral", "720p", FLIGHT_S), ("landing_touchdown", "landing", "vga", LANDING_S),
           *((name, name, "vga", FLIGHT_S) for name in ("people", "hdr_window", "turning_3", "landing", "outdoor_spiral",
                                                        "speed_1", "speed_3"))]
UNSEEN_SEEDS = 40
LONG_CUT, LONG_CUT_S = ["indoor_spiral", "outdoor_spiral"], 5  # kidnapped on the flights of 10 s that learn makes
MOVING = {"fan": ("camera.size=vga",), "people": ("camera.size=vga",), "car": tuple(harness.TINY)}
BAR, BAR_WEAK, BAR_END_MM = "#1f77d0", "#a9c4e2", 4


def variants(bench, experiment, recording, *begins):
    """Rows of `evpose bench EXPERIMENT`, by variant."""
    words = ["bench", experiment, "--recording", recording.folder, "--map", recording.contours, "--occluders",
             recording.mesh, *(word for begin in begins for word in ("--variant", begin))]
    printed = bench.once(f"{experiment}: {recording.name} {' '.join(begins)}", lambda: bench.run(*words))
    (rows,) = tables.read(printed).values()
    return {row["variant"]: row for row in rows}


def errors(row):
    return f"{row['ATE mean mm']}, {row['ARE mean deg']}"


def make_fusion(bench):
    begins = ["EKF (full"] if bench.quick else []
    shared = {recording.name: variants(bench, "fusion", recording, *begins) for recording in bench.peers()}
    flown = {}
    for name, scenario, size, seconds in FLIGHTS[2:3] if bench.quick else FLIGHTS:
        flight = bench.simulated(scenario, seconds, (f"camera.size={size}",), name)
        flown[name] = variants(bench, "fusion", flight, *begins)
    cells = {"mean ATE mm, mean ARE deg": errors,
             "NEES/6, velocity mm/s, jitter mm": lambda r: f"{r['NEES/6']}, {r['velocity mm/s']}, {r['jitter mm']}",
             "RTE over 10 and 100 ms, mm": lambda r: f"{r['RTE 10 ms mm']}, {r['RTE 100 ms mm']}"}
    lines = [line for what, cell in cells.items()
             for line in (what[0].upper() + what[1:] + ":", "", *tables.pivot(shared, cell), "")]
    simulated = tables.transposed(flown, lambda row: f"{errors(row)}, {row['NEES/6']}")
    return bench.write_page("fusion", {"shared recordings": lines, "simulated flights": simulated})


def make_ablation(bench):
    begins = ["all", "without IMU"] if bench.quick else []
    measured = {recording.name: variants(bench, "ablation", recording, *begins) for recording in bench.peers()}
    draw_ablation(bench.image("ablation.svg"), measured)
    lines = ["Mean ATE mm, mean ARE deg:", "", *tables.pivot(measured, errors), "", "NEES/6:", "",
             *tables.pivot(measured, lambda row: row["NEES/6"])]
    return bench.write_page("ablation", {"variants": lines})


def draw_ablation(path, measured):
    """A bar a variant, a column a recording."""
    names = list(dict.fromkeys(name for rows in measured.values() for name in rows))
    left, row, panel = 300, 18, 120
    svg = drawing.Svg(left + (panel + 40) * len(measured), 60 + row * len(names))
    svg.text(12, 20, f"Mean error, mm (bars end at {BAR_END_MM} mm; faint: not `tracking` at the end)", size=15)
    for i, name in enumerate(names):
        svg.text(left - 10, 52 + i * row + row - 7, name, "end")
    for j, (recording, rows) in enumerate(measured.items()):
        x = left + j * (panel + 40)
        svg.text(x, 44, recording)
        for i, name in enumerate(names):
            if name not in rows:
                continue
            value, y = float(rows[name]["ATE mean mm"]), 52 + i * row
            length = panel * min(value, BAR_END_MM) / BAR_END_MM
            svg.bar(x, y, length, row - 5, BAR if rows[name]["at the end"] == "tracking" else BAR_WEAK)
            svg.text(x + length + 4, y + row - 7, f"{value:.2f}", size=10)
    svg.write(path)


def make_relocalization(bench):
    seeds = 1 if bench.quick else 10
    printed = bench.once(f"relocalize: wrong, {seeds}",
                         lambda: bench.run("bench", "relocalize", bench.shared / "data/peer", "--seeds", seeds, "--only",
                                           "room_spiral,room_720p,courtyard_landing", "--starts", "wrong"))
    return bench.write_page("relocalization", {"wrong": printed.strip().splitlines()})


def make_kidnapping(bench):
    seeds, only = (1, "room_spiral") if bench.quick else (10, "room_spiral,courtyard_landing")
    printed = bench.once(f"kidnap: {seeds}", lambda: bench.run("bench", "kidnap", bench.shared / "data/peer", "--seeds", seeds,
                                                               "--only", only))
    cut_s, places = (0.1, 1) if bench.quick else (LONG_CUT_S, 25)
    lines = []
    for scenario in LONG_CUT:
        flight = learn.fresh_flight(bench, scenario, learn.FRESH[scenario][0], learn.FRESH[scenario][0], learn.LEARNING_S)
        words = ("bench", "kidnap", flight.folder.parent, "--only", flight.folder.name, "--seeds", places, "--cut-s", cut_s)
        rows = bench.once(f"kidnap: {scenario}, {cut_s} s", lambda w=words: bench.run(*w)).strip().splitlines()
        rows[-1] = rows[-1].replace(flight.folder.name, f"`{flight.name}`")
        lines += rows[-1:] if lines else rows
    return bench.write_page("kidnapping", {"kidnap": printed.strip().splitlines(), "long": lines})


def make_faults(bench):
    few = ["--only", "room_720p", "--replays", 12] if bench.quick else []
    printed = bench.once("faults", lambda: bench.run("bench", "faults", bench.shared / "data/peer", *few))
    rows = tables.read(printed)[""]
    shown = [column for column in rows[0] if column not in ("updates", "in replays", "not finite")]
    lines = [*tables.table(shown, [[row[column] for column in shown] for row in rows]), "", printed.strip().splitlines()[-1]]
    return bench.write_page("faults", {"replays": lines})


DRAWS = 20  # of all errors of an ordinary calibration, for each recording
CALIBRATION_FLIGHTS = {"hall, 10 s": "indoor_spiral", "landing, 10 s": "landing"}
CALIBRATION_FLIGHT_S = 10


def make_calibration(bench):
    only = ["--only", "room_720p"] if bench.quick else []
    data = bench.shared / "data/peer"
    printed = bench.once("calibration", lambda: bench.run("bench", "calibration", data, *only))
    draws = ["--draws", 2 if bench.quick else DRAWS]

    def spoilt(name):
        words = [data, "--only", name]
        if name in CALIBRATION_FLIGHTS:
            flight = bench.simulated(CALIBRATION_FLIGHTS[name], CALIBRATION_FLIGHT_S, ("camera.size=vga",))
            words = [flight.folder.parent, "--only", flight.folder.name]
        text = bench.once(f"calibration-errors by second, {name}", lambda: bench.run("bench", "calibration-errors", *words, *draws))
        return {heading: [{**row, "recording": name} for row in rows] for heading, rows in tables.read(text).items()}

    names = ["room_720p"] if bench.quick else [*harness.PEER, *CALIBRATION_FLIGHTS]
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        found = list(pool.map(spoilt, names))
    rows = [row for one in found for row in one[""]]
    seconds = [row for one in found for row in one["Told, by second of data"]]
    single = [list(row.values()) for row in rows if not is_drawn(row)]
    return bench.write_page("calibration", {"errors": printed.splitlines(), "pose": tables.table(list(rows[0]), single),
                                            "summary": calibration_summary(rows), "seconds": calibration_seconds(seconds)})


def is_drawn(row):
    return row["given wrong"].startswith("draw")


def calibration_seconds(rows):
    """Means over the drawn calibrations, and those over all recordings."""
    names, seconds = (list(dict.fromkeys(row[column] for row in rows)) for column in ("recording", "second"))

    def cell(own):
        if not own:
            return "-"
        camera, nees = (sum(float(row[column]) for row in own) / len(own) for column in ("camera mm", "NEES/6"))
        return f"{camera:.1f}, {nees:.2f}"

    drawn = [row for row in rows if is_drawn(row)]
    lines = [[f"{int(k)} to {int(k) + 1}", *(cell([row for row in drawn if row["second"] == k and name in (row["recording"], None)])
                                             for name in [*names, None])] for k in seconds]
    return tables.table(["second", *names, "all"], lines)


def calibration_summary(rows):
    """Over the drawn calibrations of each recording."""
    lines = []
    for recording in dict.fromkeys(row["recording"] for row in rows):
        own = [row for row in rows if row["recording"] == recording]
        true = next(row for row in own if row["given wrong"] == "nothing")
        drawn = [row for row in own if is_drawn(row)]

        def column(name, drawn=drawn):
            return [float(row[name]) for row in drawn if re.fullmatch(r"[0-9.]+", row[name])]

        def mean(name, digits=1):
            values = column(name)
            return f"{sum(values) / len(values):.{digits}f}" if values else "-"

        lines.append([recording, true["camera mm"], true["told: camera mm"], mean("camera mm"), mean("NEES/6", 0),
                      mean("silently wrong %", 0), mean("told: camera mm"), f"{max(column('told: camera mm'), default=0):.1f}",
                      mean("told: body mm"), mean("told: NEES/6", 2), mean("told: tracking %", 0),
                      sum(share > 0 for share in column("told: silently wrong %"))])
    return tables.table(["recording", "true, known: camera mm", "true, told: camera mm", "drawn, believed: camera mm", "NEES/6",
                         "silently wrong %", "drawn, told: camera mm", "worst", "body mm", "told: NEES/6",
                         "told: tracking %", f"told: of {DRAWS} draws, silently wrong at times"], lines)


def event_table(texts):
    """A row for a kind of events, a column for a recording: shares left out for polarity and for motion, and of what is used."""
    columns = {}
    for name, text in texts.items():
        (rows,) = tables.read(text).values()
        column = {row["events"]: f"{row['left out: polarity']}, {row['left out: motion']}, {row['share of the used']}"
                  for row in rows}
        right, buffer = re.search(r"zone: ([\d.]+ %) right.* ([\d.]+ %) lie in", text).groups()
        columns[name] = {**column, "polarity predicted rightly, share in the buffer zone": f"{right}, {buffer}"}
    kinds = list(next(iter(columns.values())))
    return tables.table(["events", *columns], [[kind, *(column[kind] for column in columns.values())] for kind in kinds])


def make_events(bench):
    kinds = {"defaults": [], "flow": ["--set", "registration.ego_motion_test=true"]}
    figures = {}
    for key, settings in kinds.items():
        texts = {}
        for scenario, size in list(MOVING.items())[:1] if bench.quick else MOVING.items():
            recording = bench.simulated(scenario, FLIGHT_S, (*size, "truth.events=true"), f"{scenario}_truth")
            name = scenario + (", 320x240" if size == tuple(harness.TINY) else "")
            texts[name] = bench.once(f"events: {scenario}, {key}",
                                     lambda: bench.run("bench", "events", recording.folder, *settings))
        figures[key] = event_table(texts)
    return bench.write_page("events", figures)


def make_unseen(bench):
    """Seeds from 100 on are for reporting. What is finished stays in SCRATCH, as the program keeps it."""
    output = bench.scratch / ("unseen-quick" if bench.quick else "unseen")
    seeds = [1, "--quick"] if bench.quick else [UNSEEN_SEEDS]
    bench.run("bench", "unseen", "--from", 100, "-o", output, "--keep", bench.unseen_folder, "--minutes", bench.minutes,
              "--seeds", *seeds)
    parts = re.findall(r"<!-- figures: (.*?) -->\n(.*?)<!-- end -->", (output / "README.md").read_text(), re.DOTALL)
    return bench.write_page("unseen", {key: lines.splitlines() for key, lines in parts})
