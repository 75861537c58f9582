#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Prints how long builds from clean take, in folders of its own: processor seconds and seconds by the clock.
#   scripts/build_times.sh            the program and all tests
#   scripts/build_times.sh program    the program alone (preset release, as scripts/demo.sh builds it)
#   scripts/build_times.sh tests      all tests alone (preset dev, as scripts/test.sh builds them)
set -euo pipefail
cd "$(dirname "$0")/.."

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
export CCACHE_DIR=$folder/ccache CCACHE_SLOPPINESS=pch_defines,time_macros

# measure TITLE LAUNCHER PRESET TARGET: configures and builds, from nothing but what the cache of compilations holds.
measure() {
  rm -rf "$folder/build"
  local times TIMEFORMAT='%U %S %R'
  times=$({ time {
    cmake --preset "$3" -B "$folder/build" -D CMAKE_C_COMPILER_LAUNCHER="$2" -D CMAKE_CXX_COMPILER_LAUNCHER="$2" &&
    cmake --build "$folder/build" --parallel 2 --target "$4"; } >"$folder/log" 2>&1; } 2>&1) ||
    { cat "$folder/log" >&2; exit 1; }
  awk -v title="$1" '{printf "%-28s %6.0f s of processor %6.0f s by the clock", title, $1 + $2, $3}' <<<"$times"
  printf ' %6d lines of warning\n' "$(grep -c 'warning:' "$folder/log" || true)"
}

measure_target() {
  if command -v ccache >/dev/null; then
    measure "$1, ccache empty" ccache "$2" "$3"
    measure "$1, ccache warm" ccache "$2" "$3"
  fi
  measure "$1, without ccache" "" "$2" "$3"
}

case "${1:-all}" in
  program) measure_target evpose release evpose ;;
  tests) measure_target tests dev all ;;
  all) measure_target evpose release evpose; measure_target tests dev all ;;
  *) echo "usage: scripts/build_times.sh [program|tests]" >&2; exit 2 ;;
esac
