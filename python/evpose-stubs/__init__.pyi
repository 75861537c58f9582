# SPDX-License-Identifier: BSD-3-Clause
"""6-DoF pose from an event camera and an IMU against a prior 3D map of contours"""
from os import PathLike
from typing import Any, Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

class Update:
    """What the tracker says about one instant; arrays are copies"""

    @property
    def t_ns(self) -> int:
        """data time, ns"""
    @property
    def T_map_body(self) -> NDArray[np.float64]:
        """4x4"""
    @property
    def position(self) -> NDArray[np.float64]:
        """of the body in the map, m"""
    @property
    def quaternion(self) -> NDArray[np.float64]:
        """x y z w, map from body"""
    @property
    def velocity(self) -> NDArray[np.float64]:
        """map frame, m/s"""
    @property
    def angular_rate(self) -> NDArray[np.float64]:
        """body frame, rad/s"""
    @property
    def gyro_bias(self) -> NDArray[np.float64]:
        """rad/s"""
    @property
    def accel_bias(self) -> NDArray[np.float64]:
        """m/s^2"""
    @property
    def covariance(self) -> NDArray[np.float64]:
        """6x6 of (translation in the map, rotation in the body), m^2, rad^2"""
    @property
    def health(self) -> str:
        """waiting, initialising, tracking, degraded, ambiguous or lost"""
    @property
    def reason(self) -> str:
        """of the health, where it changed"""
    @property
    def candidates(self) -> list[NDArray[np.float64]]:
        """while ambiguous: 4x4 values that T_map_body may have, likeliest first"""
    @property
    def probability(self) -> float:
        """that the pose is the right one, not one that happens to agree with events"""
    @property
    def points(self) -> int:
        """chosen map points"""
    @property
    def points_matched(self) -> int:
        """of these, with events near by"""

class Tracker:
    """Events, IMU samples and frames in order of time in, poses out; ValueError says what is wrong"""

    def __init__(
        self,
        map: str | PathLike[str],
        calibration: str | PathLike[str],
        T_map_body: ArrayLike,
        t_ns: int,
        velocity: ArrayLike = ...,
        imu_model: str | PathLike[str] = "",
        occluders: str | PathLike[str] = "",
        settings: dict[str, Any] = {},
    ) -> None:
        """Starts at a pose. settings: keys of evpose track --dump-config, those of a poor start among them (fusion.start_position_sigma_m)"""
    def on_update(self, callback: Callable[[Update], None]) -> None:
        """called with each Update, in order of time"""
    def add_events(self, t_us: ArrayLike, x: ArrayLike, y: ArrayLike, p: ArrayLike) -> list[Update]:
        """int64 microseconds, uint16, uint16, 0 or 1; gives the updates that were made"""
    def add_imu(self, t_ns: ArrayLike, samples: ArrayLike) -> list[Update]:
        """int64 ns of shape (n,); (n, 6): gyro rad/s, accel m/s^2; gives the updates that were made"""
    def add_frame(self, t_ns: int, grey: ArrayLike, exposure_ns: int = 0) -> list[Update]:
        """int64 ns, middle of the exposure; uint8 of shape (height, width) through the event camera's pixels, before the events after it; gives the updates that were made"""
    def events_complete_until(self, t_ns: int) -> list[Update]:
        """int64 ns: no event before it will come, so that updates up to it, by frames alone, need not wait for one; gives the updates that were made"""
    @property
    def has_imu(self) -> bool:
        """the calibration knows where the IMU sits"""

class Recording:
    """A recording folder, a sequence as downloaded, or a file of events; all on the IMU's clock"""

    def __init__(self, path: str | PathLike[str], calibration: str | PathLike[str] = '') -> None:
        """Reads and checks the small files; ValueError says what is wrong"""
    @property
    def name(self) -> str:
        """as in recording.yaml, or of the folder"""
    @property
    def folder(self) -> str:
        """or file"""
    @property
    def has_imu(self) -> bool:
        """there are IMU samples"""
    @property
    def first_ns(self) -> int:
        """begin of what events and IMU have in common"""
    @property
    def last_ns(self) -> int:
        """its end"""
    @property
    def calibration(self) -> str:
        """file; empty: none"""
    @property
    def imu_model(self) -> str:
        """file; empty: none"""
    @property
    def width(self) -> int:
        """px"""
    @property
    def height(self) -> int:
        """px"""
    @property
    def T_cam_body(self) -> NDArray[np.float64]:
        """4x4"""
    @property
    def map(self) -> str:
        """file of its own; empty: none"""
    def events(
        self,
        start_s: float = 0.0,
        duration_s: float = ...,
    ) -> tuple[NDArray[np.int64], NDArray[np.uint16], NDArray[np.uint16], NDArray[np.uint8]]:
        """Arrays t (us), x, y, p (0 or 1), of a part if asked; in the order that Tracker.add_events takes them"""
    def imu(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Arrays t (ns) and (n, 6): gyro rad/s, accel m/s^2; in the order that Tracker.add_imu takes them"""
    def groundtruth(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Arrays t (ns) and T_map_body (n, 4, 4)"""

class Map:
    """The prior map: points along contours, in the map's frame; arrays are copies"""

    def __init__(self, path: str | PathLike[str], occluders: str | PathLike[str] = '') -> None:
        """map.h5, contours as PLY or PCD; a PLY mesh that hides"""
    @property
    def points(self) -> NDArray[np.float64]:
        """(n, 3), m"""
    @property
    def tangents(self) -> NDArray[np.float64]:
        """(n, 3), unit, along the contour"""
    @property
    def sigma(self) -> NDArray[np.float64]:
        """of each point across its contour, m"""
    @property
    def length(self) -> NDArray[np.float64]:
        """of contour that each point stands for, m"""
    @property
    def contour(self) -> NDArray[np.int32]:
        """number of each point's contour; -1: none"""
    @property
    def kind(self) -> list[str]:
        """of each point: unknown, crease, boundary, marking, cylinder_axis or shadow"""
    @property
    def occluders(self) -> NDArray[np.float64]:
        """(n, 3, 3): corners of triangles, m"""
    @property
    def frame(self) -> str:
        """name of the map's frame"""
    @property
    def source(self) -> str:
        """file"""

class Run:
    """A run folder of evpose track: a row for each update; arrays are copies"""

    def __init__(self, folder: str | PathLike[str]) -> None:
        """ValueError says what is wrong"""
    @property
    def folder(self) -> str:
        """where it stands"""
    @property
    def t_ns(self) -> NDArray[np.int64]:
        """(n,), data time"""
    @property
    def T_map_body(self) -> NDArray[np.float64]:
        """(n, 4, 4)"""
    @property
    def covariance(self) -> NDArray[np.float64]:
        """(n, 6, 6) of (translation in the map, rotation in the body), m^2, rad^2"""
    @property
    def valid(self) -> NDArray[np.bool_]:
        """(n,): the tracker stands by the pose"""
    @property
    def health(self) -> list[str]:
        """waiting, initialising, tracking, degraded, ambiguous or lost"""
    @property
    def summary(self) -> Any:
        """what summary.json says"""
    def table(self, file: str = 'states.csv') -> dict[str, NDArray[np.float64]]:
        """Columns of numbers of states.csv, states_imu.csv, calibration.csv or latency.csv, by name"""

class CalibrationNumber:
    """One number of a calibration, with 1-sigma uncertainties"""

    @property
    def name(self) -> str:
        """fx, cy, k1, turn x, place z, time, ..."""
    @property
    def unit(self) -> str:
        """px, deg, mm, ms, or empty"""
    @property
    def given(self) -> float:
        """where it began"""
    @property
    def given_sigma(self) -> float:
        """how far that was believed"""
    @property
    def found(self) -> float:
        """what was found"""
    @property
    def sigma(self) -> float:
        """and how well it is known"""

class Calibration:
    """What calibrate() has found"""

    @property
    def numbers(self) -> list[CalibrationNumber]:
        """those of the file, in the file's order"""
    @property
    def imu_axes(self) -> list[CalibrationNumber]:
        """scale and misalignment of gyroscope and accelerometer, %; empty without an IMU"""
    @property
    def correlation(self) -> NDArray[np.float64]:
        """(n, n), of the numbers"""
    @property
    def notes(self) -> list[str]:
        """what the motion told and what it did not"""
    @property
    def converged(self) -> bool:
        """the passes have come to rest"""
    @property
    def imu_model(self) -> str:
        """file of the IMU; empty without one"""
    @property
    def report(self) -> str:
        """its file"""

def build_map(
    cloud: str | PathLike[str],
    output: str | PathLike[str],
    settings: dict[str, Any] = {},
    threads: int = 1,
) -> Map:
    """Contours from a point cloud (PLY, PCD, LAS), written as map.h5. settings: keys of evpose map build --set"""

def track(
    recording: str | PathLike[str],
    output: str | PathLike[str],
    map: str | PathLike[str] = '',
    calibration: str | PathLike[str] = '',
    occluders: str | PathLike[str] = '',
    init: str = 'auto',
    init_sigma: tuple[float, float] = ...,
    settings: dict[str, Any] = {},
    replace: bool = False,
    imu_model: str | PathLike[str] = '',
) -> Run:
    """What evpose track does, with its options' meaning; a poor start (init_sigma: m, deg) is searched first"""

def smooth(
    recording: str | PathLike[str],
    output: str | PathLike[str],
    map: str | PathLike[str] = '',
    calibration: str | PathLike[str] = '',
    occluders: str | PathLike[str] = '',
    init: str = 'auto',
    init_sigma: tuple[float, float] = ...,
    settings: dict[str, Any] = {},
    replace: bool = False,
    imu_model: str | PathLike[str] = '',
) -> Run:
    """What evpose smooth does: the trajectory from all data, past and future"""

def calibrate(
    recordings: list[str | PathLike[str]],
    output: str | PathLike[str],
    map: str | PathLike[str] = '',
    calibration: str | PathLike[str] = '',
    occluders: str | PathLike[str] = '',
    init: str = 'auto',
    init_sigma: tuple[float, float] = ...,
    settings: dict[str, Any] = {},
    replace: bool = False,
    imu_model: str | PathLike[str] = '',
) -> Calibration:
    """What evpose calibrate does: camera, its pose in the body, its clock and the IMU's axes from recordings before a known map, written as Kalibr's files"""

def relocalise(
    recording: str | PathLike[str],
    init: str,
    init_sigma: tuple[float, float],
    map: str | PathLike[str] = '',
    calibration: str | PathLike[str] = '',
    occluders: str | PathLike[str] = '',
    within_s: float = 1.0,
    settings: dict[str, Any] = {},
) -> Update:
    """The pose near a rough one (x,y,z,qx,qy,qz,qw[@t_s]; init_sigma: m and deg per axis) that the events confirm: the first update whose health is tracking; without one, the last after within_s seconds of data"""
