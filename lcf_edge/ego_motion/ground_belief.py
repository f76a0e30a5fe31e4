"""Forward speed from the flow of the ground, where nothing else measures it. No clock, no I/O."""

from math import hypot, inf, nan, sqrt

from lcf_edge.filter.ground_speed import GroundSpeed

_ACCEL_MPS2 = 1.0  # 1 sigma of a small vehicle's acceleration between measurements
_SIGMA_LIMIT_MPS = 0.6  # beyond, the speed is unknown: half a second without ground
_SIGMA_STILL_MPS = 0.02


class GroundBelief:
    """The speed from the ground in the last images; its uncertainty grows until it is unknown."""

    def __init__(self) -> None:
        self.speed_mps = nan
        self.sigma_mps = inf

    def advance(self, dt_s: float) -> None:
        """Let ``dt_s`` pass."""
        self.sigma_mps += _ACCEL_MPS2 * dt_s
        if self.sigma_mps > _SIGMA_LIMIT_MPS:
            self.speed_mps, self.sigma_mps = nan, inf

    def stand(self) -> None:
        """Set the speed to zero: the image is stationary."""
        self.speed_mps, self.sigma_mps = 0.0, _SIGMA_STILL_MPS

    def see(self, ground: GroundSpeed, dt_s: float) -> None:
        """Update by the ground's speed over its window, of which ``dt_s`` is new."""
        sigma_mps = hypot(ground.sigma_mps, _ACCEL_MPS2 * ground.elapsed_s / 2)
        if not self.sigma_mps < inf:
            self.speed_mps, self.sigma_mps = ground.speed_mps, sigma_mps
            return
        sigma_mps *= sqrt(max(ground.elapsed_s / dt_s, 1.0))
        gain = self.sigma_mps**2 / (self.sigma_mps**2 + sigma_mps**2)
        self.speed_mps += gain * (ground.speed_mps - self.speed_mps)
        self.sigma_mps *= sqrt(1 - gain)
