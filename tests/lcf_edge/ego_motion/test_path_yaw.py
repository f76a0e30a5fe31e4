"""The yaw rate of the path: without the camera's shaking, and quick in turns."""

import math
from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.ego_motion.path_yaw import PathYaw

HUNDRED_DEGREES_PER_S = math.radians(100)
FPS = pytest.mark.parametrize("fps", [15, 20, 60])


def followed(rates_radps: Iterable[float], fps: float) -> list[float]:
    """The rate of the path in each interval of a camera that turns at these."""
    path, answer = PathYaw(), []
    for rate in rates_radps:
        path.advance(1 / fps)
        path.see_camera(rate)
        answer.append(path.rate_radps)
    return answer


@FPS
@pytest.mark.parametrize("hz", [5.0, 7.0, 12.0])
def test_a_camera_that_shakes_does_not_turn_the_path(fps: float, hz: float) -> None:
    angle = 0.01 * np.sin(2 * np.pi * hz * np.arange(4 * fps) / fps + 1.0)  # rad
    rates = np.diff(angle) * fps
    assert np.std(followed(rates, fps)) < 0.5 * np.std(rates)


@FPS
def test_a_turn_is_followed_within_a_tenth_of_a_second(fps: float) -> None:
    straight, turn = [0.0] * fps, [HUNDRED_DEGREES_PER_S] * fps
    rates = followed([*straight, *turn], fps)
    assert rates[: len(straight)] == straight
    assert rates[len(straight) + math.ceil(0.1 * fps)] == pytest.approx(HUNDRED_DEGREES_PER_S, rel=0.05)


@FPS
def test_a_shaking_camera_turns_with_the_vehicle_all_the_same(fps: float) -> None:
    angle = 0.003 * np.sin(2 * np.pi * 7.0 * np.arange(2 * fps + 1) / fps)  # rad
    turn = np.repeat([0.0, HUNDRED_DEGREES_PER_S], fps)
    rates = np.array(followed(turn + np.diff(angle) * fps, fps))
    assert np.mean(rates[fps + math.ceil(0.3 * fps) :]) == pytest.approx(HUNDRED_DEGREES_PER_S, rel=0.1)


def test_of_several_values_for_one_interval_the_last_counts() -> None:
    once, twice = PathYaw(), PathYaw()
    for path in (once, twice):
        path.advance(0.05)
        path.see_camera(0.3)
        path.advance(0.05)
    twice.see_camera(-2.0)
    for path in (once, twice):
        path.see_camera(0.5)
    assert once.rate_radps == twice.rate_radps


def test_odometry_gives_the_rate_as_it_is_and_the_camera_goes_on_from_there() -> None:
    path = PathYaw()
    path.advance(0.05)
    path.see_odometry(0.7)
    assert path.rate_radps == 0.7
    path.advance(0.05)
    path.see_camera(0.7)
    assert path.rate_radps == 0.7


@given(st.lists(st.floats(-5, 5), min_size=1, max_size=40), st.floats(1e-3, 2))
def test_the_path_never_turns_faster_than_the_camera_did(rates: list[float], dt_s: float) -> None:
    fastest = max(map(abs, rates))
    assert all(abs(rate) <= fastest * (1 + 1e-9) for rate in followed(rates, 1 / dt_s))


def test_intervals_of_no_length_change_nothing() -> None:
    path = PathYaw()
    path.advance(0.0)
    path.see_camera(3.0)
    assert path.rate_radps == 0.0
