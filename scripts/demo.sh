#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# From a bare Debian 12 or Ubuntu 22.04 (or newer) to the first report: packages, build, `evpose demo`.
# Arguments are handed to `evpose demo`.
set -euo pipefail
cd "$(dirname "$0")/.."

cat <<'TEXT'
evpose demo
  1. installs the packages that are missing            first time: about 2 minutes
  2. builds the program                                first time: about 4 minutes on two cores
  3. makes a small recording, tracks it and reports    about 1 minute
No questions will be asked, except for a password if sudo needs one.

TEXT

scripts/packages.sh build
export CMAKE_C_COMPILER_LAUNCHER=ccache CMAKE_CXX_COMPILER_LAUNCHER=ccache
export CCACHE_SLOPPINESS=pch_defines,time_macros  # without which it keeps nothing that uses precompiled headers
command -v ccache >/dev/null || unset CMAKE_C_COMPILER_LAUNCHER CMAKE_CXX_COMPILER_LAUNCHER
cmake --preset release
cmake --build --preset release --target evpose
exec build/release/apps/evpose/evpose demo "$@"
