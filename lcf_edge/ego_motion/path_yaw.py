"""Yaw rate of the vehicle's path, from that of a camera that also shakes.

Exponential smoothing, quick in turns and slow otherwise: its gain is the squared tracking signal of Trigg and Leach
(1967), the mean error over the mean absolute error. A shaking camera turns to and fro, and the errors cancel; at the
beginning of a turn they have one sign, and the gain goes to 1. No clock, no I/O.
"""

from math import expm1

_ERROR_TIME_S = 0.15  # averaging time of the errors: what turns to and fro within it is shaking


class PathYaw:
    """``rate_radps``: left positive, over the present interval."""

    def __init__(self) -> None:
        self.rate_radps = 0.0
        self._error_radps = self._size_radps = 0.0  # mean error, and mean absolute error
        self._before = 0.0, 0.0, 0.0  # the same three before the present interval
        self._dt_s = 0.0

    def advance(self, dt_s: float) -> None:
        """Begin a new interval."""
        self._before, self._dt_s = (self.rate_radps, self._error_radps, self._size_radps), dt_s

    def see_camera(self, yaw_rate_radps: float) -> None:
        """Take the camera's yaw rate over the present interval; called again, the last one counts."""
        before_radps, error_radps, size_radps = self._before
        off_radps, share = yaw_rate_radps - before_radps, -expm1(-self._dt_s / _ERROR_TIME_S)
        self._error_radps = error_radps + share * (off_radps - error_radps)
        self._size_radps = size_radps + share * (abs(off_radps) - size_radps)
        signal = self._error_radps / self._size_radps if self._size_radps > 0 else 0.0
        self.rate_radps = before_radps + signal * signal * off_radps

    def see_odometry(self, yaw_rate_radps: float) -> None:
        """Take the vehicle's own yaw rate over the present interval."""
        self.rate_radps = yaw_rate_radps
