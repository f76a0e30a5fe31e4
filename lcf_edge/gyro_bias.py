"""The gyro's bias: unknown until learnt, from rest and from the rotation that the pictures show.

A Kalman filter, each axis by itself, with the states, all rad/s,

- b: the bias, a random walk (temperature);
- s: by how much the flow is mistaken about the rate, slowly changing (O and lens are not known exactly);
- w: what else the gyro is mistaken over the present interval, forgotten with it.

The gyro's mean rate over an interval is ω + b + w. Whatever else tells the rate ω of that interval is an observation
of the difference: b + w when corners of the whole picture tell it, b + w + s when the flow does, and b alone, over a
longer time, at rest. No clock, no I/O.
"""

from math import exp

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

PRIOR_RADPS = 0.2  # 1 sigma of an unknown bias: an MPU-6050's 20 °/s are 0.35
KNOWN_RADPS = 0.03  # a bias with a larger sigma is not known
_DRIFT_RADPS = 1e-3  # 1 sigma of what the bias wanders in a second
_FLOW_RADPS = 0.002  # 1 sigma of s, at least
_FOCUS_RAD = 0.01  # 1 sigma of O
_FLOW_TIME_S = 10.0  # for which s lasts
_OUTLIER = 4.0  # sigmas by which an observation may be off
_ANY_RADPS = 3.0  # 1 sigma of a rate of which nothing is known
_REFUTED_S = 1.0  # of outliers without a break: then the bias is another one

_BIAS, _FLOW, _NOISE = range(3)
_LEAST_VARIANCE = 1e-12


class GyroBias:
    """``mean_radps``, ``sigma_radps``: (3,), the bias. ``error_radps``, ``error_sigma_radps``: (3,), all that the
    gyro is mistaken by over the present interval."""

    def __init__(self) -> None:
        self._state = np.zeros((3, 3))  # axis, state
        self._covariance = np.zeros((3, 3, 3))
        self._measured = 1.0  # 0: no gyro over the present interval, its "rate" is a guess
        self._dt_s = 0.0
        self._against_s = 0.0
        self._flow_radps = _FLOW_RADPS
        self._covariance[:, _FLOW, _FLOW] = _FLOW_RADPS**2
        self.forget()

    @property
    def mean_radps(self) -> Floats:
        return self._state[:, _BIAS].copy()

    @property
    def sigma_radps(self) -> Floats:
        sigma: Floats = np.sqrt(self._covariance[:, _BIAS, _BIAS])
        return sigma

    @property
    def known(self) -> bool:
        """Whether all axes are known to ``KNOWN_RADPS``."""
        return bool(self._covariance[:, _BIAS, _BIAS].max() <= KNOWN_RADPS**2)

    @property
    def error_radps(self) -> Floats:
        return self._measured * self._state[:, _BIAS] + self._state[:, _NOISE]

    @property
    def error_sigma_radps(self) -> Floats:
        observed = self._row(flow=0.0)
        sigma: Floats = np.sqrt(np.maximum(observed @ (self._covariance @ observed).T, _LEAST_VARIANCE))
        return sigma

    def forget(self) -> None:
        """The bias may be any."""
        self._covariance[:, _BIAS, :] = self._covariance[:, :, _BIAS] = 0
        self._covariance[:, _BIAS, _BIAS] = PRIOR_RADPS**2
        self._against_s = 0.0

    def advance(self, dt_s: float, noise_radps: Floats, measured: bool) -> None:
        """A new interval. ``noise_radps``: (3,), 1 sigma of w. ``measured``: whether there is a gyro's rate for it."""
        self._measured, self._dt_s = float(measured), dt_s
        state, covariance = self._state, self._covariance
        kept = exp(-dt_s / _FLOW_TIME_S)
        state[:, _FLOW] *= kept
        state[:, _NOISE] = 0
        covariance[:, _FLOW, :] *= kept
        covariance[:, :, _FLOW] *= kept
        covariance[:, _FLOW, _FLOW] += (1 - kept * kept) * self._flow_radps**2
        covariance[:, _NOISE, :] = covariance[:, :, _NOISE] = 0
        covariance[:, _NOISE, _NOISE] = noise_radps**2
        grown = covariance[:, _BIAS, _BIAS] + dt_s * _DRIFT_RADPS**2
        covariance[:, _BIAS, _BIAS] = np.minimum(grown, np.maximum(covariance[:, _BIAS, _BIAS], PRIOR_RADPS**2))

    def doubt(self) -> None:
        """The gyro may be mistaken by anything over the present interval."""
        self._covariance[:, _NOISE, :] = self._covariance[:, :, _NOISE] = 0
        self._covariance[:, _NOISE, _NOISE] = _ANY_RADPS**2

    def see_rest(self, rate_radps: Floats, sigma_radps: float) -> bool:
        """The gyro's mean rate (3,) while the vehicle stands. False: it is an outlier, and not used."""
        return self._observe(np.array([1.0, 0.0, 0.0]), rate_radps, np.full(3, sigma_radps))

    def see_picture(self, error_radps: Floats, sigma_radps: Floats) -> bool:
        """The gyro's rate less that of the whole picture, (3,), with its sigmas. False: an outlier, not used."""
        return self._observe(self._row(flow=0.0), error_radps, sigma_radps)

    def see_flow(self, error_radps: Floats, sigma_radps: Floats, expansion_hz: float) -> bool:
        """The gyro's rate less that of the flow, (3,), with its sigmas. False: an outlier, not used.

        ``expansion_hz``: mean V/Z of what is seen; an error of O turns so much of itself into rotation.
        """
        flow_radps = max(_FLOW_RADPS, _FOCUS_RAD * expansion_hz)
        self._covariance[:, _FLOW, _FLOW] += max(0.0, flow_radps**2 - self._flow_radps**2)
        self._flow_radps = flow_radps
        return self._observe(self._row(flow=1.0), error_radps, sigma_radps)

    def _row(self, flow: float) -> Floats:
        return np.array([self._measured, flow, 1.0])

    def _observe(self, row: Floats, seen: Floats, sigma: Floats) -> bool:
        shared = self._covariance @ row  # (axis, state)
        variance = shared @ row + sigma * sigma
        off = seen - self._state @ row
        if (off * off > _OUTLIER**2 * variance).any():
            self._against_s += self._dt_s
            if self._against_s > _REFUTED_S:
                self.forget()
            return False
        self._against_s = 0.0
        gain = shared / variance[:, None]
        self._state += gain * off[:, None]
        self._covariance -= gain[:, :, None] * shared[:, None, :]
        diagonal = np.einsum("aii->ai", self._covariance)
        np.maximum(diagonal, _LEAST_VARIANCE, out=diagonal)
        return True
