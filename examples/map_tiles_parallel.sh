#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# A map of a cloud of any size on one machine, by GNU parallel (Debian: parallel):
#   map_tiles_parallel.sh CLOUD TILES MAP [--set key=value ...]
# One job for each core, with the memory of one tile each; --joblog and --resume go on where it was interrupted.
set -euo pipefail
cloud=$1 tiles=$2 map=$3
shift 3

[ -d "$tiles" ] || evpose map build "$cloud" --plan "$tiles" "$@"
last=$(($(find "$tiles" -name 'tile_*.ply' | wc -l) - 1))
seq 0 "$last" | parallel --joblog "$tiles/jobs.log" --resume-failed --halt soon,fail=1 \
  evpose -q map build "$tiles" --tile {} --threads 1
evpose map merge "$tiles" -o "$map"
