#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Builds the modules from core to tracker for 64-bit ARM, runs their tests and a small program in an emulator, and
# writes docs/results/arm64.md. Needs no root once the packages are there: the libraries of that architecture are
# unpacked into build/arm64_sysroot, nothing of the system's own is touched.
set -euo pipefail
cd "$(dirname "$0")/.."
modules=(core camera imu event map registration fusion tracker vectors)

scripts/packages.sh arm64
for tool in aarch64-linux-gnu-g++ mmdebstrap qemu-aarch64-static; do
  command -v $tool >/dev/null || { echo "arm64 skipped: $tool is not installed"; exit 77; }
done
sysroot=build/arm64_sysroot
if [ ! -e $sysroot/complete ]; then
  rm -rf $sysroot && mkdir -p build
  mmdebstrap --quiet --mode=chrootless --arch=arm64 --variant=extract bookworm $sysroot \
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
targets=("${modules[@]/#/evpose_}")
targets=("${targets[@]/%/_test}")
cmake --build --preset arm64 --target "${targets[@]}"
pattern="^($(IFS='|'; echo "${modules[*]}"))\\."
# What only takes too long in the emulator (EVPOSE_TEST_TIMEOUT) is named in the page; a failure ends here.
export CTEST_PARALLEL_LEVEL=${CTEST_PARALLEL_LEVEL:-2}
ctest --preset arm64 --tests-regex "$pattern" </dev/null | tee build/arm64/tests.log || true
grep -q 'tests passed' build/arm64/tests.log
slow=$(sed -nE 's/^[[:space:]]*[0-9]+ - ([^ ]+) \(Timeout\).*/\1/p' build/arm64/tests.log)
if grep -E '^[[:space:]]*[0-9]+ - ' build/arm64/tests.log | grep -vE '\((Timeout|Skipped)\)'; then exit 1; fi
skipped=$(sed -nE 's/^[[:space:]]*[0-9]+ - ([^ ]+) \(Skipped\).*/\1/p' build/arm64/tests.log | xargs)

# A user's program, crossed against what is installed.
build=$PWD/build/arm64
cmake --build --preset arm64
cmake --install "$build" --prefix "$build/prefix" >/dev/null
cmake -S tests/consumer/project -B "$build/consumer" -G Ninja -DCMAKE_BUILD_TYPE=Release -DCOMPONENTS=tracker \
  -DCMAKE_TOOLCHAIN_FILE="$PWD/cmake/arm64.cmake" -Devpose_DIR="$build/prefix/lib/cmake/evpose" \
  -DEXPECTED_VERSION="$(sed -n 's/^project(evpose VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt)"
cmake --build "$build/consumer"
aarch64-linux-gnu-strip -o "$build/consumer/stripped" "$build/consumer/consumer"
memory_kb=$(python3 - qemu-aarch64-static -L $sysroot "$build/consumer/stripped" <<'PYTHON'
import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
PYTHON
)
count=$(ctest --preset arm64 --show-only --tests-regex "$pattern" | sed -n 's/^Total Tests: //p')
within="All $count tests of the modules from core to tracker are passed"
[ -z "$slow" ] || within="$((count - $(wc -w <<<"$slow"))) of $count tests of the modules from core to tracker are passed; over 10 minutes in the
  emulator, hence not known: $(xargs <<<"$slow" | sed 's/[^ ]*/`&`/g; s/ /, /g')"
[ -z "$skipped" ] || within="$within (those that want the shared recordings skipped: \`${skipped// /\`, \`}\`)"
cat >docs/results/arm64.md <<PAGE
Made by \`scripts/test_arm64.sh\` at commit \`$(git rev-parse --short HEAD)\`.

# 64-bit ARM

Crossed by Debian's \`g++-aarch64-linux-gnu\` $(aarch64-linux-gnu-g++ -dumpfullversion) at \`-O3 -march=armv8-a\`, run by \`qemu-aarch64-static\`: no ARM machine was there, so
no speed is said.

- $within. So are those of the kernels with vectors elsewhere
  (EVT2, EVT3, textures of the simulator). Vectors are those of GCC, which it makes of NEON; each kernel is held to its
  scalar twin. Only the simulator names instructions of x86, and has another way beside each.
- \`tests/consumer/project\`, linked with the installed static libraries, tracks: $(awk "BEGIN {printf \"%.1f\", $(stat -c %s "$build/consumer/stripped") / 1e6}") MB of program, stripped, and
  $(awk "BEGIN {printf \"%.0f\", $memory_kb / 1024}") MiB of memory at the most, the emulator's own included.
PAGE
