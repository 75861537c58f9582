# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of the documentation that evpose draws itself: one update, and the README's overlay out of a report."""
import base64
import re

import harness

UPDATE_AT_S, UPDATE_CROP = 1.2, (200, 120, 240, 160)  # of room_spiral: x, y, width, height
OVERLAY = 3  # of the report's pictures


def make_update(bench):
    recording = bench.peer("room_720p" if bench.quick else "room_spiral")
    picture = bench.image("update.svg")
    bench.run("bench", "picture", recording.folder, "--map", recording.contours, "--occluders", recording.mesh, "--at",
              0.5 if bench.quick else UPDATE_AT_S, "--crop", *UPDATE_CROP, "-o", picture)
    with bench.folder() as scratch:
        bench.track(recording.folder, recording.contours, scratch / "run", "--occluders", recording.mesh)
        overlays = re.findall(r'"png":"([A-Za-z0-9+/=]+)"', (scratch / "run/report.html").read_text())
    if len(overlays) <= OVERLAY:
        raise harness.Failure(f"the report holds {len(overlays)} pictures")
    bench.image("overlay.png").write_bytes(base64.b64decode(overlays[OVERLAY]))
    return picture
