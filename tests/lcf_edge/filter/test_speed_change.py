"""1/Z of an object by how its looming changes with the vehicle's speed."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.config import Config
from lcf_edge.filter import LineCircleFilter, speed_change
from lcf_edge.filter.tables import ObjectTable
from lcf_edge.messages import ObjectClass

Drive = Callable[..., Any]
Landmarks = Callable[..., npt.NDArray[np.float64]]
TR_S = Config().filter.tr_s
DT_S, SIGMA_HZ = 0.05, 0.02


def watched(believed_m: float, ways: list[tuple[float, float, float]]) -> ObjectTable:
    """Watch one object; ``ways``: its range, m, its velocity and the vehicle's, m/s, of each frame."""
    objects = ObjectTable(1)
    columns = objects.columns
    objects.middle[0] = believed_m
    for range_m, forward_mps, speed_mps in ways:
        rate = (speed_mps - forward_mps) / range_m
        speed_change.observe(columns, 0, rate, SIGMA_HZ**2, speed_mps)
        objects.steady[0] *= 1 + rate * DT_S
        objects.inverse[0] *= 1 + rate * DT_S
    return objects


def braking(start_m: float, forward_mps: float, frames: int = 30) -> list[tuple[float, float, float]]:
    """A vehicle at 1.5 m/s for half a second, then braking by 1.5 m/s²."""
    ways, range_m = [], start_m
    for frame in range(frames):
        speed_mps = 1.5 - 1.5 * DT_S * max(frame - 10, 0)
        ways.append((range_m, forward_mps, speed_mps))
        range_m -= (speed_mps - forward_mps) * DT_S
    return ways


@pytest.mark.parametrize("believed", [0.6, 1.0, 1.6])
@pytest.mark.parametrize("forward_mps", [-1.0, 0.0, 0.5])
def test_braking_shows_the_range_whatever_the_velocity(forward_mps: float, believed: float) -> None:
    ways = braking(6.0, forward_mps)
    objects = watched(believed * 6.0, ways)
    truth = 1 / (ways[-1][0] - (ways[-1][2] - forward_mps) * DT_S)
    assert objects.inverse[0] == pytest.approx(truth, rel=0.3)
    assert objects.inverse_var[0] ** 0.5 < 0.6 * objects.inverse[0]


def test_at_a_steady_speed_it_stays_as_uncertain_as_it_was() -> None:
    objects = watched(3.0, [(6.0 - 0.05 * frame, 0.0, 1.0) for frame in range(30)])
    assert objects.inverse_var[0] ** 0.5 > 0.7 * objects.inverse[0]


def test_who_changes_his_own_velocity_at_once_shows_nothing() -> None:
    """Somebody ahead stops while the vehicle brakes: that makes him loom, and does not tell how far he is."""
    ways = braking(4.0, 1.4, 14)
    stopped = [(ways[-1][0] - 0.05 * frame, 0.0, ways[-1][2] - 0.05 * frame) for frame in range(1, 6)]
    before, after = watched(4.0, ways), watched(4.0, ways + stopped)
    assert after.inverse[0] > 0.8 * before.inverse[0]


@given(
    believed_m=st.floats(0.3, 100), start_m=st.floats(4.0, 60), forward_mps=st.floats(-4, 4), sudden=st.floats(-3, 3)
)
def test_it_stays_positive_and_bounded(believed_m: float, start_m: float, forward_mps: float, sudden: float) -> None:
    ways = braking(start_m, forward_mps, 20)
    objects = watched(believed_m, [*ways, *((z, w + sudden, v) for z, w, v in ways[-5:])])
    assert 0 < objects.inverse[0] < np.inf
    assert 0 < objects.inverse_var[0] < np.inf
    assert objects.steady_inverse[0] ** 2 <= objects.steady_var[0] * objects.inverse_var[0] * (1 + 1e-9)


def test_without_a_speed_it_is_unknown() -> None:
    objects = watched(4.0, braking(6.0, 0.0))
    speed_change.observe(objects.columns, 0, 0.5, SIGMA_HZ**2, np.nan)
    assert objects.inverse[0] == 0


def test_who_comes_towards_a_vehicle_that_brakes_does_not_stand(
    drive: Drive, box: Landmarks, clutter: Landmarks
) -> None:
    """His feet are not seen. By the old speed he might stand at half the range; by the new one, at a tenth."""
    way = drive(clutter(150)) + drive(box((0.05, -0.7, 6.0), (0.4, 0.8, 0.1), landmarks=60), np.array([0, 0, -1.0]))
    tables, range_m = LineCircleFilter(Config(), way.lens), 6.0
    for speed_mps in [*np.full(20, 1.0), *np.linspace(1.0, 0.1, 14), *np.full(18, 0.1)]:
        step = replace(way, frames=2, speed_mps=float(speed_mps))
        tables.step(*list(step)[1])
        way, range_m = replace(way, points_m=step.in_camera(1)), range_m - (speed_mps + 1.0) * DT_S
    objects = tables.objects
    (row,) = np.flatnonzero(objects.active & (objects.trust >= TR_S))
    assert objects.class_id[row] == ObjectClass.ONCOMING
    assert objects.ttc[row] == pytest.approx(range_m / 1.1, rel=0.2)
    assert objects.range[row] == pytest.approx(range_m, rel=0.5)
