#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Makes the Debian packages and the Python wheel, tries them where nothing else is installed, and writes
docs/results/packages.md. Wants root, takes about half an hour where nothing is built yet.

Packages are installed in a bare Debian 12 in a folder of its own, which is removed afterwards; what is mounted there is
seen by its own commands alone. An old processor is an emulated one.
"""
import hashlib
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUILD = ROOT / "build/package"
PAGE = ROOT / "docs/results/packages.md"
SMALL = ["--set", "camera.size=custom", "--set", "camera.width=240", "--set", "camera.height=180",
         "--set", "camera.focal_px=160"]
OLD_PROCESSOR = ["/opt/qemu-x86_64-static", "-cpu", "qemu64"]  # no SSE 4, no AVX
TESTED = []


def run(*command, **more):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, stdin=subprocess.DEVNULL, **more)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}\nstatus {done.returncode}\n{done.stdout[-3000:]}{done.stderr[-3000:]}")
    return done.stdout


def tested(what):
    TESTED.append(what)
    print(f"ok: {what}", flush=True)


class BareDebian:
    def __init__(self, folder):
        self.folder = folder
        run("mmdebstrap", "--quiet", "--variant=minbase", "bookworm", folder)
        (folder / "opt").mkdir(exist_ok=True)
        shutil.copy(shutil.which("qemu-x86_64-static"), folder / "opt")
        self.run("apt-get", "-qq", "update")

    def run(self, *command):
        inside = 'mount -t proc proc "$0/proc" && cd / && exec chroot "$0" env -i PATH=$PATH HOME=/root LANG=C.UTF-8 "$@"'
        return run("unshare", "--mount", "--pid", "--fork", "--kill-child", "sh", "-c", inside, self.folder, *command)

    def install(self, *names):
        """Packages of the distribution, or files; gives how many were installed."""
        for name in names:
            if "/" in name:
                shutil.copy(BUILD / name[2:], self.folder)
        out = self.run("apt-get", "-qq", "--yes", "--no-install-recommends", "install", *names)
        return len(re.findall(r"^Setting up ", out, re.MULTILINE))

    def bytes_of(self, path):
        return (self.folder / path).read_bytes()


def make_packages():
    os.environ.setdefault("SOURCE_DATE_EPOCH", run("git", "-C", ROOT, "log", "-1", "--format=%ct").strip())
    run(ROOT / "scripts/make_debs.sh")
    debs = {path.name.split("_")[0]: path for path in BUILD.glob("*.deb")}
    before = {name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in debs.items()}
    run(ROOT / "scripts/make_debs.sh")
    if before != {name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in debs.items()}:
        sys.exit("made again, the packages have other bytes")
    tested("packages made twice have the same bytes")
    return debs


def try_program(debian, deb):
    count = debian.install(f"./{deb.name}")
    version = debian.run("evpose", "--version").strip()
    tested(f"`apt-get install ./{deb.name}`, then `evpose --version` says {version}")
    debian.run("evpose", "demo", "--seconds", "1", "-o", "/tmp/demo")
    tested("`evpose demo --seconds 1` tracks what it has simulated")
    debian.run("evpose", "simulate", "landing", "-o", "/tmp/landing", "--duration", "0.3", *SMALL)
    tested("`evpose simulate landing` finds the scenario by its name")
    for name in ("usr/share/man/man1/evpose.1", "usr/share/bash-completion/completions/evpose",
                 "usr/share/doc/evpose/copyright", "usr/share/doc/evpose/docs/use/quickstart.md"):
        debian.bytes_of(name)
    tested("man page, completion, pages and licence are there")
    return count


def try_old_processor(debian):
    track = ["-q", "track", "/tmp/landing", "--map", "/tmp/landing/contours.ply"]
    for program, run_folder in ((["evpose"], "/tmp/here"), ([*OLD_PROCESSOR, "/usr/bin/evpose"], "/tmp/old")):
        debian.run("sh", "-c", '"$@" || [ $? = 1 ]', "sh", *program, *track, "-o", run_folder)  # 1: so short a flight
    if debian.bytes_of("tmp/here/trajectory.tum") != debian.bytes_of("tmp/old/trajectory.tum"):
        sys.exit("the old processor gives another trajectory")
    tested("an emulated processor without SSE 4 and AVX (`qemu-x86_64-static -cpu qemu64`) gives the same trajectory, "
           "byte for byte")


def try_python(debian, deb):
    count = debian.install(f"./{deb.name}", "python3-h5py")
    for folder in ("python", "tests/end_to_end"):
        shutil.copytree(ROOT / folder, debian.folder / "opt/evpose" / folder)
    debian.run("python3", "-c", "import evpose")
    for test in (["module_test.py", "/usr/lib/python3/dist-packages", "/opt/evpose"],
                 ["stubs_test.py", "/usr/lib/python3/dist-packages"]):
        debian.run("python3", f"/opt/evpose/python/{test[0]}", *test[1:])
    tested("`import evpose` from python3-evpose; the tests of the module and of its type stubs")
    return count


def try_library(debian, deb, version):
    count = debian.install(f"./{deb.name}", "g++", "cmake", "ninja-build")
    shutil.copytree(ROOT / "tests/consumer/project", debian.folder / "opt/consumer")
    debian.run("cmake", "-S", "/opt/consumer", "-B", "/tmp/consumer", "-G", "Ninja", f"-DEXPECTED_VERSION={version}")
    debian.run("cmake", "--build", "/tmp/consumer")
    debian.run("/tmp/consumer/consumer")
    debian.run("/tmp/consumer/follow", "/tmp/demo/recording", "/tmp/demo/recording/contours.ply")
    tested("`find_package(evpose)` from libevpose-dev: tests/consumer/project is built and tracks the demo's recording")
    return count


def try_removal(debian):
    debian.run("apt-get", "-qq", "--yes", "purge", "evpose", "libevpose-dev", "python3-evpose")
    left = [path for path in (debian.folder / "usr").rglob("*evpose*")]
    if left:
        sys.exit(f"left behind: {left}")
    tested("`apt-get purge` leaves nothing behind")


def try_wheel(scratch):
    run(sys.executable, "-m", "pip", "wheel", "--no-index", "--no-build-isolation", "--no-deps", "-w", scratch, ".", cwd=ROOT)
    wheel, = scratch.glob("evpose-*.whl")
    venv = scratch / "venv"
    run(sys.executable, "-m", "venv", "--system-site-packages", venv)
    run(venv / "bin/pip", "install", "--no-index", wheel)
    folder, = venv.glob("lib/python3*/site-packages")
    run(venv / "bin/python", ROOT / "python/module_test.py", folder, ROOT)
    run(venv / "bin/python", ROOT / "python/stubs_test.py", folder)
    tested("`pip wheel --no-build-isolation --no-deps .` without a network; the wheel in a fresh virtual environment "
           "passes the same tests")
    return wheel


def rows(debs, counts):
    for name in counts:
        path = debs[name]
        field = {key: run("dpkg-deb", "-f", path, key).strip() for key in ("Section", "Installed-Size")}
        yield (f"| `{name}` | {field['Section']} | {path.stat().st_size / 1e6:.1f} | {int(field['Installed-Size']) / 1024:.1f} "
               f"| {counts[name]} |")


def page(table, wheel):
    commit = run("git", "-C", ROOT, "rev-parse", "--short", "HEAD").strip()
    lines = [f"Made by `scripts/test_packages.py` at commit `{commit}`.", "", "# Packages", "",
             "Debian packages (`scripts/make_debs.sh`) for any amd64 processor of Debian 12, tried in a bare Debian 12. Each was",
             "installed after the ones above it; the last column counts all packages that came with it.", "",
             "| package | section | MB | installed MiB | with its dependencies |", "|---|---|---|---|---|", *table, "",
             f"The wheel has {wheel.stat().st_size / 1e6:.1f} MB, for the distribution that it was made on.", "",
             "Held by that command, which stops at the first that is not so:", "", *(f"- {what}" for what in TESTED), "",
             "Not tried: Ubuntu 22.04, whose packages have to be made on it, and `docker/Dockerfile`. 64-bit ARM is "
             "tested by `scripts/test_arm64.sh`.", ""]
    PAGE.write_text("\n".join(lines))


def main():
    if shutil.which("ccache"):
        for name, value in (("CMAKE_C_COMPILER_LAUNCHER", "ccache"), ("CMAKE_CXX_COMPILER_LAUNCHER", "ccache"),
                            ("CCACHE_SLOPPINESS", "pch_defines,time_macros")):
            os.environ.setdefault(name, value)
    debs = make_packages()
    version = debs["evpose"].name.split("_")[1]
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        wheel = try_wheel(scratch)
        debian = BareDebian(scratch / "debian")
        counts = {"evpose": try_program(debian, debs["evpose"])}
        try_old_processor(debian)
        counts["python3-evpose"] = try_python(debian, debs["python3-evpose"])
        counts["libevpose-dev"] = try_library(debian, debs["libevpose-dev"], version)
        try_removal(debian)
        page(list(rows(debs, counts)), wheel)


if __name__ == "__main__":
    main()
