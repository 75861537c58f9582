#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# The kernels for vectors, crossed to 64-bit ARM, do in an emulator what their scalar twins do: arm64_test.sh SOURCE BUILD
# A short look at each change; scripts/test_arm64.sh builds and tests all modules from core to tracker so.
set -euo pipefail
source=$1 build=$2/arm64
googletest=/usr/src/googletest/googletest
for tool in aarch64-linux-gnu-g++ qemu-aarch64-static $googletest/src/gtest-all.cc; do
  command -v $tool >/dev/null || [ -e $tool ] || { echo "skipped: $tool is missing: scripts/packages.sh test"; exit 77; }
done

mkdir -p "$build"
compiler=(aarch64-linux-gnu-g++)
if command -v ccache >/dev/null; then compiler=(ccache "${compiler[@]}"); fi
objects=() jobs=()
compile() {  # OBJECT SOURCE FLAGS...
  local object=$build/$1.o file=$2
  shift 2
  "${compiler[@]}" -std=c++20 -march=armv8-a -isystem $googletest/include "$@" -c "$file" -o "$object" &
  jobs+=($!) objects+=("$object")
}
for name in core/error core/log io/events/decode_faults io/events/evt2 io/events/evt3 io/events/evt3_encoder io/events/evt_test \
  sim/world/texture sim/world/lanes_test; do
  compile "${name//\//_}" "$source/src/evpose/$name.cpp" -O2 -ffp-contract=off -I"$source/src" -isystem /usr/include/eigen3
done
for name in gtest-all gtest_main; do
  compile $name $googletest/src/$name.cc -I$googletest
done
for job in "${jobs[@]}"; do wait "$job"; done
aarch64-linux-gnu-g++ -static "${objects[@]}" -o "$build/vectors_test"
qemu-aarch64-static "$build/vectors_test"
