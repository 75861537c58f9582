# SPDX-License-Identifier: BSD-3-Clause
"""The usual route: corners of a checkerboard in frames, calibrated by OpenCV (Debian: python3-opencv)."""
import cv2
import numpy as np
import yaml

MOST_FRAMES = 60  # more take minutes and tell little


def corners_in(paths, squares):
    """Of each image in which the whole board is found: (n, 1, 2) pixels; and the size of the images."""
    size, found = None, []
    shape = (squares[0] - 1, squares[1] - 1)
    for path in paths:
        image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        size = image.shape[1], image.shape[0]
        ok, corners = cv2.findChessboardCorners(image, shape, flags=cv2.CALIB_CB_ADAPTIVE_THRESH + cv2.CALIB_CB_NORMALIZE_IMAGE)
        if ok:
            found.append(cv2.cornerSubPix(image, corners, (4, 4), (-1, -1), (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)))
    return found, size


def calibrate(paths, squares, square_m):
    """A camera chain with independent sigmas, as text; "failed" and why."""
    paths = sorted(paths)
    found, size = corners_in(paths[::max(1, len(paths) // MOST_FRAMES)], squares)
    if len(found) < 4:
        return {"failed": f"the whole board in {len(found)} frames"}
    grid = np.zeros(((squares[0] - 1) * (squares[1] - 1), 3), np.float32)
    grid[:, :2] = square_m * np.mgrid[:squares[0] - 1, :squares[1] - 1].T.reshape(-1, 2)
    rms, K, distortion, _, _, sigma, _, _ = cv2.calibrateCameraExtended(
        [grid] * len(found), found, size, None, None, flags=cv2.CALIB_FIX_K3)
    sigma = sigma.ravel()
    chain = {"camera_model": "pinhole", "distortion_model": "radtan", "resolution": list(size),
             "intrinsics": [float(v) for v in (K[0, 0], K[1, 1], K[0, 2], K[1, 2])],
             "distortion_coeffs": [float(v) for v in distortion.ravel()[:4]],
             "intrinsics_sigma": [float(v) for v in sigma[:4]], "distortion_sigma": [float(v) for v in sigma[4:8]],
             "calibration_correlation": np.eye(8).tolist()}
    return {"chain": yaml.safe_dump({"cam0": chain}, width=1000), "said": [f"{len(found)} frames, rms {rms:.2f} px"]}
