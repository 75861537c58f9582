#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Installs what is missing, builds with warnings as errors and runs the tests. Format, lint, layers, installation,
# browser and end-to-end checks are tests like all others: what fails is named in the summary at the end.
# On two cores the first build takes about 10 minutes and all tests about 11, two of them the first lint.
#   scripts/test.sh            everything
#   scripts/test.sh --quick    the modules' unit tests
set -euo pipefail
cd "$(dirname "$0")/.."

select=()
case "${1:-}" in
  "") ;;
  --quick) select=(--label-regex '^unit$') ;;
  *) echo "usage: scripts/test.sh [--quick]" >&2; exit 2 ;;
esac

scripts/packages.sh test
export CMAKE_C_COMPILER_LAUNCHER=ccache CMAKE_CXX_COMPILER_LAUNCHER=ccache
export CCACHE_SLOPPINESS=pch_defines,time_macros  # without which it keeps nothing that uses precompiled headers
command -v ccache >/dev/null || unset CMAKE_C_COMPILER_LAUNCHER CMAKE_CXX_COMPILER_LAUNCHER
cmake --preset dev
cmake --build --preset dev
exec ctest --preset dev --parallel 2 "${select[@]}" </dev/null
