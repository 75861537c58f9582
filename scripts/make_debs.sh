#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Makes the Debian packages evpose, libevpose-dev and python3-evpose in build/package, for any processor of the
# distribution it runs on. The same sources give the same bytes: times in them are the commit's.
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/packages.sh package
export CMAKE_C_COMPILER_LAUNCHER=ccache CMAKE_CXX_COMPILER_LAUNCHER=ccache
export CCACHE_SLOPPINESS=pch_defines,time_macros  # without which it keeps nothing that uses precompiled headers
command -v ccache >/dev/null || unset CMAKE_C_COMPILER_LAUNCHER CMAKE_CXX_COMPILER_LAUNCHER
export SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct)}
cmake --preset package
cmake --build --preset package
cd build/package
rm -f ./*.deb
umask 022
cpack
