"""Forward speed from the flow of the ground, where nothing else measures it. No clock, no I/O."""

from math import exp, inf, nan, sqrt

from lcf_edge.ego_motion.speed_and_rate import SpeedAndRate
from lcf_edge.filter.ground_speed import GroundSpeed

_ACCEL_MPS2 = 1.5  # 1 sigma of a small vehicle's acceleration,
_ACCEL_TIME_S = 0.5  # and time constant with which it changes
_SIGMA_LIMIT_MPS = 0.65  # beyond, the speed is unknown: half a second without ground
_SIGMA_STILL_MPS = 0.02
_NOISE_SHARE = 0.07  # 1 sigma that differs from image to image, as a share of the speed,
_NOISE_MPS = 0.02  # plus this; the rest, such as a slope, is common to all


class GroundBelief:
    """Speed and acceleration from the ground in the last images: a Kalman filter of both.

    The ground shows the mean speed over a window, which is that of its middle: without the acceleration, the speed of a
    vehicle that speeds up or brakes would lag.
    """

    def __init__(self) -> None:
        self.speed_mps = nan  # mean over the last interval; as soon as the ground is seen, that of now
        self._state = SpeedAndRate()
        self._state.begin(0.0, inf, _ACCEL_MPS2)

    def advance(self, dt_s: float) -> None:
        """Let ``dt_s`` pass."""
        state = self._state
        if not state.sigma_mps < inf:
            return
        kept = exp(-dt_s / _ACCEL_TIME_S)
        gained_mps = state.rate_mps2 * dt_s
        state.advance(dt_s)
        self.speed_mps = state.speed_mps + gained_mps / 2
        state.speed_mps += gained_mps
        state.covariance *= kept
        state.rate_mps2 *= kept
        state.rate_var = kept**2 * state.rate_var + (1 - kept**2) * _ACCEL_MPS2**2
        if state.sigma_mps > _SIGMA_LIMIT_MPS:
            self.speed_mps = nan
            state.begin(0.0, inf, _ACCEL_MPS2)

    def stand(self) -> None:
        """Set the speed to zero: the image is stationary."""
        self._state.begin(0.0, _SIGMA_STILL_MPS, _ACCEL_MPS2)
        self.speed_mps = 0.0

    def see(self, ground: GroundSpeed, dt_s: float) -> None:
        """Update by the ground's mean speed over its window, of which ``dt_s`` is new."""
        ago_s, sigma_mps = ground.elapsed_s / 2, ground.sigma_mps
        if self._state.sigma_mps < inf:
            noise_mps = _NOISE_MPS + _NOISE_SHARE * ground.speed_mps
            sigma_mps = noise_mps * sqrt(max(ground.elapsed_s / dt_s, 1.0))  # windows overlap
        self._state.see(ground.speed_mps, sigma_mps, ago_s)
        self.speed_mps = self._state.speed_mps
