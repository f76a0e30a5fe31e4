"""Measures an object's range by how its looming changes as the vehicle brakes or accelerates: dm = dV/Z.

That needs no ground and no size, and holds for whatever keeps its own velocity: somebody who comes towards a vehicle
that brakes looms on, unlike anything stationary. A Kalman filter of its own tracks m, at the V at which it was
measured, and 1/Z; a sudden change of the object's own velocity starts it again with m, not with 1/Z.
"""

import math

from lcf_edge.filter.columns import ObjectColumns

STEADY_MPS = 0.6  # 1 sigma of the change of an object's velocity in one second
SUDDEN_SIGMAS = 3.0  # an innovation above this is a sudden change of it
FIRST_SHARE = 1.0  # 1 sigma of 1/Z at first, as a share,
LEAST_SHARE = 0.25  # and its least, since things are deep


def forget(objects: ObjectColumns, o: int) -> None:
    """Reset an object's 1/Z to unknown."""
    objects.inverse[o] = objects.inverse_var[o] = 0.0
    objects.steady[o] = objects.steady_var[o] = objects.steady_inverse[o] = 0.0


def predict(objects: ObjectColumns, o: int, growth: float, dt_s: float) -> None:
    """Propagate m and 1/Z, which grow as the object comes nearer."""
    squared = growth * growth
    objects.steady[o] *= growth
    objects.inverse[o] *= growth
    wander = STEADY_MPS * objects.inverse[o]
    objects.steady_var[o] = squared * objects.steady_var[o] + wander * wander * dt_s
    objects.steady_inverse[o] *= squared
    objects.inverse_var[o] *= squared


def begin(objects: ObjectColumns, o: int, rate: float, variance: float, speed_mps: float) -> None:
    """Start with m as measured, in no relation to 1/Z."""
    objects.steady[o], objects.steady_var[o], objects.steady_inverse[o] = rate, variance, 0.0
    objects.steady_speed[o] = speed_mps


def observe(objects: ObjectColumns, o: int, rate: float, variance: float, speed_mps: float) -> None:
    """Kalman update by m = ``rate`` 1/s, measured at V = ``speed_mps``; 1/Z starts with the range believed so far."""
    if not math.isfinite(speed_mps):
        forget(objects, o)
        return
    if not objects.inverse[o] > 0:
        if not objects.middle[o] > 0:
            return
        objects.inverse[o] = 1 / objects.middle[o]
        first = FIRST_SHARE * objects.inverse[o]
        objects.inverse_var[o] = first * first
        begin(objects, o, rate, variance, speed_mps)
        return
    gained_mps = speed_mps - objects.steady_speed[o]
    objects.steady_speed[o] = speed_mps
    objects.steady[o] += gained_mps * objects.inverse[o]
    objects.steady_var[o] += gained_mps * (2 * objects.steady_inverse[o] + gained_mps * objects.inverse_var[o])
    objects.steady_inverse[o] += gained_mps * objects.inverse_var[o]
    news, total = rate - objects.steady[o], objects.steady_var[o] + variance
    if news * news > SUDDEN_SIGMAS * SUDDEN_SIGMAS * total:
        begin(objects, o, rate, variance, speed_mps)
        return
    gain, gain_inverse = objects.steady_var[o] / total, objects.steady_inverse[o] / total
    least = LEAST_SHARE * objects.inverse[o]
    objects.inverse[o] = max(objects.inverse[o] + gain_inverse * news, least)
    objects.inverse_var[o] = max(objects.inverse_var[o] - gain_inverse * objects.steady_inverse[o], least * least)
    objects.steady[o] += gain * news
    objects.steady_inverse[o] -= gain * objects.steady_inverse[o]
    objects.steady_var[o] -= gain * objects.steady_var[o]
