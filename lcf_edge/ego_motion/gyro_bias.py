"""The gyro's bias: unknown until learnt, at rest and from the rotation in the images.

One Kalman filter per axis, with the states, all rad/s,

- b: the bias, a random walk (temperature);
- s: the flow's error of the rate, slowly changing (O and lens are not known exactly);
- w: the gyro's other error over the present interval, forgotten after it.

The gyro's mean rate over an interval is ω + b + w. Any other measurement of ω over that interval observes the
difference: b + w by the shift of the whole image, b + w + s by the flow, and b alone, over a longer time, at rest. No
clock, no I/O.
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
_ANY_RADPS = 3.0  # 1 sigma of an unknown rate
_REFUTED_S = 1.0  # of outliers without a break: then the bias was wrong


class GyroBias:
    """``mean_radps``, ``sigma_radps``: (3,), the bias. ``error_radps``, ``error_sigma_radps``: (3,), the
    gyro's whole error over the present interval."""

    def __init__(self) -> None:
        self._axes = [AxisBias(_FLOW_RADPS) for _ in range(3)]
        self._measured: Sequence[bool] = (True, True, True)
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
        """``mean_radps`` as plain numbers, which are faster for three."""
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
        """Whether all axes that the gyro measures are known to ``KNOWN_RADPS``."""
        axes = zip(self._axes, self._measured, strict=True)
        return all(axis.sigma() <= KNOWN_RADPS for axis, measured in axes if measured)

    def forget(self) -> None:
        """Forget the bias: it may have any value."""
        for axis in self._axes:
            axis.forget()
        self._against_s = 0.0

    def advance(self, dt_s: float, noise_radps: Three, measured: Sequence[bool]) -> None:
        """Begin a new interval. ``noise_radps``: (3,), 1 sigma of w. ``measured``: (3,), whether a gyro gives the rate.

        While none does, ``known`` is about the axes that one measured last.
        """
        self._dt_s = dt_s
        if any(measured):
            self._measured = measured
        for axis, noise, is_measured in zip(self._axes, noise_radps, measured, strict=True):
            axis.advance(dt_s, noise, is_measured)

    def doubt(self) -> None:
        """Let the gyro's error over the present interval be unknown."""
        for axis in self._axes:
            axis.set_noise(_ANY_RADPS)

    def see_rest(self, rate_radps: Three, sigma_radps: float) -> bool:
        """Take the gyro's mean rate (3,), rad/s, at rest. Return False for an outlier, not used."""
        axes = zip(self._axes, rate_radps, strict=True)
        return self._learn([axis.compare(1.0, 0.0, 0.0, rate, sigma_radps) for axis, rate in axes])

    def add_image_rotation(self, error_radps: Three, sigma_radps: Three) -> bool:
        """Take the gyro's rate less the whole image's, (3,), with its sigmas. Return False for an outlier, not used."""
        axes = zip(self._axes, error_radps, sigma_radps, strict=True)
        return self._learn([axis.compare(axis.measured, 0.0, 1.0, error, sigma) for axis, error, sigma in axes])

    def see_flow(self, error_radps: Three, sigma_radps: Three, expansion_hz: float) -> bool:
        """Take the gyro's rate less the flow's, (3,), with its sigmas. Return False for an outlier, not used.

        ``expansion_hz``: mean V/Z of the scene, the factor by which an error of O becomes one of the rate.
        """
        for axis in self._axes:
            axis.set_flow(max(_FLOW_RADPS, _FOCUS_RAD * expansion_hz))
        axes = zip(self._axes, error_radps, sigma_radps, strict=True)
        return self._learn([axis.compare(axis.measured, 1.0, 1.0, error, sigma) for axis, error, sigma in axes])

    def _learn(self, fits: Iterable[bool]) -> bool:
        """Update all axes, or none."""
        if not all(fits):
            self._against_s += self._dt_s
            if self._against_s > _REFUTED_S:
                self.forget()
            return False
        self._against_s = 0.0
        for axis in self._axes:
            axis.learn()
        return True
