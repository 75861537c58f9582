# SPDX-License-Identifier: BSD-3-Clause
"""6-DoF pose from an event camera and an IMU against a prior 3D map of contours"""
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
        """waiting, initialising, tracking, degraded or lost"""
    @property
    def reason(self) -> str:
        """of the health, where it changed"""
    @property
    def points(self) -> int:
        """chosen map points"""
    @property
    def points_matched(self) -> int:
        """of these, with events near by"""

class Tracker:
    """Events and IMU samples in order of time in, poses out; ValueError says what is wrong"""

    def __init__(
        self,
        map: str,
        calibration: str,
        T_map_body: ArrayLike,
        t_ns: int,
        velocity: ArrayLike = ...,
        imu_model: str = "",
        occluders: str = "",
        settings: dict[str, Any] = {},
    ) -> None:
        """Starts at a pose. settings: keys of evpose track --dump-config"""
    def on_update(self, callback: Callable[[Update], None]) -> None:
        """called with each Update, in order of time"""
    def add_events(self, t_us: ArrayLike, x: ArrayLike, y: ArrayLike, p: ArrayLike) -> list[Update]:
        """int64 microseconds, uint16, uint16, 0 or 1; gives the updates that were made"""
    def add_imu(self, t_ns: ArrayLike, samples: ArrayLike) -> list[Update]:
        """int64 ns of shape (n,); (n, 6): gyro rad/s, accel m/s^2; gives the updates that were made"""
    @property
    def has_imu(self) -> bool:
        """the calibration knows where the IMU sits"""
