#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Feeds every reader of files with millions of damaged ones: libFuzzer, with sanitizers for addresses and undefined
# behaviour. Inputs that fail are kept in build/fuzz/crashes, logs in build/fuzz/logs; several runs of a target may
# go side by side, and add up.
#   scripts/fuzz.sh                     each target 2,000,000 times
#   scripts/fuzz.sh 100000 ecf          the target ecf 100,000 times
#   scripts/fuzz.sh --table             what the logs say, as the table of docs/results/fuzzing.md
set -euo pipefail
cd "$(dirname "$0")/.."

if [ "${1-}" = --table ]; then
  exec python3 tests/fuzz/table.py build/fuzz/logs
fi
count=${1:-2000000}
[ $# -gt 0 ] && shift
export CMAKE_C_COMPILER_LAUNCHER=${CMAKE_C_COMPILER_LAUNCHER-ccache} CMAKE_CXX_COMPILER_LAUNCHER=${CMAKE_CXX_COMPILER_LAUNCHER-ccache}
cmake -S . -B build/fuzz -G Ninja -DCMAKE_C_COMPILER=clang-14 -DCMAKE_CXX_COMPILER=clang++-14 -DCMAKE_BUILD_TYPE=None \
  -DCMAKE_CXX_FLAGS="-O2 -g1 -fno-sanitize-recover=all -DFUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION" \
  -DEVPOSE_SANITIZE=address,undefined,fuzzer-no-link \
  -DEVPOSE_FUZZ=ON -DEVPOSE_TESTS=OFF -DEVPOSE_BENCHMARKS=OFF >/dev/null
cmake --build build/fuzz --target evpose_fuzz evpose_fuzz_confirm
python3 tests/fuzz/make_seeds.py build/fuzz/seeds
program=build/fuzz/tests/fuzz/evpose_fuzz

targets=("$@")
if [ ${#targets[@]} -eq 0 ]; then
  read -r -a targets <<<"$(EVPOSE_FUZZ_TARGET='' $program 2>&1 | sed -n 's/.*names none of: //p')"
fi
# Freed memory is kept from use for 4 MB instead of 256 MB, which would leave the caches; leaks are looked for once, at
# the end, over all that was found worth keeping. -entropic=0: its book-keeping would be a fifth of the time.
common=detect_leaks=0:quarantine_size_mb=4:thread_local_quarantine_size_kb=64:malloc_context_size=5
mkdir -p build/fuzz/crashes build/fuzz/logs build/fuzz/unconfirmed
failed=()
for target in "${targets[@]}"; do
  corpus=build/fuzz/corpus/$target seeds=build/fuzz/seeds/$target
  mkdir -p "$corpus" "$seeds"
  longest=$(find "$seeds" -type f -printf '%s\n' | sort -n | tail -1)
  longest=$((${longest:-0} > 1024 ? longest : 1024))
  options=$common limits=(-rss_limit_mb=2048)
  if [[ $target =~ ^hdf5_(events|map)$ ]]; then
    # The HDF5 library believes sizes, asks for that much and then finds the file too short. It is not ours to mend:
    # such requests fail. The rest is for speed: a third of the time would go into the sanitizer's own notes.
    options=$common:allocator_may_return_null=1:max_allocation_size_mb=1024
    options+=:malloc_context_size=0:max_malloc_fill_size=0:quarantine_size_mb=1
    limits=(-rss_limit_mb=4096 -malloc_limit_mb=0)
  fi
  run=("$program" -max_len="$longest" "${limits[@]}" -timeout=20 -reload=0 -entropic=0 -print_final_stats=1
       -artifact_prefix="build/fuzz/crashes/$target-")
  export EVPOSE_FUZZ_TARGET=$target ASAN_OPTIONS=$options
  verdict=
  for ((left = count, part = 0; ; ++part)); do
    log=build/fuzz/logs/$target-$$-$part.log
    if "${run[@]}" -runs="$left" "$corpus" "$seeds" >"$log" 2>&1; then
      # With the callers, by which leaks of the HDF5 library itself are told apart.
      ASAN_OPTIONS=$options:detect_leaks=1:malloc_context_size=30 "${run[@]}" -runs=0 "$corpus" "$seeds" >"$log.leaks" 2>&1 &&
        verdict="$(sed -n 's/^Done \(.*\)/\1/p' "$log"), nothing found"
      break
    fi
    # A child that tries many HDF5 files lays out its memory otherwise than its parent, and may get by where that does
    # not. What the parent breaks down over is tried again with a child of its own, as users have it.
    input=$(sed -n 's/.*Test unit written to //p' "$log" | tail -1)
    [[ $target =~ ^hdf5_(events|map)$ && -f $input ]] &&
      "${program}_confirm" "${limits[@]}" "$input" >"$log.confirm" 2>&1 || break
    mv "$input" build/fuzz/unconfirmed/
    sed -i 's/^SUMMARY: /UNCONFIRMED: /' "$log"
    left=$((left - $(sed -n 's/^stat::number_of_executed_units: //p' "$log")))
  done
  [ -n "$verdict" ] || failed+=("$target")
  echo "$target: ${verdict:-see $log}"
done
[ ${#failed[@]} -eq 0 ]
