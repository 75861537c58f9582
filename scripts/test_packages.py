#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Makes Debian packages and the Python wheel on bare Debian 12 and Ubuntu 22.04, tries them where nothing else is installed,
and writes docs/results/packages.md. Wants root on Debian; about an hour, less with ccache.

    scripts/test_packages.py [debian|ubuntu]    one of them; the page keeps what it says of the other

The packages of Debian 12 come out of docker/Dockerfile, whose image is tried as well. Sources are those of the last commit.
All systems are folders that are removed afterwards; what is mounted there is seen by their own commands alone. An old
processor is an emulated one.
"""
import contextlib
import hashlib
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs/results/packages.md"
SMALL = ["--set", "camera.size=custom", "--set", "camera.width=240", "--set", "camera.height=180",
         "--set", "camera.focal_px=160"]
OLD_PROCESSOR = ["/opt/qemu-x86_64-static", "-cpu", "qemu64"]  # no SSE 4, no AVX
ORDER = ["evpose", "python3-evpose", "libevpose-dev"]
DEBIAN, UBUNTU = "Debian 12", "Ubuntu 22.04"
UBUNTU_KEY = "F6ECB3762474EDA9D21B7022871920D1991BC93C"  # of its archive; no package of Debian has it


def run(*command, **more):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, stdin=subprocess.DEVNULL, **more)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}\nstatus {done.returncode}\n{done.stdout[-20000:]}{done.stderr[-20000:]}")
    return done.stdout


class Held(list):
    """What was found to be so."""
    def __call__(self, what):
        self.append(what)
        print(f"ok: {what}", flush=True)


class System:
    """A system in a folder, whose commands see that folder alone, and the kept results of the compiler."""
    def __init__(self, folder):
        self.folder = pathlib.Path(folder)

    def run(self, *command, **variables):
        inside = ('mount -t proc proc "$0/proc"; if [ -n "$CCACHE" ]; then mkdir -p "$0/root/.cache/ccache" && '
                  'mount --bind "$CCACHE" "$0/root/.cache/ccache"; fi; exec chroot "$0" env -i "$@"')
        given = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "HOME": "/root", "LANG": "C.UTF-8", **variables}
        return run("unshare", "--mount", "--pid", "--fork", "--kill-child", "sh", "-ec", inside, self.folder,
                   *(f"{name}={value}" for name, value in given.items()), *command,
                   env={**os.environ, "CCACHE": ccache_folder()})

    def install(self, *names):
        """Packages of the distribution, or files; gives how many were installed."""
        files = [name for name in names if isinstance(name, pathlib.Path)]
        for file in files:
            shutil.copy(file, self.folder)
        out = self.run("apt-get", "-qq", "--yes", "--no-install-recommends", "install",
                       *(f"./{name.name}" if name in files else name for name in names), DEBIAN_FRONTEND="noninteractive")
        return len(re.findall(r"^Setting up ", out, re.MULTILINE))

    def bytes_of(self, path):
        return (self.folder / path).read_bytes()


def trust_for_npm(folder):
    """npm believes whom this machine believes: where a proxy stands before the registry, the rest knows nothing of it."""
    shutil.copy("/etc/ssl/certs/ca-certificates.crt", folder / "npm_ca.crt")
    (folder / "npmrc").write_text("cafile=/opt/npm_ca.crt\n")
    return {folder / "npm_ca.crt": "/opt/npm_ca.crt", folder / "npmrc": "/root/.npmrc"}


def ccache_folder():
    """Empty: it keeps nothing here."""
    folder = run("ccache", "--get-config", "cache_dir").strip() if shutil.which("ccache") else ""
    if folder:
        pathlib.Path(folder).mkdir(parents=True, exist_ok=True)
    return folder


# ---- bare systems

def bare_system(name, scratch):
    """An archive of a distribution that holds what is always there, and apt."""
    words, release = [], "bookworm"
    if name == UBUNTU:
        release = "jammy"
        # Unpacked, not installed, and whoever made it: the key that is taken is known by its fingerprint.
        untrusted = [f'--aptopt={option} "true"' for option in
                     ("Acquire::AllowInsecureRepositories", "APT::Get::AllowUnauthenticated")]
        run("mmdebstrap", "--quiet", "--variant=extract", "--include=ubuntu-keyring", *untrusted, release, scratch / "keys")
        ring, key, home = (scratch / part for part in ("keys/usr/share/keyrings/ubuntu-archive-keyring.gpg", "ubuntu.gpg", "gpg"))
        home.mkdir(mode=0o700)
        run("gpg", "--quiet", "--homedir", home, "--no-default-keyring", "--keyring", ring, "--output", key,
            "--export", UBUNTU_KEY)
        words = ["--components=main,universe", f"--keyring={key}"]
    archive = scratch / f"{release}.tar"
    run("mmdebstrap", "--quiet", "--variant=minbase", "--include=apt", *words, release, archive)
    return archive


def unpacked(archive, folder):
    folder.mkdir()
    run("tar", "xf", archive, "-C", folder)
    system = System(folder)
    system.run("apt-get", "-qq", "update")
    return system


def unpack_sources(folder):
    folder.mkdir()
    archive = folder.with_suffix(".tar")
    run("git", "-C", ROOT, "archive", "-o", archive, "HEAD")
    run("tar", "xf", archive, "-C", folder)
    return folder


# ---- making packages and wheel

class Buildah:
    """Images without a daemon, in a folder."""
    def __init__(self, folder):
        self.words = ["buildah", "--root", folder / "images", "--runroot", folder / "run", "--storage-driver", "vfs"]

    def __call__(self, command, *words):
        return run(*self.words, command, *words).strip()

    def import_archive(self, archive, *names):
        container = self("from", "scratch")
        self("add", "--quiet", container, archive, "/")
        self("commit", "--quiet", container, names[0])
        for name in names[1:]:
            self("tag", names[0], name)

    def build(self, context, image, *more):
        seen = {ccache_folder(): "/root/.cache/ccache"} if ccache_folder() else {}
        seen.update(trust_for_npm(context.parent))
        kept = [word for here, there in seen.items() for word in ("--volume", f"{here}:{there}")]
        self("bud", "--isolation", "chroot", "--pull-never", *kept, "--build-arg", f"SOURCE_DATE_EPOCH={source_date()}",
             "--file", context / "docker/Dockerfile", "--tag", image, *more, context)

    def system_of(self, image):
        return System(self("mount", self("from", "--pull-never", image)))


def source_date():
    return run("git", "-C", ROOT, "log", "-1", "--format=%ct").strip()


@contextlib.contextmanager
def made_by_dockerfile(archive, scratch, held):
    """The system that docker/Dockerfile makes the packages in."""
    buildah = Buildah(scratch)
    buildah.import_archive(archive, *(f"docker.io/library/debian:{tag}" for tag in ("bookworm", "bookworm-slim")))
    context = unpack_sources(scratch / "sources")
    buildah.build(context, "evpose-build", "--target", "build")
    buildah.build(context, "evpose")
    image = json.loads(buildah("inspect", "--type", "image", "evpose"))["OCIv1"]["config"]
    program = buildah.system_of("evpose")
    said = program.run(*image["Entrypoint"], *image["Cmd"])
    assert "evpose" in said and image["WorkingDir"] == "/data", image
    program.run(*image["Entrypoint"], "demo", "--seconds", "1", "-o", "/data/demo")
    program.run("python3", "-c", "import evpose")
    size = sum(path.lstat().st_size for path in program.folder.rglob("*") if path.is_file() and not path.is_symlink())
    held(f"`docker/Dockerfile`, built by buildah on that bare system in place of the registry's images: the image "
         f"({size / 1e6:.0f} MB) shows the help by itself and runs `demo --seconds 1`")
    yield buildah.system_of("evpose-build")


@contextlib.contextmanager
def made_in_folder(archive, scratch, held):
    """The same without the Dockerfile."""
    system = unpacked(archive, scratch / "build")
    unpack_sources(system.folder / "evpose")
    for here, there in trust_for_npm(scratch).items():
        shutil.copy(here, system.folder / there[1:])
    system.run("sh", "-ec", "cd /evpose && scripts/make_debs.sh", SOURCE_DATE_EPOCH=source_date())
    yield system


def packages_of(system):
    return {path.name.split("_")[0]: path for path in (system.folder / "evpose/build/package").glob("*.deb")}


def digests_of(system):
    return {name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in packages_of(system).items()}


def make_again(system, held):
    """Not on Ubuntu 22.04, where they have other bytes each time."""
    before = digests_of(system)
    system.run("sh", "-ec", "cd /evpose && scripts/make_debs.sh", SOURCE_DATE_EPOCH=source_date())
    if before != digests_of(system):
        sys.exit("made again, the packages have other bytes")
    held("packages made twice have the same bytes")


def taken(system, folder, without_network):
    """The packages and the wheel, copied out. npm 8 of Ubuntu 22.04 asks its registry even for what it has kept."""
    if sorted(packages_of(system)) != sorted(ORDER):
        sys.exit(f"other packages are made: {sorted(packages_of(system))}")
    alone = "unshare --net " if without_network else ""
    system.run("sh", "-ec", f"cd /evpose && {alone}pip wheel --no-index --no-build-isolation --no-deps -w /wheel .",
               CMAKE_CXX_COMPILER_LAUNCHER="ccache", CCACHE_SLOPPINESS="pch_defines,time_macros")
    folder.mkdir()
    wheel, = (system.folder / "wheel").glob("evpose-*.whl")
    debs = {name: pathlib.Path(shutil.copy(path, folder)) for name, path in packages_of(system).items()}
    return debs, pathlib.Path(shutil.copy(wheel, folder))


# ---- trying them

def try_program(system, deb, held):
    count = system.install(deb)
    version = system.run("evpose", "--version").strip()
    held(f"`apt-get install ./{deb.name}`, then `evpose --version` says {version}")
    system.run("evpose", "demo", "--seconds", "1", "-o", "/tmp/demo")
    held("`evpose demo --seconds 1` tracks what it has simulated")
    system.run("evpose", "simulate", "landing", "-o", "/tmp/landing", "--duration", "0.3", *SMALL)
    held("`evpose simulate landing` finds the scenario by its name")
    for name in ("usr/share/man/man1/evpose.1", "usr/share/bash-completion/completions/evpose",
                 "usr/share/doc/evpose/copyright", "usr/share/doc/evpose/docs/use/quickstart.md",
                 "usr/share/evpose/foxglove/evpose.json"):
        system.bytes_of(name)
    held("man page, completion, pages, licence and the layout for Foxglove are there")
    return count


def try_old_processor(system, held):
    shutil.copy(shutil.which("qemu-x86_64-static"), system.folder / "opt")
    track = ["-q", "track", "/tmp/landing", "--map", "/tmp/landing/contours.ply"]
    for program, run_folder in ((["evpose"], "/tmp/here"), ([*OLD_PROCESSOR, "/usr/bin/evpose"], "/tmp/old")):
        system.run("sh", "-c", '"$@" || [ $? = 1 ]', "sh", *program, *track, "-o", run_folder)  # 1: so short a flight
    if system.bytes_of("tmp/here/trajectory.tum") != system.bytes_of("tmp/old/trajectory.tum"):
        sys.exit("the old processor gives another trajectory")
    held("an emulated processor without SSE 4 and AVX (`qemu-x86_64-static -cpu qemu64`) gives the same trajectory, "
         "byte for byte")


def test_module(system, python, folder):
    system.run(python, "/opt/evpose/python/module_test.py", folder, "/opt/evpose")
    system.run(python, "/opt/evpose/python/stubs_test.py", folder)


def try_python(system, deb, held):
    count = system.install(deb, "python3-h5py", "python3-matplotlib")
    unpack_sources(system.folder / "opt/evpose")
    test_module(system, "python3", "/usr/lib/python3/dist-packages")
    held("`import evpose` from python3-evpose; the tests of the module and of its type stubs, `examples/notebook.py` among "
         "them")
    return count


def try_library(system, deb, held):
    count = system.install(deb, "g++", "cmake", "ninja-build")
    version = deb.name.split("_")[1]
    system.run("cmake", "-S", "/opt/evpose/tests/consumer/project", "-B", "/tmp/consumer", "-G", "Ninja",
               f"-DEXPECTED_VERSION={version}")
    system.run("cmake", "--build", "/tmp/consumer")
    system.run("/tmp/consumer/consumer")
    system.run("/tmp/consumer/follow", "/tmp/demo/recording", "/tmp/demo/recording/contours.ply")
    held("`find_package(evpose)` from libevpose-dev: tests/consumer/project is built and tracks the demo's recording")
    return count


def try_removal(system, held):
    system.run("apt-get", "-qq", "--yes", "purge", *ORDER)
    left = [path for path in (system.folder / "usr").rglob("*evpose*")]
    if left:
        sys.exit(f"left behind: {left}")
    held("`apt-get purge` leaves nothing behind")


def try_wheel(system, wheel, network, held):
    system.install("python3-venv")
    shutil.copy(wheel, system.folder / "tmp")
    system.run("python3", "-m", "venv", "--system-site-packages", "/tmp/venv")
    system.run("/tmp/venv/bin/pip", "install", "--no-index", f"/tmp/{wheel.name}")
    folder, = (system.folder / "tmp/venv").glob("lib/python3*/site-packages")
    test_module(system, "/tmp/venv/bin/python", f"/{folder.relative_to(system.folder)}")
    held(f"`pip wheel --no-build-isolation --no-deps .` {network}; the wheel ({wheel.stat().st_size / 1e6:.1f} MB) in a "
         "fresh virtual environment passes the same tests")


def rows(debs, counts):
    for name in ORDER:
        field = {key: run("dpkg-deb", "-f", debs[name], key).strip() for key in ("Section", "Installed-Size")}
        yield (f"| `{name}` | {field['Section']} | {debs[name].stat().st_size / 1e6:.1f} "
               f"| {int(field['Installed-Size']) / 1024:.1f} | {counts[name]} |")


def tried(name):
    """What the page says of a distribution."""
    held = Held()
    commit = run("git", "-C", ROOT, "rev-parse", "--short", "HEAD").strip()
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        scratch.chmod(0o755)  # apt reads keys as another user
        archive = bare_system(name, scratch)
        with (made_by_dockerfile if name == DEBIAN else made_in_folder)(archive, scratch, held) as maker:
            if name == DEBIAN:
                make_again(maker, held)
            debs, wheel = taken(maker, scratch / "made", name == DEBIAN)
        system = unpacked(archive, scratch / "bare")
        counts = {"evpose": try_program(system, debs["evpose"], held)}
        if name == DEBIAN:
            try_old_processor(system, held)
        counts["python3-evpose"] = try_python(system, debs["python3-evpose"], held)
        counts["libevpose-dev"] = try_library(system, debs["libevpose-dev"], held)
        try_removal(system, held)
        try_wheel(system, wheel, "without a network" if name == DEBIAN else "with a network, for npm", held)
        table = list(rows(debs, counts))
    return ["", f"Sources of commit `{commit}`.", "", "| package | section | MB | installed MiB | with its dependencies |",
            "|---|---|---|---|---|", *table, "", *(f"- {what}" for what in held), ""]


def main():
    wanted = {"debian": [DEBIAN], "ubuntu": [UBUNTU]}.get(sys.argv[1], []) if sys.argv[1:] else [DEBIAN, UBUNTU]
    if not wanted or sys.argv[2:]:
        sys.exit(__doc__)
    run(ROOT / "scripts/packages.sh", "try")
    for name in wanted:
        lines = "\n".join(tried(name))
        text = PAGE.read_text()
        place = re.compile(rf"(?<=\n## {re.escape(name)}\n).*?(?=\n## |\Z)", re.DOTALL)
        assert place.search(text), f"{PAGE} has no part '## {name}'"
        PAGE.write_text(place.sub(lambda _: lines, text))


if __name__ == "__main__":
    main()
