"""The gyro's bias: unknown until learnt, from rest and from the rotation that the pictures show.

A Kalman filter, each axis by itself, with the states, all rad/s,

- b: the bias, a random walk (temperature);
- s: by how much the flow is mistaken about the rate, slowly changing (O and lens are not known exactly);
- w: what else the gyro is mistaken over the present interval, forgotten with it.

The gyro's mean rate over an interval is ω + b + w. Whatever else gives the rate ω of that interval is an observation
of the difference: b + w when corners of the whole picture tell it, b + w + s when the flow does, and b alone, over a
longer time, at rest. No clock, no I/O.
"""

from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt

from lcf_edge.ego_motion.axis_bias import AxisBias

Floats = npt.NDArray[np.float64]
Three = Sequence[float] | Floats
"""One number for each axis."""

KNOWN_RADPS = 0.03  # a bias with a larger sigma is not known
_FLOW_RADPS = 0.002  # 1 sigma of s, at least
_FOCUS_RAD = 0.01  # 1 sigma of O
_ANY_RADPS = 3.0  # 1 sigma of a rate of which nothing is known
_REFUTED_S = 1.0  # of outliers without a break: then the bias is another one


class GyroBias:
    """``mean_radps``, ``sigma_radps``: (3,), the bias. ``error_radps``, ``error_sigma_radps``: (3,), all that the
    gyro is mistaken by over the present interval."""

    def __init__(self) -> None:
        self._axes = [AxisBias(_FLOW_RADPS) for _ in range(3)]
        self._measured = True
        self._dt_s = 0.0
        self._against_s = 0.0

    @property
    def mean_radps(self) -> Floats:
        return np.array(self.means())

    @property
    def sigma_radps(self) -> Floats:
        return np.array(self.sigmas())

    @property
    def error_radps(self) -> Floats:
        return np.array(self.errors())

    @property
    def error_sigma_radps(self) -> Floats:
        return np.array(self.error_sigmas())

    def means(self) -> list[float]:
        """``mean_radps`` as plain numbers, which are quicker where there are three."""
        return [axis.bias for axis in self._axes]

    def sigmas(self) -> list[float]:
        """``sigma_radps``."""
        return [axis.sigma() for axis in self._axes]

    def errors(self) -> list[float]:
        """``error_radps``."""
        return [axis.error() for axis in self._axes]

    def error_sigmas(self) -> list[float]:
        """``error_sigma_radps``."""
        return [axis.error_sigma() for axis in self._axes]

    @property
    def known(self) -> bool:
        """Whether all axes are known to ``KNOWN_RADPS``."""
        return max(self.sigmas()) <= KNOWN_RADPS

    def forget(self) -> None:
        """The bias may be any."""
        for axis in self._axes:
            axis.forget()
        self._against_s = 0.0

    def advance(self, dt_s: float, noise_radps: Three, measured: bool) -> None:
        """A new interval. ``noise_radps``: (3,), 1 sigma of w. ``measured``: whether there is a gyro's rate for it."""
        self._measured, self._dt_s = measured, dt_s
        for axis, noise in zip(self._axes, noise_radps, strict=True):
            axis.advance(dt_s, noise, measured)

    def doubt(self) -> None:
        """The gyro may be mistaken by anything over the present interval."""
        for axis in self._axes:
            axis.set_noise(_ANY_RADPS)

    def see_rest(self, rate_radps: Three, sigma_radps: float) -> bool:
        """The gyro's mean rate (3,) while the vehicle stands. False: it is an outlier, and not used."""
        axes = zip(self._axes, rate_radps, strict=True)
        return self._learn([axis.compare(1.0, 0.0, 0.0, rate, sigma_radps) for axis, rate in axes])

    def add_image_rotation(self, error_radps: Three, sigma_radps: Three) -> bool:
        """The gyro's rate less that of the whole picture, (3,), with its sigmas. False: an outlier, not used."""
        axes = zip(self._axes, error_radps, sigma_radps, strict=True)
        return self._learn([axis.compare(self._measured, 0.0, 1.0, error, sigma) for axis, error, sigma in axes])

    def see_flow(self, error_radps: Three, sigma_radps: Three, expansion_hz: float) -> bool:
        """The gyro's rate less that of the flow, (3,), with its sigmas. False: an outlier, not used.

        ``expansion_hz``: mean V/Z of what is seen; an error of O turns so much of itself into rotation.
        """
        for axis in self._axes:
            axis.set_flow(max(_FLOW_RADPS, _FOCUS_RAD * expansion_hz))
        axes = zip(self._axes, error_radps, sigma_radps, strict=True)
        return self._learn([axis.compare(self._measured, 1.0, 1.0, error, sigma) for axis, error, sigma in axes])

    def _learn(self, fits: Iterable[bool]) -> bool:
        """All axes learn, or none."""
        if not all(fits):
            self._against_s += self._dt_s
            if self._against_s > _REFUTED_S:
                self.forget()
            return False
        self._against_s = 0.0
        for axis in self._axes:
            axis.learn()
        return True
