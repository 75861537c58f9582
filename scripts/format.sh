#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# Brings the C++ sources into the project's format; with --check only names what is not.
set -euo pipefail
cd "$(dirname "$0")/.."

tool=clang-format-14
if ! command -v $tool >/dev/null; then
  echo "$tool is not installed; other versions format differently: scripts/packages.sh test"
  exit 77
fi
find apps src tests -name '*.h' -print0 -o -name '*.cpp' -print0 |
  if [ "${1:-}" = --check ]; then
    xargs -0 $tool --dry-run --Werror
  else
    xargs -0 $tool -i
  fi
