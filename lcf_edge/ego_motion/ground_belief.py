"""Forward speed from the flow of the ground, where nothing else measures it. No clock, no I/O."""

from math import exp, hypot, inf, nan, sqrt

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
        self.sigma_mps = inf
        self._now_mps = self._accel_mps2 = 0.0
        self._covariance = 0.0  # of speed and acceleration
        self._accel_var = _ACCEL_MPS2**2

    def advance(self, dt_s: float) -> None:
        """Let ``dt_s`` pass."""
        if not self.sigma_mps < inf:
            return
        kept = exp(-dt_s / _ACCEL_TIME_S)
        gained_mps = self._accel_mps2 * dt_s
        variance = self.sigma_mps**2 + 2 * dt_s * self._covariance + dt_s**2 * self._accel_var
        self._covariance = kept * (self._covariance + dt_s * self._accel_var)
        self._accel_var = kept**2 * self._accel_var + (1 - kept**2) * _ACCEL_MPS2**2
        self.speed_mps, self.sigma_mps = self._now_mps + gained_mps / 2, sqrt(max(variance, 0.0))
        self._now_mps += gained_mps
        self._accel_mps2 *= kept
        if self.sigma_mps > _SIGMA_LIMIT_MPS:
            self.speed_mps, self.sigma_mps = nan, inf

    def stand(self) -> None:
        """Set the speed to zero: the image is stationary."""
        self._begin(0.0, _SIGMA_STILL_MPS)

    def see(self, ground: GroundSpeed, dt_s: float) -> None:
        """Update by the ground's mean speed over its window, of which ``dt_s`` is new."""
        ago_s = ground.elapsed_s / 2
        if not self.sigma_mps < inf:
            self._begin(ground.speed_mps, hypot(ground.sigma_mps, _ACCEL_MPS2 * ago_s))
            return
        noise_mps = _NOISE_MPS + _NOISE_SHARE * ground.speed_mps
        noise_var = noise_mps**2 * max(ground.elapsed_s / dt_s, 1.0)  # windows overlap
        shared_speed = self.sigma_mps**2 - ago_s * self._covariance
        shared_accel = self._covariance - ago_s * self._accel_var
        total = shared_speed - ago_s * shared_accel + noise_var
        news_mps = ground.speed_mps - (self._now_mps - ago_s * self._accel_mps2)
        variance = self.sigma_mps**2 - shared_speed**2 / total
        self._now_mps += shared_speed / total * news_mps
        self._accel_mps2 += shared_accel / total * news_mps
        self._covariance -= shared_speed * shared_accel / total
        self._accel_var -= shared_accel**2 / total
        self.speed_mps, self.sigma_mps = self._now_mps, sqrt(max(variance, 0.0))

    def _begin(self, speed_mps: float, sigma_mps: float) -> None:
        """Start from a speed alone."""
        self.speed_mps = self._now_mps = speed_mps
        self.sigma_mps = sigma_mps
        self._accel_mps2, self._covariance, self._accel_var = 0.0, 0.0, _ACCEL_MPS2**2
