"""The motion that a simulated chip measures."""

from bisect import bisect_right
from collections.abc import Callable, Sequence

from drivers.samples import ImuSample

Vector = tuple[float, float, float]
Motion = Callable[[float], tuple[Vector, Vector]]
"""Seconds since power-on → gyro (rad/s) and accelerometer (m/s²) in the chip's axes."""


def replay(samples: Sequence[ImuSample]) -> Motion:
    """A recording from power-on: interpolated linearly, and held at the end."""
    begin_ns = samples[0].stamp_ns
    times_s = [(sample.stamp_ns - begin_ns) / 1e9 for sample in samples]

    def at(time_s: float) -> tuple[Vector, Vector]:
        after = bisect_right(times_s, time_s)
        if after == len(samples):
            return samples[-1].gyro, samples[-1].accel
        one, other = samples[after - 1], samples[after]
        share = (time_s - times_s[after - 1]) / (times_s[after] - times_s[after - 1])
        return _between(one.gyro, other.gyro, share), _between(one.accel, other.accel, share)

    return at


def _between(one: Vector, other: Vector, share: float) -> Vector:
    x, y, z = (a + share * (b - a) for a, b in zip(one, other, strict=True))
    return x, y, z
