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
sources() { find apps src tests \( -name '*.h' -o -name '*.cpp' \) -print0; }
if [ "${1:-}" = --check ]; then
  unformatted=$(sources | xargs -0 $tool --dry-run --Werror 2>&1 | grep -o '^[^:]*:[0-9]*:[0-9]*: error' | cut -d: -f1 | sort -u || true)
  [ -z "$unformatted" ] && exit 0
  echo "Not in the project's format (scripts/format.sh brings them into it):"
  echo "$unformatted"
  exit 1
fi
sources | xargs -0 $tool -i
