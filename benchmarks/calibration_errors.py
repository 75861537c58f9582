# SPDX-License-Identifier: BSD-3-Clause
"""Camera chains as `evpose calibrate` reads and writes them, and how far one is from the truth."""
import math

import numpy as np
import yaml


def parse(text):
    cam = yaml.safe_load(text)["cam0"]
    # Converted, since YAML 1.1 takes 5e-04 for a word.
    out = {"intrinsics": [float(v) for v in cam["intrinsics"]], "distortion": [float(v) for v in cam["distortion_coeffs"]],
           "model": cam["distortion_model"], "size": cam["resolution"]}
    if "T_cam_imu" in cam:
        out |= {"T_cam_imu": np.array(cam["T_cam_imu"], dtype=float), "time_s": float(cam.get("timeshift_cam_imu", 0.0))}
    if "calibration_correlation" in cam:
        sigma = cam["intrinsics_sigma"] + cam["distortion_sigma"]
        if "T_cam_imu" in cam:
            turn, shift = cam["T_cam_imu_sigma"][:3], cam["T_cam_imu_sigma"][3:]
            sigma = [*sigma, *np.radians(turn), *shift, cam["timeshift_sigma"]]
        sigma = np.array(sigma, dtype=float)
        out["covariance"] = np.array(cam["calibration_correlation"], dtype=float) * np.outer(sigma, sigma)
    return out


def read(path):
    return parse(path.read_text())


def write(path, chain):
    """Without `sigmas`, those of a data sheet hold."""
    cam = {**chain.get("sigmas", {}), "camera_model": "pinhole", "distortion_coeffs": [float(v) for v in chain["distortion"]],
           "distortion_model": chain["model"], "intrinsics": [float(v) for v in chain["intrinsics"]],
           "resolution": list(chain["size"])}
    if "T_cam_imu" in chain:
        cam |= {"T_cam_imu": [[float(v) for v in line] for line in chain["T_cam_imu"]],
                "timeshift_cam_imu": float(chain["time_s"])}
    path.write_text(yaml.safe_dump({"cam0": cam}, default_flow_style=None, width=200))


def rotation(vector):
    angle = np.linalg.norm(vector)
    if angle == 0:
        return np.eye(3)
    x, y, z = vector / angle
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K


def vector(R):
    angle = math.acos(max(-1.0, min(1.0, (np.trace(R) - 1) / 2)))
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return axis / 2 if angle < 1e-9 else angle / (2 * math.sin(angle)) * axis


def project(chain, rays):
    """Pixels (n, 2) of rays (n, 3); radial-tangential distortion."""
    fx, fy, cx, cy = chain["intrinsics"]
    k1, k2, p1, p2, k3 = (*chain["distortion"], 0.0, 0.0, 0.0, 0.0, 0.0)[:5]
    x, y = rays[:, 0] / rays[:, 2], rays[:, 1] / rays[:, 2]
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return np.stack([fx * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + cx,
                     fy * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + cy], axis=1)


def rays_of(chain, step=20):
    """Rays through a grid of pixels, by fixed point."""
    width, height = chain["size"]
    fx, fy, cx, cy = chain["intrinsics"]
    u, v = np.meshgrid(np.arange(0, width, step, dtype=float), np.arange(0, height, step, dtype=float))
    pixel = np.stack([u.ravel(), v.ravel()], axis=1)
    ray = np.stack([(pixel[:, 0] - cx) / fx, (pixel[:, 1] - cy) / fy, np.ones(len(pixel))], axis=1)
    for _ in range(30):
        ray[:, :2] -= (project(chain, ray) - pixel) / [fx, fy]
    return ray


def image_difference_px(found, true):
    """RMS over the image, after the turn of the camera that fits best: nothing but the pose could tell that."""
    rays = rays_of(true)
    seen = project(true, rays)
    turn = np.zeros(3)
    for _ in range(6):
        off = (project(found, rays @ rotation(turn).T) - seen).ravel()
        J = np.stack([((project(found, rays @ rotation(turn + 1e-6 * axis).T) - seen).ravel() - off) / 1e-6
                      for axis in np.eye(3)], axis=1)
        turn = turn - np.linalg.lstsq(J, off, rcond=None)[0]
    return float(np.sqrt(np.mean(np.sum((project(found, rays @ rotation(turn).T) - seen) ** 2, axis=1))))


def difference(found, true):
    """In the order of the covariance: intrinsics, distortion, camera in the body about and along its axes, time."""
    off = [*np.subtract(found["intrinsics"], true["intrinsics"]), *np.subtract(found["distortion"], true["distortion"])]
    if "T_cam_imu" not in found:
        return np.array(off)
    T_body_cam, T_true = np.linalg.inv(found["T_cam_imu"]), np.linalg.inv(true["T_cam_imu"])
    return np.array([*off, *vector(T_body_cam[:3, :3] @ T_true[:3, :3].T), *(T_body_cam[:3, 3] - T_true[:3, 3]),
                     found["time_s"] - true["time_s"]])


def axes(text):
    """Of the IMU's file, as Kalibr writes it: gyroscope and accelerometer (2, 3, 3), and their sigmas or None."""
    imu = yaml.safe_load(text)
    sensors = [imu[name] for name in ("gyroscopes", "accelerometers")]
    sigma = [np.array(sensor["M_sigma"], dtype=float) for sensor in sensors if "M_sigma" in sensor]
    return np.array([sensor["M"] for sensor in sensors], dtype=float), np.array(sigma) if len(sigma) == 2 else None


def judge_axes(found, true):
    """RMS errors of the elements in %, of ideal axes and of those found, and mean square of error over sigma."""
    (M, sigma), (truth, _) = axes(found), axes(true)
    rms = lambda values: 100 * np.sqrt(np.mean(values ** 2, axis=(1, 2)))  # noqa: E731
    ideal, left = rms(truth - np.eye(3)), rms(M - truth)
    return {"gyro_ideal": float(ideal[0]), "gyro": float(left[0]), "accel_ideal": float(ideal[1]), "accel": float(left[1]),
            "axes_square": float(np.mean(((M - truth) / sigma) ** 2))}


def judge(found, true):
    """Errors of a calibration, and how they compare with the covariance that it states."""
    off, f = difference(found, true), true["intrinsics"]
    out = {"focal_percent": 100 * max(abs(off[0] / f[0]), abs(off[1] / f[1])), "centre_px": float(np.hypot(off[2], off[3])),
           "image_px": image_difference_px(found, true)}
    if "T_cam_imu" in found:
        out |= {"rotation_deg": float(np.degrees(np.linalg.norm(off[-7:-4]))),
                "place_mm": float(1e3 * np.linalg.norm(off[-4:-1])), "time_ms": float(1e3 * abs(off[-1]))}
    if "covariance" in found:
        P = found["covariance"]
        told = np.diag(P) > 0
        P, off = P[np.ix_(told, told)], off[told]
        out |= {"nees": float(off @ np.linalg.solve(P, off) / len(off)), "worst_sigma": float(np.max(np.abs(off) / np.sqrt(np.diag(P))))}
    return out
