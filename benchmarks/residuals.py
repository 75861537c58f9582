# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/residuals.md: where events lie beside the contours of the true pose, after what the measurement model takes
off: by contrast, polarity and speed, on shared recordings and on flights of reporting seeds."""
import math
import pathlib
import statistics

import edge_delay
import tables

UNSEEN = (100, 101, 102, 103, 105, 107)  # the first of halls, courtyards and canyons whose events fit into memory twice
FEWEST = 500  # events of a class, or looks, below which a recording does not count in a spread
FEWEST_LOOKS = 50
DELAY, SENSE, SPEED, TIME = "events per crossing", "sense", "speed", "time between looks s"
DIRECTION = "direction across the contour"
LEFT = "left over px"
OF_TRACKER = f"tracker's pose: {LEFT}"


def tables_by_first_column(markdown):
    """Rows of each table, by the name of its first column."""
    found = {}
    for block in markdown.split("\n\n"):
        lines = [line for line in block.splitlines() if line.startswith("|")]
        if len(lines) > 2:
            head = tables.cells_of(lines[0])
            head = [name if head.index(name) == i else f"tracker's pose: {name}" for i, name in enumerate(head)]
            found[head[0]] = [dict(zip(head, tables.cells_of(line))) for line in lines[2:]]
    return found


def with_true_calibration(folder, target):
    """A flight of a seed is handed over with a wrong calibration; the truth lies beside it."""
    target.mkdir()
    for name in ("events.h5", "imu.csv", "imu.yaml", "groundtruth.tum"):
        (target / name).symlink_to((folder / name).resolve())
    (target / "camchain-imucam.yaml").symlink_to((folder / "camchain-imucam_truth.yaml").resolve())
    return target


def prepared(folder, target):
    return with_true_calibration(folder, target) if (folder / "camchain-imucam_truth.yaml").exists() else folder


def measure(bench, recording):
    with bench.folder() as scratch:
        folder = prepared(recording.folder, pathlib.Path(scratch) / "flight")
        return tables_by_first_column(bench.run("bench", "residuals", folder, "--map", recording.contours, "--occluders",
                                                recording.mesh, "--set", "fusion.calibration.on=false"))


def mean_and_spread(found, table, pick, count, fewest):
    """Mean by count, and root mean square over the recordings with enough of it, of what is left over."""
    rows = [row for one in found.values() for row in one[table] if pick(row)]
    counted = [(int(row[count]), float(row[LEFT])) for row in rows]
    all_of_it = sum(n for n, _ in counted)
    each = [left for n, left in counted if n >= fewest]
    if not all_of_it or not each:
        return "-"
    mean = sum(n * left for n, left in counted) / all_of_it
    return f"{mean:+.3f}, {math.sqrt(sum(left * left for left in each) / len(each)):.3f} ({len(each)})"


def delay_rows(groups):
    classes = [(row[DELAY], row["polarity"]) for row in next(iter(next(iter(groups.values())).values()))[DELAY]]
    return [[n, polarity, *(mean_and_spread(found, DELAY, lambda r: (r[DELAY], r["polarity"]) == (n, polarity), "events", FEWEST)
                            for found in groups.values())] for n, polarity in classes]


def speed_rows(groups):
    classes = [row[SPEED] for row in next(iter(next(iter(groups.values())).values()))[SPEED]]
    return [[c, *(mean_and_spread(found, SPEED, lambda r: r[SPEED] == c, "looks", FEWEST_LOOKS) for found in groups.values())]
            for c in classes]


def direction_rows(groups):
    """Of each group: root mean square over recordings of offset, sigma and lasting sigma; median memory."""
    def rms(rows, key):
        return math.sqrt(sum(float(row[key]) ** 2 for row in rows) / len(rows))

    rows = []
    for name, found in groups.items():
        for direction in [row[DIRECTION] for row in next(iter(found.values()))[DIRECTION]]:
            those = [row for one in found.values() for row in one[DIRECTION]
                     if row[DIRECTION] == direction and int(row["looks"]) >= FEWEST_LOOKS]
            if those:
                rows.append([name, direction, len(those), *(f"{rms(those, key):.3f}" for key in
                                                            ("offset px", "sigma px", "of it lasts px")),
                             f"{statistics.median(float(row['memory s']) for row in those):.2f}"])
    return rows


def budget_rows(groups):
    """Of each recording, by direction: the mean offset at the true pose, and what the tracker's pose leaves of it."""
    return [[name, *(f"{row[LEFT]}, {row[OF_TRACKER]}" for row in one[SENSE]
                     if row[SENSE].startswith("in the image"))]
            for found in groups.values() for name, one in found.items()]


def recording_rows(groups):
    rows = []
    for found in groups.values():
        for name, one in found.items():
            sense = {row[SENSE]: row for row in one[SENSE]}
            motion, darker = sense["along the motion"], sense["to the darker side"]
            lasting = next(row for row in one[TIME] if row[TIME].startswith("0.20"))
            rows.append([name, motion["looks"], motion[LEFT], darker[LEFT], motion["scatter px"],
                         motion["tracker's pose: left over px"], motion["tracker's pose: scatter px"], lasting["correlation"]])
    return rows


def make(bench):
    def all_of(recordings):
        return {r.name: bench.once(f"residuals: {r.name}", lambda: measure(bench, r)) for r in recordings}
    groups = {"shared": all_of(bench.peers())}
    if not bench.quick:
        groups["shared, places with clutter"] = all_of(bench.more_peers())
    flights = bench.unseen_flights()
    groups["unseen flights"] = all_of(flights[:1] if bench.quick else
                                      [f for f in flights if int(f.folder.name[-4:]) in UNSEEN])
    return bench.write_page("residuals", {
        **edge_delay.sections(bench, prepared),
        "delay": tables.table([DELAY, "polarity", *groups], delay_rows(groups)),
        "speed": tables.table([SPEED, *groups], speed_rows(groups)),
        "directions": tables.table(["", "direction", "recordings", "offset px, rms", "sigma px, rms", "of it lasts px, rms",
                                    "memory s, median"], direction_rows(groups)),
        "budget": tables.table(["recording", *(f"{angle} deg: true pose, tracker's" for angle in (0, 45, 90, 135))],
                               budget_rows(groups)),
        "recordings": tables.table(["recording", "looks", "along the motion px", "to the darker side px", "scatter px",
                                    "tracker's pose: along the motion px", "scatter px", "correlation after 0.2 to 0.4 s"],
                                   recording_rows(groups))})
