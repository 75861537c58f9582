# SPDX-License-Identifier: BSD-3-Clause
"""docs/results/boards.md: `evpose calibrate` before printed boards, beside frames and OpenCV (Debian: python3-opencv)."""
import numpy as np

import calibrate
import calibration_errors as errors
import harness
import tables

SIMULATED = {"checkerboard": (["--checkerboard", "9x7", "--square", "0.08"], (8, 6), 0.08)}
SECONDS, FOCAL = 10, 0.1  # of a start that is off by that share
FRAMES = ("frames.rate_hz=30", "frames.exposure_ms=4")
EVERY = 5  # of the frames; OpenCV takes minutes for all
REAL = "data/real/davis240b_checkerboard"
REAL_BOARD = (["--checkerboard", "10x7", "--square", "0.027"], (9, 6), 0.027)
HEAD = ["flight", "by", "pictures", *calibrate.HEAD[1:]]
NUMBERS = ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"]


def opencv():
    try:
        import cv2
    except ImportError as why:
        raise harness.Failure("no cv2 in this Python: install python3-opencv and use /usr/bin/python3") from why
    return cv2


def corners_in(cv2, paths, inner, enlarge=1):
    """Of each picture in which the board is whole, in its own pixels; and the pictures' size."""
    found, size = [], None
    for path in paths:
        picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        size = picture.shape[::-1]
        if enlarge > 1:
            picture = cv2.resize(picture, None, fx=enlarge, fy=enlarge, interpolation=cv2.INTER_CUBIC)
        ok, corners = cv2.findChessboardCornersSB(picture, inner, flags=cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY)
        if ok:
            found.append(((corners + 0.5) / enlarge - 0.5).astype(np.float32))
    return found, size


def by_frames(paths, board, enlarge=1):
    """OpenCV's calibration, with its standard deviations, as a chain."""
    cv2 = opencv()
    _, inner, square_m = board
    found, size = corners_in(cv2, paths, inner, enlarge)
    lattice = np.zeros((inner[0] * inner[1], 3), np.float32)
    lattice[:, :2] = square_m * np.mgrid[0:inner[0], 0:inner[1]].T.reshape(-1, 2)
    rms, K, distortion, _, _, sigma, _, _ = cv2.calibrateCameraExtended([lattice] * len(found), found, size, None, None,
                                                                        flags=cv2.CALIB_FIX_K3)
    sigma = sigma.ravel()[:8]
    return {"intrinsics": [float(v) for v in (K[0, 0], K[1, 1], K[0, 2], K[1, 2])],
            "distortion": [float(v) for v in distortion.ravel()[:4]], "model": "radtan", "size": list(size),
            "covariance": np.diag(sigma ** 2).tolist(), "pictures": len(found), "rms_px": float(rms)}


def judged(name, by, pictures, chain, true, rests):
    e = errors.judge(chain, true)
    cell = [f"{e[key]:.2g}" if key in e else "-" for key in ("focal_percent", "centre_px", "image_px", "rotation_deg", "place_mm",
                                                             "time_ms", "nees", "worst_sigma")]
    return [name, by, pictures, *cell, rests]


def board_map(bench, board):
    path = bench.scratch / ("board_" + "_".join(board[0]).replace("--", "") + ".h5")
    if not path.exists():
        bench.run("map", "board", *board[0], "-o", path)
    return path


def simulated_rows(bench, name, size, seed):
    board = SIMULATED[name]
    recording = bench.simulated("board", SECONDS, (f"camera.size={size}", *FRAMES), f"board_{size}")
    true = errors.read(next(recording.folder.glob("cam*.yaml")))
    far = bench.once(f"board {size} by events", lambda: calibrate.calibrated(
        bench, [recording.folder], calibrate.far_start(true, seed, FOCAL), "--map", board_map(bench, board)))
    title = f"{name}, {size}"
    if "failed" in far:
        events = [title, "events", "-", "refused: " + far["failed"][-100:], *["-"] * (len(HEAD) - 4)]
    else:
        rests = not any("come to rest" in words for words in far["said"])
        events = judged(title, "events", "-", errors.parse(far["chain"]), true, "yes" if rests else "no, said so")
    frames = sorted((recording.folder / "frames").glob("*.png"))[::EVERY]
    chain = bench.once(f"board {size} by frames", lambda: by_frames(frames, board))
    intrinsics = {key: true[key] for key in ("intrinsics", "distortion", "model", "size")}
    chain = {**chain, "covariance": np.array(chain["covariance"])}
    return [events, judged(title, "frames, OpenCV", str(chain["pictures"]), chain, intrinsics, "-")]


def number_cells(chain):
    values = [*chain["intrinsics"], *chain["distortion"]][:8]
    sigma = np.sqrt(np.diag(np.array(chain["covariance"])))
    return [f"{v:.4g} ± {s:.2g}" for v, s in zip(values, sigma)]


def real_rows(bench):
    folder = bench.shared / REAL
    frames = bench.once("real board by frames", lambda: by_frames(sorted((folder / "calibration_frames").glob("*.pgm")), REAL_BOARD, 4))
    rows = [["27 pictures, OpenCV", str(frames["pictures"]), *number_cells(frames), "-"]]
    for name, parts in {"seq_0001": ["seq_0001"], "seq_0002": ["seq_0002"], "both": ["seq_0001", "seq_0002"]}.items():
        paths = [folder / part for part in parts]
        start = errors.read(next(paths[0].glob("cam*.yaml")))
        start["distortion"] = [0.0] * 4
        found = bench.once(f"real board {name}", lambda: calibrate.calibrated(bench, paths, start, "--map",
                                                                              board_map(bench, REAL_BOARD)))
        if "failed" in found:
            rows.append([f"{name}, events", "-", "refused: " + found["failed"][-100:], *["-"] * len(NUMBERS)])
            continue
        rests = not any("come to rest" in words for words in found["said"])
        rows.append([f"{name}, events", "-", *number_cells(errors.parse(found["chain"])), "yes" if rests else "no, said so"])
    return tables.table(["from", "pictures", *NUMBERS, "at rest"], rows)


def make(bench):
    rows = []
    for k, size in enumerate(["vga"]):
        rows += simulated_rows(bench, "checkerboard", size, k)
    goal = ["goal, 10 s", "", "", *calibrate.GOAL[1:]]
    return bench.write_page("boards", {"simulated": tables.table(HEAD, [*rows, goal]), "real": real_rows(bench)})
