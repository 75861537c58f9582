#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Feeds every reader of files with millions of damaged ones: libFuzzer, with sanitizers for addresses and undefined
# behaviour. What crashes is kept in build/fuzz/crashes.
#   scripts/fuzz.sh                     each target 2,000,000 times
#   scripts/fuzz.sh 100000 ecf          the target ecf 100,000 times
set -euo pipefail
cd "$(dirname "$0")/.."

count=${1:-2000000}
[ $# -gt 0 ] && shift
export CMAKE_C_COMPILER_LAUNCHER=${CMAKE_C_COMPILER_LAUNCHER-ccache} CMAKE_CXX_COMPILER_LAUNCHER=${CMAKE_CXX_COMPILER_LAUNCHER-ccache}
cmake -S . -B build/fuzz -G Ninja -DCMAKE_C_COMPILER=clang-14 -DCMAKE_CXX_COMPILER=clang++-14 -DCMAKE_BUILD_TYPE=None \
  -DCMAKE_CXX_FLAGS="-O1 -g1 -fno-sanitize-recover=all" -DEVPOSE_SANITIZE=address,undefined,fuzzer-no-link \
  -DEVPOSE_FUZZ=ON -DEVPOSE_TESTS=OFF -DEVPOSE_BENCHMARKS=OFF >/dev/null
cmake --build build/fuzz --target evpose_fuzz
python3 tests/fuzz/make_seeds.py build/fuzz/seeds
program=build/fuzz/tests/fuzz/evpose_fuzz

targets=("$@")
if [ ${#targets[@]} -eq 0 ]; then
  read -r -a targets <<<"$(EVPOSE_FUZZ_TARGET='' $program 2>&1 | sed -n 's/.*names none of: //p')"
fi
mkdir -p build/fuzz/crashes
for target in "${targets[@]}"; do
  mkdir -p "build/fuzz/corpus/$target" "build/fuzz/seeds/$target"
  EVPOSE_FUZZ_TARGET=$target $program -runs="$count" -max_len=4096 -rss_limit_mb=2048 -timeout=20 -print_final_stats=0 \
    -verbosity=0 -artifact_prefix="build/fuzz/crashes/$target-" "build/fuzz/corpus/$target" "build/fuzz/seeds/$target"
  echo "$target: $count executions, nothing found"
done
