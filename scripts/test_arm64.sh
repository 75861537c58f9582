#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Builds the modules from core to tracker for 64-bit ARM and runs their tests in an emulator; arguments are handed to
# ctest. The libraries of that architecture go to build/arm64_sysroot; nothing of the system's own is touched.
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/packages.sh arm64
sysroot=build/arm64_sysroot
if [ ! -e $sysroot/complete ]; then
  rm -rf $sysroot
  mmdebstrap --quiet --arch=arm64 --variant=extract bookworm $sysroot \
    --include=libc6-dev,libstdc++-12-dev,libeigen3-dev,libgtest-dev,libceres-dev,libblas-dev,liblapack-dev
  # What an installation would have done: choose the BLAS. And links and CMake packages must not lead out of the folder.
  libraries=$sysroot/usr/lib/aarch64-linux-gnu
  for library in blas lapack; do ln -s $library/lib$library.so.3 $library/lib$library.so $libraries; done
  find $sysroot -type l -lname '/*' -printf '%p %l\n' |
    while read -r link target; do ln -sfrn "$sysroot$target" "$link"; done
  sed -E -i '/INTERFACE_LINK/s#/usr/lib/aarch64-linux-gnu/lib([a-z0-9]+)\.so#\1#g' $libraries/cmake/Ceres/CeresTargets.cmake
  touch $sysroot/complete
fi

export CMAKE_C_COMPILER_LAUNCHER=ccache CMAKE_CXX_COMPILER_LAUNCHER=ccache
export CCACHE_SLOPPINESS=pch_defines,time_macros  # without which it keeps nothing that uses precompiled headers
cmake --preset arm64
cmake --build --preset arm64
exec ctest --preset arm64 --parallel 2 "$@" </dev/null
