# SPDX-License-Identifier: BSD-3-Clause
"""What goes wrong at people's desks: each situation spoils one thing of a healthy flight, or of a command.

A situation is made inside a folder that holds the flight as a user has it: `flight` (events, IMU and calibration, no
ground truth), `map.h5`, `cloud.ply` and `start.tum`. What it changes it first copies to `spoilt`.
"""
import dataclasses
import os
import pathlib
import re
import shutil
import struct
import typing

import h5py
import numpy as np

TRACK = "track spoilt --map map.h5 --init start.tum -o run"
LIVE = TRACK + " --set relocalization.on=false"  # no search for the pose, which takes long
CHECK = "check spoilt --map map.h5 --init start.tum"
CALIBRATION = "camchain-imucam.yaml"


@dataclasses.dataclass
class Situation:
    what: str
    command: str  # after "evpose"
    status: int
    says: list  # expressions that the line must match
    prepare: typing.Callable = lambda place: None
    inside: str = ""  # a wrapper that the command runs in; needs rights that not every machine gives


def spoilt(place):
    """A copy of the flight to spoil."""
    shutil.copytree(place / "flight", place / "spoilt")
    return place / "spoilt"


def edit(name, pattern, new, *, times=1):
    """In a text file of the flight, what matches is replaced."""
    def prepare(place):
        path = spoilt(place) / name
        text, count = re.subn(pattern, new, path.read_text(), count=times, flags=re.MULTILINE)
        assert count > 0, f"{name} has no {pattern}"
        path.write_text(text)
    return prepare


def add(name, content):
    def prepare(place):
        (spoilt(place) / name).write_text(content)
    return prepare


def cut(name, share):
    """Only the first part of a file of the flight."""
    def prepare(place):
        path = spoilt(place) / name
        path.write_bytes(path.read_bytes()[:int(share * path.stat().st_size)])
    return prepare


def imu(change):
    """The IMU's rows (t in ns, rates, forces) changed."""
    def prepare(place):
        path = spoilt(place) / "imu.csv"
        head = path.read_text().split("\n", 1)[0]
        rows = np.loadtxt(path, delimiter=",", skiprows=1)
        rows = change(rows)
        lines = [f"{int(row[0])}," + ",".join(f"{value:.9f}" for value in row[1:]) for row in rows]
        path.write_text("\n".join([head, *lines]) + "\n")
    return prepare


def events(change):
    """The columns of the events changed: a function of the open file."""
    def prepare(place):
        with h5py.File(spoilt(place) / "events.h5", "r+") as file:
            change(file)
    return prepare


def set_event(name, index, value):
    def change(file):
        file[f"events/{name}"][index] = value
    return events(change)


def no_events(file):
    for name in "txyp":
        file[f"events/{name}"].resize((0,))


def columns(rows, order, signs=(1, 1, 1)):
    """Both sensors of the IMU mounted or named otherwise."""
    rows = rows.copy()
    for first in (1, 4):
        rows[:, first:first + 3] = rows[:, [first + k for k in order]] * signs
    return rows


def scaled(rows, columns_of, factor):
    rows = rows.copy()
    rows[:, columns_of] *= factor
    return rows


def with_gap(rows):
    t_s = (rows[:, 0] - rows[0, 0]) * 1e-9
    return rows[(t_s < 0.3) | (t_s > 0.5)]


def with_nan(rows):
    rows = rows.copy()
    rows[40, 2] = np.nan
    return rows


def other_events(name, share=1.0):
    """The events as a file of another kind, cut; made beforehand by `evpose convert`."""
    def prepare(place):
        folder = spoilt(place)
        (folder / "events.h5").unlink()
        whole = (place / name).read_bytes()
        (folder / name).write_bytes(whole[:int(share * len(whole))])
    return prepare


def dataflash(t_ns, samples, first_us=0):
    """An ArduPilot's log that holds an IMU: stamps on its own clock, axes forward, right, down as given."""
    def kind(number, length, name, form, names):
        return struct.pack("<3BBB4s16s64s", 0xA3, 0x95, 0x80, number, length, name, form, names)

    log = [kind(0x80, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns"),
           kind(0x90, 36, b"IMU", b"QBffffff", b"TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ")]
    for t, row in zip(t_ns, samples):
        log.append(struct.pack("<3BQB6f", 0xA3, 0x95, 0x90, max(0, first_us + int(t) // 1000), 0, *row))
    return b"".join(log)


def stamps_in_seconds(place):
    path = spoilt(place) / "imu.csv"
    head, *lines = path.read_text().splitlines()
    rows = [line.split(",", 1) for line in lines]
    path.write_text("\n".join([head, *(f"{int(t) * 1e-9:.9f},{rest}" for t, rest in rows)]) + "\n")


def slow_log(place):
    """The autopilot's log as it is by default: 25 Hz."""
    folder = spoilt(place)
    rows = np.loadtxt(folder / "imu.csv", delimiter=",", skiprows=1)
    (folder / "imu.csv").unlink()
    step = round(0.04 / np.median(np.diff(1e-9 * rows[:, 0])))
    (folder / "00000042.BIN").write_bytes(dataflash(rows[::step, 0], rows[::step, 1:]))


def read_ply(path):
    """Header and rows of a binary PLY file of points."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    head = data[:end].decode()
    names = re.findall(r"^property (\w+) (\w+)$", head, re.MULTILINE)
    kinds = {"float": "<f4", "double": "<f8", "char": "i1", "uchar": "u1", "int": "<i4", "uint": "<u4"}
    return head, np.frombuffer(data[end:], dtype=[(name, kinds[kind]) for kind, name in names]).copy()


def contours(change):
    """The map as a cloud of contours, changed."""
    def prepare(place):
        spoilt(place)
        head, rows = read_ply(place / "contours.ply")
        rows = change(rows)
        head = re.sub(r"(?m)^element vertex \d+$", f"element vertex {len(rows)}", head)
        (place / "spoilt.ply").write_bytes(head.encode() + rows.tobytes())
    return prepare


def moved(rows, scale=1.0, shift=(0.0, 0.0, 0.0)):
    rows = rows.copy()
    for name, by in zip("xyz", shift):
        rows[name] = scale * rows[name] + by
    return rows


def one_nan(rows):
    rows = rows.copy()
    rows["y"][77] = np.nan
    return rows


def cut_map(place):
    whole = (place / "map.h5").read_bytes()
    (place / "spoilt.h5").write_bytes(whole[:len(whole) // 2])
    spoilt(place)


def planned(place):
    """The cloud in tiles; made beforehand by `evpose map build --plan`."""
    shutil.copytree(place / "planned", place / "tiles")


def cut_tile(place):
    planned(place)
    path = place / "tiles/tile_0.ply"
    path.write_bytes(path.read_bytes()[:-100])


def start(change):
    """The rows of start.tum (t, place, quaternion x y z w) changed."""
    def prepare(place):
        spoilt(place)
        rows = change(np.loadtxt(place / "start.tum"))
        np.savetxt(place / "spoilt.tum", rows, fmt="%.9f")
    return prepare


def moved_start(rows, by):
    return rows + np.array([0, *by, 0, 0, 0, 0])


def turned_start(rows):
    """Lying on its side: turned by 90 degrees about the body's x."""
    x, y, z, w = rows[:, 4:8].T
    turned = np.stack([x + w, y + z, z - y, w - x], axis=1) * np.sqrt(0.5)
    return np.hstack([rows[:, :4], turned])


def write(name, content):
    def prepare(place):
        (place / name).write_text(content)
    return prepare


def trajectory_with_nan(place):
    lines = (place / "start.tum").read_text().splitlines()
    lines[5] = " ".join(["nan" if k == 2 else word for k, word in enumerate(lines[5].split())])
    (place / "estimate.tum").write_text("\n".join(lines) + "\n")


def earlier_run(place):
    spoilt(place)
    (place / "run").mkdir()
    (place / "run/summary.json").write_text("{}")


def another_folder(place):
    spoilt(place)
    (place / "run").mkdir()
    (place / "run/thesis.txt").write_text("years of work")


def empty_folder(place):
    (place / "spoilt").mkdir()


def without_calibration(place):
    (spoilt(place) / CALIBRATION).unlink()


def without_noise(place):
    (spoilt(place) / "imu.yaml").unlink()


def words_for_events(place):
    folder = spoilt(place)
    (folder / "events.h5").unlink()
    (folder / "events.txt").write_text("the camera was on\nand saw nothing\n")


def untouched(place):
    spoilt(place)


FULL = "unshare --user --map-root-user --mount sh -c 'mount -t tmpfs -o size=64k none full && exec \"$@\"' sh"


def full_disk(place):
    spoilt(place)
    (place / "full").mkdir()


SECTIONS = {
    "Start and map": [
        Situation("Start 3 m beyond the map", CHECK.replace("start.tum", "spoilt.tum"), 1, ["start", r"lies .* m outside", "--init"],
                  start(lambda rows: moved_start(rows, (0, 0, 4.4)))),
        Situation("The same, tracked", TRACK.replace("start.tum", "spoilt.tum"), 1, [r"lies .* m outside", "--init"],
                  start(lambda rows: moved_start(rows, (0, 0, 4.4)))),
        Situation("Start 1 m off", LIVE.replace("start.tum", "spoilt.tum"), 1, ["likely: .*start", "do: "],
                  start(lambda rows: moved_start(rows, (0.6, 0.7, 0.3)))),
        Situation("Start not upright", CHECK.replace("start.tum", "spoilt.tum"), 1, ["off the map's z", "quaternion"],
                  start(turned_start)),
        Situation("Start that is no pose", TRACK.replace("start.tum", "1,2,3"), 2, ["--init", "no start pose", "give"], untouched),
        Situation("Start by GPS that is no place", TRACK.replace("start.tum", "gps:91,8.5,400"), 2,
                  ["--init", "no place on earth", "gps:LAT,LON,ALT"], untouched),
        Situation("Start by GPS, map not placed", TRACK.replace("start.tum", "gps:47.4,8.5,400"), 2,
                  ["not placed", "evpose map import"], untouched),
        Situation("Start of another flight", TRACK.replace("start.tum", "spoilt.tum"), 2, ["spoilt.tum", "no pose inside", "clocks"],
                  start(lambda rows: rows + np.array([5000, 0, 0, 0, 0, 0, 0, 0]))),
        Situation("No start", "track spoilt --map map.h5 -o run", 2, ["--init", "neither", "give"], untouched),
        Situation("Map in centimetres", CHECK.replace("map.h5", "spoilt.ply"), 1, ["map", "centimetres", "metres"],
                  contours(lambda rows: moved(rows, 100))),
        Situation("Map of another place", LIVE.replace("map.h5", "spoilt.ply"), 1, ["likely: .*(map|place)", "do: "],
                  contours(lambda rows: moved(rows, 1.15, (0.9, -0.7, 0.2)))),
        Situation("Map that lies 400 m away", TRACK.replace("map.h5", "spoilt.ply"), 2, ["start pose", "off the map", "share one frame"],
                  contours(lambda rows: moved(rows, 1, (400, 0, 0)))),
        Situation("A cloud for a map", TRACK.replace("map.h5", "cloud.ply"), 2, ["cloud.ply", "is a cloud", "evpose map build"], untouched),
        Situation("Map without contours", TRACK.replace("map.h5", "spoilt.ply"), 2, ["spoilt.ply", "empty|no (contour )?points"],
                  contours(lambda rows: rows[:0])),
        Situation("Not a number in a map", TRACK.replace("map.h5", "spoilt.ply"), 2, ["spoilt.ply", "77|78", "finite|nan"],
                  contours(one_nan)),
        Situation("Map cut off", TRACK.replace("map.h5", "spoilt.h5"), 2, ["spoilt.h5", "truncated|cut|damaged|incomplete"], cut_map),
        Situation("No such map", TRACK.replace("map.h5", "mpa.h5"), 2, ["mpa.h5", "no such"], untouched),
        Situation("No map at all", "track spoilt --init start.tum -o run", 2, ["no map", "--map"], untouched),
    ],
    "IMU and clocks": [
        Situation("Axes of the IMU swapped", CHECK, 1, ["axes do not fit|accelerometer's up", "columns|axes"],
                  imu(lambda rows: columns(rows, (0, 2, 1)))),
        Situation("Axes of the IMU mirrored", CHECK, 1, ["axes do not fit|accelerometer's up", "signs|axes"],
                  imu(lambda rows: columns(rows, (0, 1, 2), (1, -1, -1)))),
        Situation("Gyroscope in deg/s", TRACK, 2, ["imu.csv", "deg/s", "imu.gyro_unit"],
                  imu(lambda rows: scaled(rows, slice(1, 4), 180 / np.pi))),
        Situation("Accelerometer in g", TRACK, 2, ["imu.csv", "in g", "imu.accel_unit"],
                  imu(lambda rows: scaled(rows, slice(4, 7), 1 / 9.80665))),
        Situation("Gravity taken out", TRACK, 2, ["imu.csv", "gravity", "specific force"],
                  imu(lambda rows: scaled(rows, slice(4, 7), 0.01))),
        Situation("Autopilot log at 25 Hz", CHECK, 1, ["IMU rate", "25 Hz", "LOG_BITMASK"], slow_log),
        Situation("Clocks that do not overlap", TRACK, 2, ["imu.csv", "do not overlap", "time.offset_events_s"],
                  imu(lambda rows: rows + np.array([50e9, 0, 0, 0, 0, 0, 0]))),
        Situation("Gap in the IMU", TRACK, 2, [r"imu.csv:\d+", "gap"], imu(with_gap)),
        Situation("Not a number in the IMU", TRACK, 2, ["imu.csv:42"], imu(with_nan)),
        Situation("IMU stamps in seconds", TRACK, 2, ["imu.csv", "time_unit|whole number|ns"],
                  stamps_in_seconds),
        Situation("Noise of the IMU missing", TRACK, 2, ["imu.yaml", "no such file", "Kalibr"], without_noise),
    ],
    "Events": [
        Situation("Empty folder", TRACK, 2, ["events.h5", "no such file", "add"], empty_folder),
        Situation("No such recording", TRACK, 2, ["spoilt", "no such recording", "path"]),
        Situation("No events in the recording", TRACK, 2, ["events.h5", "no events|empty"], events(no_events)),
        Situation("HDF5 file cut off", TRACK, 2, ["events.h5", "truncated|incomplete|cut|damaged"], cut("events.h5", 0.5)),
        Situation("RAW file cut off in its header", TRACK, 2, ["events.raw", "header|empty|no events"], other_events("events.raw", 1e-5)),
        Situation("Bag cut off in its first chunk", TRACK, 2, ["events.bag", "no topic of events", "dvs_msgs"], other_events("events.bag", 0.001)),
        Situation("Words for events", TRACK, 2, ["events.txt:2", "t x y p"], words_for_events),
        Situation("Events that go back in time", TRACK, 2, ["events.h5", "order|back|sorted"], set_event("t", 2000, 10)),
        Situation("Event outside of the image", TRACK, 2, ["events.h5", "1234|1235", "320"], set_event("x", 1234, 320)),
        Situation("Recording of another camera than its calibration", TRACK, 2, [CALIBRATION, "resolution", "320 x 240"],
                  edit(CALIBRATION, r"resolution: .*", "resolution: [640, 480]")),
    ],
    "Calibration": [
        Situation("Missing", TRACK, 2, [CALIBRATION, "no such file", "Kalibr"], without_calibration),
        Situation("No camera in it", TRACK, 2, [CALIBRATION, "without intrinsics", "whole"],
                  add(CALIBRATION, "cam1:\n  camera_model: pinhole\n")),
        Situation("Focal length of zero", TRACK, 2, [CALIBRATION, "focal"], edit(CALIBRATION, r"intrinsics: \[[^,]*,", "intrinsics: [0,")),
        Situation("Negative sigma", TRACK, 2, [rf"{CALIBRATION}:\d+", "standard deviation", "0 means known"],
                  edit(CALIBRATION, r"timeshift_sigma: .*", "timeshift_sigma: -0.002")),
        Situation("Distortion model unknown", TRACK, 2, [rf"{CALIBRATION}:\d+", "cubic", "radtan|known"],
                  edit(CALIBRATION, r"distortion_model: .*", "distortion_model: cubic")),
        Situation("Not where the camera sits on the IMU", TRACK, 2, [CALIBRATION, "T_cam_imu", "calibrate"],
                  edit(CALIBRATION, r"  T_cam_imu:\n(  - .*\n)+", "")),
        Situation("Camera and IMU apart in millimetres", CHECK, 1, ["calibration", "millimetres", "metres"],
                  edit(CALIBRATION, r"(T_cam_imu:\n  - \[.*, )[^,\]]*\]", r"\g<1>47.0]")),
        Situation("Broken YAML", TRACK, 2, [rf"{CALIBRATION}:\d+"], edit(CALIBRATION, r"resolution: \[", "resolution: [[")),
    ],
    "Commands, settings, output": [
        Situation("Command misspelt", "trak spoilt", 2, ["trak", "did you mean 'track'"]),
        Situation("Option misspelt", "track flight --mpa map.h5", 2, ["--mpa", "did you mean '--map'"]),
        Situation("Setting misspelt", TRACK + " --set rate_hx=100", 2, ["rate_hx", "rate_hz"], untouched),
        Situation("Key of recording.yaml misspelt", TRACK, 2, [r"recording.yaml:2", "acel_unit", "accel_unit"],
                  add("recording.yaml", "imu:\n  acel_unit: g\n")),
        Situation("Setting out of its range", TRACK + " --set rate_hz=-5", 2, ["rate_hz", "-5"], untouched),
        Situation("Earlier run in the way", TRACK, 2, ["run", "earlier run", "--force"], earlier_run),
        Situation("Another folder in the way", TRACK + " --force", 2, ["run", "thesis.txt", "another"], another_folder),
        Situation("Output folder cannot be made", TRACK.replace("-o run", "-o gone/run"), 2, ["gone/run", "cannot be made", "parent"],
                  untouched),
        Situation("Disk full", TRACK.replace("-o run", "-o full/run"), 2, ["full/run", "No space left", "free space|disk"], full_disk,
                  inside=FULL),
        Situation("Unknown format to write", "convert flight flight.xyz", 2, ["flight.xyz", "ending|format"]),
        Situation("Output over the input", "convert flight/events.h5 flight/events.h5", 2, ["is the input itself", "another"]),
        Situation("Not a number in a trajectory", "eval estimate.tum start.tum", 2, ["estimate.tum:6", "number|finite"], trajectory_with_nan),
        Situation("Trajectories of other times", "eval spoilt.tum start.tum", 2, ["no partner|fewer than two", "clock"],
                  start(lambda rows: rows + np.array([5000, 0, 0, 0, 0, 0, 0, 0]))),
        Situation("Recording without ground truth to judge by", "eval start.tum flight", 2, ["flight", "no ground truth"]),
        Situation("Not a scenario", "simulate indor_spiral -o sim", 2, ["indor_spiral", "no such scenario"]),
        Situation("A map built from no cloud", "map build notes.ply -o new.h5", 2, ["notes.ply", "PLY|ply"],
                  write("notes.ply", "shopping list\n")),
        Situation("No run to look at", "view nowhere", 2, ["nowhere", "no such|no run|states.csv"]),
    ],
    "Maps in tiles, maps of boards, learning": [
        Situation("Plan over a folder that is there", "map build cloud.ply --plan flight", 2, ["flight", "already", "another name"]),
        Situation("Places of scanners and tiles", "map build cloud.ply --plan new --viewpoint 0,0,0", 2, ["--viewpoint", "whole"]),
        Situation("No folder of tiles", "map merge flight -o new.h5", 2, ["flight", "plan.yaml", "--plan"]),
        Situation("A tile that is not planned", "map build tiles --tile 99", 2, ["tiles", "99", "0 to"], planned),
        Situation("Other settings for one tile", "map build tiles --tile 0 --set noise=0.01", 2, ["--set", "those of the plan"], planned),
        Situation("Cloud of a tile cut off", "map build tiles --tile 0", 2, ["tile_0.ply", "truncated"], cut_tile),
        Situation("Merged before all tiles are built", "map merge tiles -o new.h5", 2, ["tile 0 of", "--tile 0"], planned),
        Situation("No board", "map board -o new.h5", 2, ["no board", "--checkerboard"]),
        Situation("Two boards", "map board --checkerboard 9x7 --aprilgrid 6x6 --square 0.08 -o new.h5", 2, ["two boards", "one"]),
        Situation("Board of one number", "map board --checkerboard 9 --square 0.08 -o new.h5", 2, ["'9'", "COLUMNSxROWS"]),
        Situation("Board without a size", "map board --checkerboard 9x7 -o new.h5", 2, ["--square", "metres"]),
        Situation("Board in millimetres", "map board --checkerboard 9x7 --square 80 -o new.h5", 2, ["--square", "millimetres", "metres"]),
        Situation("Discs that touch", "map board --circles 4x11 --distance 0.02 --diameter 0.05 -o new.h5", 2, ["touch", "diameter"]),
        Situation("Learning over the map itself", "map learn map.h5 flight -o map.h5", 2, ["map.h5", "learnt from", "another"]),
        Situation("Learning from a flight that is not there", "map learn map.h5 nowhere -o new.h5", 2, ["nowhere", "not exist"]),
        Situation("Learning from more runs than flights", "map learn map.h5 flight -o new.h5 --run run run", 2, ["--run", "2 runs of 1", "one for each"]),
        Situation("Learning into no folder", "map learn map.h5 flight -o nowhere/new.h5", 2, ["nowhere/new.h5", "folder", "make it"]),
        Situation("Changes to a map that is not there", "map changes map.h5 nowhere.h5", 2, ["nowhere.h5"]),
        Situation("A board that never comes into view", "calibrate flight --map board.h5 -o new.yaml", 2,
                  ["flight", "board is never seen", "columns and rows", "--init"]),
        Situation("Index of a map that is not there", "map index nowhere.h5 -o new.h5", 2, ["nowhere.h5"]),
        Situation("Index of contours that nothing hides", "map index contours.ply -o new.h5", 2, ["contours.ply", "nothing hides", "--occluders"]),
    ],
}
