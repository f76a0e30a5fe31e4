"""The gyro's bias about one axis: a Kalman filter of three states, which ``gyro_bias`` explains. All rad/s."""

import math

PRIOR_RADPS = 0.2  # 1 sigma of an unknown bias: an MPU-6050's 20 °/s are 0.35
PRIOR_VARIANCE = PRIOR_RADPS * PRIOR_RADPS
DRIFT_RADPS = 1e-3  # 1 sigma of the bias's drift in a second
FLOW_TIME_S = 10.0  # correlation time of s
OUTLIER = 4.0  # sigmas beyond which an observation is an outlier
MIN_VARIANCE = 1e-12


class AxisBias:
    """``bias``, ``flow``, ``noise``: b, s and w, with their covariance. ``error``: the gyro's error over the present
    interval, b + w.

    ``flow_radps``: σ_s.
    """

    def __init__(self, flow_radps: float) -> None:
        self.measured = 1.0  # 0: no gyro over the present interval, its "rate" is a guess
        self.flow_radps = flow_radps
        self.bias = self.flow = self.noise = 0.0
        self.bias_bias, self.flow_flow, self.noise_noise = PRIOR_VARIANCE, flow_radps * flow_radps, 0.0
        self.bias_flow = self.bias_noise = self.flow_noise = 0.0
        self.with_bias = self.with_flow = self.with_noise = 0.0  # covariance of what is observed with each state
        self.off = 0.0  # innovation: observed less expected
        self.variance = 1.0  # of the innovation

    def sigma(self) -> float:
        """1 sigma of b."""
        return math.sqrt(self.bias_bias)

    def error(self) -> float:
        """The gyro's error over the present interval."""
        return self.measured * self.bias + self.noise

    def error_sigma(self) -> float:
        """1 sigma of ``error``."""
        measured = self.measured
        variance = measured * measured * self.bias_bias + 2 * measured * self.bias_noise + self.noise_noise
        return math.sqrt(max(variance, MIN_VARIANCE))

    def forget(self) -> None:
        """Forget the bias: it may have any value."""
        self.bias_bias = PRIOR_VARIANCE
        self.bias_flow = self.bias_noise = 0.0

    def set_noise(self, sigma: float) -> None:
        """Set 1 sigma of w, which nothing else measures."""
        self.noise_noise = sigma * sigma
        self.bias_noise = self.flow_noise = 0.0

    def set_flow(self, sigma: float) -> None:
        """Set σ_s."""
        self.flow_flow += max(0.0, sigma * sigma - self.flow_radps * self.flow_radps)
        self.flow_radps = sigma

    def advance(self, dt_s: float, noise_radps: float, measured: bool) -> None:
        """Begin a new interval. ``noise_radps``: 1 sigma of w. ``measured``: whether there is a gyro's rate for it."""
        self.measured = 1.0 if measured else 0.0
        kept = math.exp(-dt_s / FLOW_TIME_S)
        self.flow *= kept
        self.noise = 0.0
        self.bias_flow *= kept
        self.flow_flow = self.flow_flow * kept * kept + (1 - kept * kept) * (self.flow_radps * self.flow_radps)
        self.set_noise(noise_radps)
        grown = self.bias_bias + dt_s * (DRIFT_RADPS * DRIFT_RADPS)
        self.bias_bias = min(grown, max(self.bias_bias, PRIOR_VARIANCE))

    def compare(self, bias: float, flow: float, noise: float, observed: float, sigma: float) -> bool:
        """Compare an observation of ``bias``·b + ``flow``·s + ``noise``·w. Return False for an outlier."""
        self.with_bias = self.bias_bias * bias + self.bias_flow * flow + self.bias_noise * noise
        self.with_flow = self.bias_flow * bias + self.flow_flow * flow + self.flow_noise * noise
        self.with_noise = self.bias_noise * bias + self.flow_noise * flow + self.noise_noise * noise
        self.variance = self.with_bias * bias + self.with_flow * flow + self.with_noise * noise + sigma * sigma
        self.off = observed - (self.bias * bias + self.flow * flow + self.noise * noise)
        return self.off * self.off <= OUTLIER * OUTLIER * self.variance

    def learn(self) -> None:
        """Update the states with the observation that was compared."""
        bias, flow, noise = (
            self.with_bias / self.variance,
            self.with_flow / self.variance,
            self.with_noise / self.variance,
        )
        self.bias += bias * self.off
        self.flow += flow * self.off
        self.noise += noise * self.off
        self.bias_bias = max(self.bias_bias - bias * self.with_bias, MIN_VARIANCE)
        self.flow_flow = max(self.flow_flow - flow * self.with_flow, MIN_VARIANCE)
        self.noise_noise = max(self.noise_noise - noise * self.with_noise, MIN_VARIANCE)
        self.bias_flow -= bias * self.with_flow
        self.bias_noise -= bias * self.with_noise
        self.flow_noise -= flow * self.with_noise
