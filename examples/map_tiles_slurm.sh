#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
# The tiles of a map as a Slurm array; TILES is on a file system that all nodes see. First and last, on any node:
#   evpose map build CLOUD --plan TILES            # says how many tiles there are
#   TILES=... sbatch --array=0-249 examples/map_tiles_slurm.sh
#   evpose map merge TILES -o MAP                  # names the tiles that are missing, if some are
#SBATCH --job-name=evpose-tiles
#SBATCH --cpus-per-task=1
#SBATCH --mem=2G
#SBATCH --time=01:00:00
#SBATCH --output=tile_%a.log
set -euo pipefail
: "${TILES:?the folder that --plan wrote}"
srun evpose map build "$TILES" --tile "$SLURM_ARRAY_TASK_ID" --threads 1
