#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# The one list of packages that evpose needs, by their Debian and Ubuntu names, and their installation.
#   scripts/packages.sh build    to build and run the program
#   scripts/packages.sh test     the same, and all tests
#   scripts/packages.sh package  to make packages and wheel
#   scripts/packages.sh try      to try them (scripts/test_packages.py), as root on Debian
#   scripts/packages.sh arm64    to build and test for 64-bit ARM
# Does nothing when everything is there. Reasons and versions: docs/dependencies.md.
set -euo pipefail

build=(
  g++                  # C++20 compiler, 11 or newer
  cmake                # 3.22 or newer
  ninja-build          # what the presets build with
  ccache               # a second build takes seconds
  libeigen3-dev        # linear algebra
  libhdf5-dev          # recordings and maps
  libyaml-cpp-dev      # calibrations and configuration
  libcli11-dev         # command line
  nlohmann-json3-dev   # summary.json
  libpng-dev           # pictures in the report and in recordings
  libcairo2-dev        # lines and words in films of a run
  libbz2-dev liblz4-dev libzstd-dev libblosc-dev liblzf-dev  # compressed bags, recordings, clouds and data sets
  zlib1g-dev           # checksums of bags and maps
  libsqlite3-dev       # ROS 2 bags
  libnanoflann-dev     # nearest points, to build maps from clouds
  libembree-dev        # ray casting in the simulator
  libassimp-dev        # meshes for the simulator
  libboost-dev         # the viewer's server
  nodejs npm           # fetch the report's plot library, once, while building
  ca-certificates      # for npm's https
)
test=(
  libopencv-calib3d-dev libapriltag-dev  # find printed boards; the program may be built without
  libgtest-dev         # unit tests
  libceres-dev         # the solver that ours are compared with
  libbenchmark-dev     # speed of the hot kernels
  python3              # layer and end-to-end tests
  python3-numpy        # the independent scorer
  python3-h5py         # makes broken recordings, reads our maps
  python3-rosbag       # reads our ROS bags
  python3-dev pybind11-dev  # the Python module
  python3-matplotlib   # plots of the example notebook
  pkg-config libroscpp-dev libtf2-ros-dev libtopic-tools-dev libsensor-msgs-dev libnav-msgs-dev libgeometry-msgs-dev
  libdiagnostic-msgs-dev libstd-srvs-dev libtf2-msgs-dev  # the ROS node
  python3-rosmaster python3-rospy python3-sensor-msgs python3-nav-msgs python3-geometry-msgs python3-diagnostic-msgs
  python3-tf2-msgs     # drive it
  ffmpeg               # encodes films of a run
  parallel             # builds the tiles of a map, as the example does
  g++-aarch64-linux-gnu qemu-user-static  # kernels for vectors on 64-bit ARM
  clang-14 libclang-rt-14-dev  # fuzzing
  chromium             # draws the report
  clang-format-14      # pinned: each version formats differently
  clang-tidy-14        # pinned for the same reason
)
package=(
  libopencv-calib3d-dev libapriltag-dev  # as above
  dpkg-dev file        # what a Debian package depends on
  python3-dev pybind11-dev python3-pip python3-setuptools python3-wheel  # the Python module and its wheel
)
try=(
  mmdebstrap gpg       # bare systems to make them and try them in
  buildah              # makes the image of docker/Dockerfile, without a daemon
  qemu-user-static     # an old processor
)
arm64=(
  cmake ninja-build ccache
  g++-aarch64-linux-gnu  # the compiler
  mmdebstrap debian-archive-keyring  # its libraries and headers, kept apart from the system's own
  qemu-user-static     # runs the tests
)

case "${1:-}" in
  build) wanted=("${build[@]}") ;;
  test) wanted=("${build[@]}" "${test[@]}") ;;
  package) wanted=("${build[@]}" "${package[@]}") ;;
  try) wanted=("${try[@]}") ;;
  arm64) wanted=("${arm64[@]}") ;;
  *) echo "usage: scripts/packages.sh build|test|package|try|arm64" >&2; exit 2 ;;
esac

if ! command -v apt-get >/dev/null || ! command -v dpkg-query >/dev/null; then
  echo "This is neither Debian nor Ubuntu. Please see to it that these, or what they are called here, are installed:"
  printf '  %s\n' "${wanted[@]}"
  exit 0
fi

installed() { [ "$(dpkg-query -W -f='${db:Status-Status}' "$1" 2>/dev/null)" = installed ]; }

missing=()
for package in "${wanted[@]}"; do
  # Node may have come from elsewhere; Debian's npm would then pull in a second one.
  case $package in nodejs | npm) if command -v node >/dev/null && command -v npm >/dev/null; then continue; fi ;; esac
  installed "$package" || missing+=("$package")
done
[ ${#missing[@]} -gt 0 ] || exit 0

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  if ! command -v sudo >/dev/null; then
    echo "Missing packages, and neither root nor sudo to install them: apt-get install ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
  echo "Installing needs root: sudo may ask for your password."
fi
apt() { "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq -o Dpkg::Use-Pty=0 "$@" </dev/null; }

echo "Installing: ${missing[*]}"
apt update
available=()
for package in "${missing[@]}"; do
  if [ -n "$(apt-cache madison "$package" 2>/dev/null)" ]; then
    available+=("$package")
  else
    echo "Not among this system's packages: $package. Going on without it."
  fi
done
[ ${#available[@]} -eq 0 ] || apt install --yes --no-install-recommends "${available[@]}" >/dev/null
