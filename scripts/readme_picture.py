#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Takes a picture out of a run's report: readme_picture.py RUN/report.html NUMBER OUT.png (the first is 0)."""
import base64
import pathlib
import re
import sys

if len(sys.argv) != 4:
    sys.exit(__doc__)
pictures = re.findall(r'"png":"([A-Za-z0-9+/=]+)"', pathlib.Path(sys.argv[1]).read_text())
if int(sys.argv[2]) >= len(pictures):
    sys.exit(f"{sys.argv[1]} holds {len(pictures)} pictures")
pathlib.Path(sys.argv[3]).write_bytes(base64.b64decode(pictures[int(sys.argv[2])]))
