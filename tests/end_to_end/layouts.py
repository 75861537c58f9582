# SPDX-License-Identifier: BSD-3-Clause
"""The tiny recording of recording.py in the layouts in which data sets are downloaded."""
import json
import pathlib

import numpy as np

from recording import FOCAL, HEIGHT, WIDTH, position

T_CAM_IMU = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])


def rotation(axis, angle):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def transform(r, p):
    t = np.eye(4)
    t[:3, :3], t[:3, 3] = r, p
    return t


def quaternion(r):
    """x y z w of a rotation matrix; by the largest eigenvector, which has no special cases."""
    k = np.array([[r[0, 0] - r[1, 1] - r[2, 2], 0, 0, 0], [r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2], 0, 0],
                  [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1], 0],
                  [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], np.trace(r)]])
    values, vectors = np.linalg.eigh(k)
    return vectors[:, np.argmax(values)]


T_IMU_MARKER = transform(rotation([1, 2, -1], 0.7), [0.03, -0.02, 0.05])


def marker_rows(recording):
    """Position and quaternion of a body that sits on the IMU by T_IMU_MARKER, at each stamp of the ground truth."""
    for t in recording.groundtruth_t_s:
        T = transform(np.eye(3), position(t)) @ T_IMU_MARKER
        yield t, np.hstack([T[:3, 3], quaternion(T[:3, :3])])


def write_events(path, recording, **datasets):
    import h5py

    with h5py.File(path, "w") as file:
        for name, values, kind in (("t", recording.t, "u4"), ("x", recording.x, "u2"), ("y", recording.y, "u2"),
                                   ("p", recording.p, "u1")):
            file.create_dataset(f"events/{name}", data=np.asarray(values).astype(kind), chunks=(4096,))
        ends = np.arange(0, int(recording.t[-1]) // 1000 + 2) * 1000
        file["ms_to_idx"] = np.searchsorted(recording.t, ends).astype("u8")
        for name, values in datasets.items():
            file[name] = values


def write_tum_vie(folder, recording, sequence="mocap-desk", letter="A"):
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True)
    write_events(folder / f"{sequence}-events_left.h5", recording)
    lines = ["#timestamp [us] gx gy gz ax ay az temperature"]
    lines += [f"{t / 1000:.3f} " + " ".join(f"{v:.7f}" for v in row) + " 35.5"
              for t, row in zip(recording.imu_t_ns, recording.imu)]
    (folder / "imu_data.txt").write_text("\n".join(lines) + "\n")
    lines = ["#timestamp [us] px py pz qx qy qz qw"]
    lines += [f"{1e6 * t:.3f} " + " ".join(f"{v:.9f}" for v in row) for t, row in marker_rows(recording)]
    (folder / "mocap_data.txt").write_text("\n".join(lines) + "\n")
    place = named(np.linalg.inv(T_CAM_IMU))
    other = named(transform(np.eye(3), [0.1, 0.2, 0.3]))
    grey = {"camera_type": "kb4", "intrinsics": dict(fx=700.0, fy=700.0, cx=512.0, cy=512.0, k1=0, k2=0, k3=0, k4=0)}
    event = {"camera_type": "pinhole",
             "intrinsics": dict(fx=FOCAL, fy=FOCAL, cx=(WIDTH - 1) / 2, cy=(HEIGHT - 1) / 2)}
    value = {"T_imu_cam": [other, other, place, other], "intrinsics": [grey, grey, event, event],
             "resolution": [[1024, 1024], [1024, 1024], [WIDTH, HEIGHT], [WIDTH, HEIGHT]], "cam_time_offset_ns": 0,
             "imu_update_rate": 500.0, "accel_noise_std": [0.002] * 3, "gyro_noise_std": [0.0004] * 3,
             "accel_bias_std": [0.0003] * 3, "gyro_bias_std": [2e-5] * 3}
    (folder / f"camera-calibration{letter}.json").write_text(json.dumps({"value0": value}, indent=4))
    markers = {"T_imu_marker": named(T_IMU_MARKER), "T_mocap_world": named(np.eye(4)), "mocap_time_offset_ns": 0,
               "mocap_to_imu_offset_ns": 0}
    (folder / f"mocap-imu-calibration{letter}.json").write_text(json.dumps({"value0": markers}, indent=4))
    recording.write_contours(folder / "contours.ply")
    return folder


def named(T):
    q = quaternion(T[:3, :3])
    return dict(zip(("px", "py", "pz", "qx", "qy", "qz", "qw"), [float(v) for v in (*T[:3, 3], *q)]))


def matrix_text(T):
    return "[" + ", ".join(repr(float(v)) for v in np.asarray(T).ravel()) + "]"


def write_vector(root, recording, sequence="desk_normal1", epoch_us=1_640_000_000_000_000):
    """The sequence in its folder, the calibrations in one beside it; stamps are Unix times."""
    root = pathlib.Path(root)
    folder, calibration = root / sequence, root / "small_scale_calibration"
    folder.mkdir(parents=True)
    calibration.mkdir()
    write_events(folder / f"{sequence}.synced.left_event.hdf5", recording, t_offset=np.array([epoch_us], dtype="i8"))
    seconds = epoch_us // 1_000_000
    lines = ["# IMU", "# timestamp gx gy gz ax ay az qx qy qz qw"]
    lines += [f"{seconds + t // 10**9}.{t % 10**9:09d} " + " ".join(f"{v:.7f}" for v in row) + " 0 0 0 1"
              for t, row in zip(recording.imu_t_ns, recording.imu)]
    (folder / f"{sequence}.synced.imu.txt").write_text("\n".join(lines) + "\n")
    lines = ["# ground truth", "# timestamp tx ty tz qx qy qz qw"]
    lines += [f"{seconds}.{int(round(1e9 * t)):09d} " + " ".join(f"{v:.9f}" for v in row)
              for t, row in marker_rows(recording)]
    (folder / f"{sequence}.synced.gt.txt").write_text("\n".join(lines) + "\n")
    (calibration / "left_event_camera_intrinsic_results.yaml").write_text(f"""image_width: {WIDTH}
image_height: {HEIGHT}
camera_name: left_event_camera
camera_matrix: {{rows: 3, cols: 3, data: [{FOCAL}, 0, {(WIDTH - 1) / 2}, 0, {FOCAL}, {(HEIGHT - 1) / 2}, 0, 0, 1]}}
camera_model: plumb_bob
distortion_coefficients: {{rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}}
""")
    T_cam0_cam2 = transform(rotation([0, 1, 0], 0.1), [0.04, -0.01, 0.005])
    T_cam0_imu = T_cam0_cam2 @ T_CAM_IMU
    T_cam0_body = T_cam0_imu @ T_IMU_MARKER
    (calibration / "small_scale_joint_camera_extrinsic_results.yaml").write_text(
        f"cam1: {{T_cam0_cam1: {matrix_text(transform(np.eye(3), [0.17, 0, 0]))}}}\n"
        f"cam2: {{T_cam0_cam2: {matrix_text(T_cam0_cam2)}}}\n")
    (calibration / "left_camera_imu_extrinsic_results1.yaml").write_text(f"""cam0:
  T_cam_imu: {matrix_text(T_cam0_imu)}
  camera_model: pinhole
  distortion_coeffs: [-0.3, 0.1, 0.0, 0.0]
  distortion_model: radtan
  intrinsics: [886.0, 886.0, 610.0, 514.0]
  resolution: [1224, 1024]
""")
    (calibration / "camera_mocap_extrinsic_results1.yaml").write_text(
        f"cam0: {{T_cam_body: {matrix_text(T_cam0_body)}}}\n")
    (calibration / "imu_intrinsic_results.yaml").write_text(recording.imu_model)
    recording.write_contours(folder / "contours.ply")
    return folder
