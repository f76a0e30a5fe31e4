"""How the camera is mounted: learnt while driving, slowly, and with what stays uncertain of it."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.config import Camera, Config
from lcf_edge.filter import LineCircleFilter, heading
from lcf_edge.filter.flow_fit import FlowFit
from lcf_edge.filter.heading import Heading

TWO_DEGREES = math.radians(2)
UNKNOWN_RAD = 0.05  # 1 sigma before anything was seen

Drive = Callable[..., Any]
Situation = Callable[..., Any]


@pytest.fixture(scope="session")
def avenue(drive: Drive) -> Any:
    """Ten seconds among landmarks left, right and on the ground; the camera looks straight ahead."""
    random, n = np.random.default_rng(4), 900
    side = random.choice([-1.0, 1.0], n)
    x, y, z = random.uniform([1.0, -1.5, 2.0], [5.0, 0.3, 34.0], (n, 3)).T
    return drive(np.stack([side * x, y, z], axis=1), frames=200)


def learnt(way: Any, **camera: float) -> list[Any]:
    """The mounting after each step, with a camera configured so."""
    tables = LineCircleFilter(Config(camera=Camera(**camera)), way.lens)  # type: ignore[arg-type]
    seen = []
    for corners, motion in way:
        tables.step(corners, motion)
        seen.append(tables.mounting)
    return seen


@pytest.mark.parametrize("key", ["pitch_rad", "yaw_rad"])
@pytest.mark.parametrize("wrong_rad", [TWO_DEGREES, -TWO_DEGREES])
def test_a_mounting_that_is_wrong_by_two_degrees_is_right_after_ten_seconds(
    avenue: Any, key: str, wrong_rad: float
) -> None:
    seen = learnt(avenue, **{key: wrong_rad})
    first, last = seen[0], seen[-1]
    assert getattr(first, key) == pytest.approx(wrong_rad, abs=math.radians(0.1))
    assert abs(getattr(last, key)) < math.radians(0.5)


@pytest.mark.parametrize("sigma", ["pitch_sigma_rad", "yaw_sigma_rad"])
def test_the_more_is_seen_the_surer_it_is(avenue: Any, sigma: str) -> None:
    sigmas = [getattr(mounting, sigma) for mounting in learnt(avenue)]
    assert sigmas[0] == pytest.approx(UNKNOWN_RAD)
    assert sigmas[20] > sigmas[60] > sigmas[-1]
    assert sigmas[-1] < 0.2 * UNKNOWN_RAD


def test_a_mounting_that_is_right_stays(avenue: Any) -> None:
    """Nearer than what `doctor` warns of."""
    for mounting in learnt(avenue):
        assert abs(mounting.pitch_rad) < math.radians(1)
        assert abs(mounting.yaw_rad) < math.radians(1)


def test_at_rest_nothing_is_learnt(avenue: Any) -> None:
    (first, *_, last) = learnt(replace(avenue, speed_mps=0.0, frames=40), pitch_rad=TWO_DEGREES)
    assert last.pitch_rad == pytest.approx(first.pitch_rad, abs=1e-3)
    assert last.pitch_sigma_rad == pytest.approx(UNKNOWN_RAD, rel=0.05)


def after(around: Any, *, shift_px: float = 10.0, sigma_px: float = 2.0) -> Heading:
    """What one fit makes of a fresh mounting: O lies so far to the right and below."""
    mounted, fit = Heading(Camera()), FlowFit()
    fit.prior_x = fit.prior_y = 500 * heading.focus_sigma_rad(UNKNOWN_RAD)
    fit.focus_sigma_x = fit.focus_sigma_y = sigma_px
    fit.focus_x = fit.focus_y = shift_px
    heading.learn_mounting(mounted, around, fit)
    return mounted


def test_in_a_turn_yaw_is_learnt_slowly_since_nobody_knows_how_far_the_camera_sits_before_the_axle(
    situation: Situation,
) -> None:
    straight, turning = after(situation()), after(situation(yaw_rate_radps=0.45))
    assert 0 < turning.mounted_x < 0.5 * straight.mounted_x
    assert turning.sigma_x > straight.sigma_x
    assert (turning.mounted_y, turning.sigma_y) == (straight.mounted_y, straight.sigma_y)


def test_an_unknown_speed_in_a_turn_is_no_more_than_a_doubt(situation: Situation) -> None:
    turning = after(situation(speed_mps=math.nan, yaw_rate_radps=0.45))
    assert math.isfinite(turning.mounted_x)
    assert turning.sigma_x <= UNKNOWN_RAD * 1.001


def test_a_fit_that_tells_nothing_teaches_nothing(situation: Situation) -> None:
    prior_px = 500 * heading.focus_sigma_rad(UNKNOWN_RAD)
    mounted = after(situation(), sigma_px=prior_px)
    assert (mounted.mounted_x, mounted.mounted_y) == (0.0, 0.0)
    assert mounted.sigma_x == pytest.approx(UNKNOWN_RAD, rel=1e-3)


def test_without_fits_it_drifts() -> None:
    assert heading.drifted(0.01, 0.0, 100.0) > 0.01


@given(st.floats(-50, 50), st.floats(0.1, 40))
def test_one_fit_never_asks_for_more_than_a_few_sigmas(shift_px: float, sigma_px: float) -> None:
    prior_rad = 0.05
    asked = heading.unpulled(shift_px / 500, prior_rad, sigma_px / 500)
    assert abs(asked) <= 3 * prior_rad
    assert asked * shift_px >= 0


@given(st.floats(1e-4, 0.05), st.floats(1e-4, 0.2), st.floats(0, 0.3), st.floats(0.01, 1))
def test_the_gain_is_a_share_and_less_with_more_doubt(
    mounting_rad: float, sigma_rad: float, aside_rad: float, dt_s: float
) -> None:
    def gain(aside: float) -> npt.NDArray[np.float64]:
        return np.float64(heading.mounting_gain(mounting_rad, 0.21, sigma_rad, aside, dt_s))

    assert 0 <= gain(aside_rad + 0.01) <= gain(aside_rad) < 1
