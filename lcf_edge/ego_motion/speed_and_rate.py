"""A speed and the rate at which it changes: a Kalman filter of both. No clock, no I/O."""

from math import hypot, inf, sqrt


class SpeedAndRate:
    """``speed_mps``, ``sigma_mps``, inf: unknown; ``rate_mps2``, ``rate_var``; ``covariance`` of both."""

    def __init__(self) -> None:
        self.speed_mps = self.rate_mps2 = 0.0
        self.sigma_mps = inf
        self.covariance = self.rate_var = 0.0

    def begin(self, speed_mps: float, sigma_mps: float, rate_sigma_mps2: float) -> None:
        """Start from a speed, at a rate of 0, each with 1 sigma."""
        self.speed_mps, self.sigma_mps = speed_mps, sigma_mps
        self.rate_mps2, self.covariance, self.rate_var = 0.0, 0.0, rate_sigma_mps2**2

    def lose(self) -> None:
        """Make the speed unknown."""
        self.sigma_mps, self.covariance = inf, 0.0

    def see(self, speed_mps: float, sigma_mps: float, ago_s: float) -> None:
        """Update by the speed of ``ago_s`` ago, with 1 sigma; an unknown speed starts from it."""
        if not self.sigma_mps < inf:
            self.speed_mps = speed_mps + ago_s * self.rate_mps2
            self.sigma_mps = hypot(sigma_mps, ago_s * sqrt(self.rate_var))
            self.covariance = ago_s * self.rate_var
            return
        shared_speed = self.sigma_mps**2 - ago_s * self.covariance
        shared_rate = self.covariance - ago_s * self.rate_var
        total = shared_speed - ago_s * shared_rate + sigma_mps**2
        news_mps = speed_mps - (self.speed_mps - ago_s * self.rate_mps2)
        variance = self.sigma_mps**2 - shared_speed**2 / total
        self.speed_mps += shared_speed / total * news_mps
        self.rate_mps2 += shared_rate / total * news_mps
        self.covariance -= shared_speed * shared_rate / total
        self.rate_var -= shared_rate**2 / total
        self.sigma_mps = sqrt(max(variance, 0.0))

    def advance(self, dt_s: float) -> None:
        """Let the uncertainty of ``dt_s`` accrue; the caller moves the speed."""
        variance = self.sigma_mps**2 + 2 * dt_s * self.covariance + dt_s**2 * self.rate_var
        self.covariance += dt_s * self.rate_var
        self.sigma_mps = sqrt(max(variance, 0.0))
