# SPDX-License-Identifier: BSD-3-Clause
"""What all benchmarks share: running evpose, keeping what was measured, writing pages of docs/results."""
import dataclasses
import datetime
import hashlib
import json
import os
import pathlib
import re
import shutil
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent

# The shared recordings and the place that each was made in.
PEER = {"room_spiral": "room", "room_720p": "room", "room_people": "room", "room_hover": "room",
        "courtyard_landing": "courtyard"}
MORE_PEERS = ["room_c", "room_e", "courtyard_b"]
OTHER_VIEW = "room_other_view"  # in the first room
START_S = 0.3  # of a run, after which figures "after 0.3 s" begin


class Failure(Exception):
    """Why a benchmark could not be made, in one line."""


@dataclasses.dataclass(frozen=True)
class Recording:
    """A recording with the map and the occluders that it is tracked with."""
    name: str
    folder: pathlib.Path
    contours: pathlib.Path
    mesh: pathlib.Path

    @property
    def truth(self):
        return self.folder / "groundtruth.tum"


class Bench:
    """Where everything is, and what has been measured already."""

    def __init__(self, evpose, microbench, shared, scratch, docs, quick=False, minutes=0, older=None):
        self.evpose, self.microbench, self.shared = (pathlib.Path(p) for p in (evpose, microbench, shared))
        self.scratch, self.docs = pathlib.Path(scratch), pathlib.Path(docs)
        self.quick, self.minutes, self.older = quick, minutes, older
        self._program = None

    def of_older_program(self):
        """The same with the older program; None if there is none."""
        if self.older is None:
            return None
        return Bench(self.older, self.microbench, self.shared, self.scratch, self.docs, self.quick, self.minutes)

    # ---- running programs

    def run(self, *words):
        """What evpose prints. It may end with 1 (not tracked well); with 2 there are no figures."""
        done = subprocess.run([str(w) for w in (self.evpose, "-q", *words)], capture_output=True, text=True,
                              stdin=subprocess.DEVNULL)
        if done.returncode not in (0, 1):
            raise Failure(f"evpose {' '.join(str(w) for w in words)}: {last_line(done.stderr)}")
        return done.stdout

    def track(self, folder, contours, output, *extra, known=True):
        """The summary of a run. The recordings' calibration is the truth: it counts as known, or as what its file states."""
        believed = ["--set", "fusion.calibration.on=false"] if known else []
        self.run("track", folder, "--map", contours, "-o", output, "--force", *believed, *extra)
        return json.loads((pathlib.Path(output) / "summary.json").read_text())

    def later_accuracy(self, run, truth):
        """Figures after the first 0.3 s; None where the run has no poses there."""
        trajectory = pathlib.Path(run) / "trajectory.tum"
        if not trajectory.read_text().strip():
            return None
        try:
            scored = json.loads(self.run("eval", trajectory, truth, "--from", START_S, "--json"))
        except Failure:
            return None
        return scored.get("accuracy", scored)

    # ---- recordings

    def peer(self, name):
        folder = self.shared / "data/peer"
        place = PEER[name]
        return Recording(name, folder / name, folder / "maps" / f"{place}_contours.ply",
                         folder / "maps" / f"{place}_mesh.ply")

    def peers(self):
        """All shared recordings; the shortest alone where it has to be quick."""
        return [self.peer(name) for name in (["room_720p"] if self.quick else PEER)]

    def more_peers(self):
        """Shared recordings of places that no default was chosen on."""
        folder = self.shared / "data/peer_more"
        room = self.peer("room_spiral")
        return [Recording(name, folder / name, folder / name / "contours.ply", folder / name / "mesh.ply")
                for name in MORE_PEERS] + [Recording(OTHER_VIEW, folder / OTHER_VIEW, room.contours, room.mesh)]

    def unseen_flights(self):
        """Flights of reporting seeds that `evpose bench unseen` has made, in order of the seeds."""
        folders = sorted(self.unseen_folder.glob(("quick_" if self.quick else "") + "flight_????"))
        made = [folder for folder in folders if (folder / "flight.json").exists()]
        if not made:
            raise Failure(f"{self.unseen_folder}: no flights; make them first: benchmarks/run.py unseen")
        return [Recording(f"seed {int(folder.name[-4:])}", folder, folder / "contours.ply", folder / "mesh.ply")
                for folder in made]

    @property
    def unseen_folder(self):
        return self.scratch / "recordings/unseen"

    def simulated(self, scenario, seconds, settings=(), name=None):
        """A recording of that scenario, made if it is not there. A changed simulator makes none of them anew: delete
        SCRATCH/recordings for that."""
        if self.quick:
            seconds, settings = min(seconds, 0.6), [*settings, *TINY]
        name = name or scenario
        key = digest([scenario, seconds, list(settings)])[:8]
        folder = self.scratch / "recordings" / f"{name}-{key}"
        if not folder.exists():
            folder.parent.mkdir(parents=True, exist_ok=True)
            words = [word for setting in settings for word in ("--set", setting)]
            self.run("simulate", scenario, "-o", folder, "--duration", seconds, "--world-cache",
                     folder.parent / "worlds", *words)
        return Recording(name, folder, folder / "contours.ply", folder / "mesh.ply")

    # ---- what was measured

    def once(self, key, measure):
        """The value of `measure()`, JSON, kept under the key and the program's bytes, so that what was interrupted goes on."""
        if self._program is None:
            self._program = digest(self.evpose.read_bytes())[:12]
        path = self.scratch / "measured" / self._program / f"{digest([key, self.quick])[:16]}.json"
        if path.exists():
            return json.loads(path.read_text())["value"]
        value = measure()
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(".part")
        part.write_text(json.dumps({"key": key, "value": value}))
        part.rename(path)
        print(f"  {key}", flush=True)
        return value

    def forget(self):
        """Everything that was measured, with any program."""
        shutil.rmtree(self.scratch / "measured", ignore_errors=True)

    def folder(self):
        """A scratch folder that goes away: `with bench.folder() as scratch`."""
        self.scratch.mkdir(parents=True, exist_ok=True)
        return _Folder(self.scratch)

    # ---- pages

    def write_page(self, name, figures, note=""):
        """Puts figures (a name and Markdown lines each) into the places that the page of that name has for them, between
        `<!-- figures: X -->` and `<!-- end -->`, and says on top which command made them, from which commit."""
        path = self.docs / "results" / f"{name}.md"
        if not path.exists():
            source = ROOT / "docs/results" / f"{name}.md"
            if not source.exists():
                raise Failure(f"{path} is not there")
            path.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, path)
        text = path.read_text()
        for key, lines in figures.items():
            place = re.compile(rf"(<!-- figures: {re.escape(key)} -->\n).*?(<!-- end -->)", re.DOTALL)
            if not place.search(text):
                raise Failure(f"{path} has no place for `{key}`: <!-- figures: {key} --> and <!-- end -->")
            content = "\n" + "\n".join(lines).strip("\n") + "\n\n"
            text = place.sub(lambda match: match[1] + content + match[2], text)
        made = f"Made by `benchmarks/run.py {name}` at commit {commit()}, {datetime.date.today()}{note}."
        path.write_text(FIRST_PARAGRAPH.sub(lambda _: made + "\n\n", text, count=1))
        return path

    def image(self, name):
        path = self.docs / "images" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        return path


def seeds(seed):
    """Settings of a simulated flight with a place, a trajectory and noise of its own."""
    return (f"seed={seed}", f"world.seed={seed}", f"trajectory.seed={seed}")


TINY = ["camera.size=custom", "camera.width=320", "camera.height=240", "camera.focal_px=190"]
FIRST_PARAGRAPH = re.compile(r"\A(?:Made by .*?\n\n)?", re.DOTALL)


class _Folder(tempfile.TemporaryDirectory):
    def __init__(self, parent):
        super().__init__(dir=parent)

    def __enter__(self):
        return pathlib.Path(super().__enter__())


def machine():
    """A note for pages with times."""
    model = next((line.split(":", 1)[1].strip() for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines()
                  if line.startswith("model name")), "unknown processor")
    return f", on {os.cpu_count()} cores of {model}"


def commit():
    """Of the sources beside this file; changes of pages and pictures do not count."""
    def git(*words):
        return subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True).stdout.strip()

    changed = git("status", "--porcelain", "--", ".", ":!docs")
    return f"`{git('rev-parse', '--short', 'HEAD') or 'unknown'}`" + (" with changes" if changed else "")


def digest(what):
    data = what if isinstance(what, bytes) else json.dumps(what, sort_keys=True, default=str).encode()
    return hashlib.sha256(data).hexdigest()


def last_line(text):
    return (text.strip().splitlines() or ["no word why"])[-1]
