"""How the camera is mounted and how far ahead of the axle: learnt while driving, with what stays uncertain of it."""

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
    mounted, fit = Heading(Camera(), around.half_width_m), FlowFit()
    heading.turn_aside(mounted, around.speed_mps, around.yaw_rate_radps)
    fit.prior_x = fit.prior_y = 500 * heading.focus_sigma_rad(UNKNOWN_RAD)
    fit.focus_sigma_x = fit.focus_sigma_y = sigma_px
    fit.focus_x = fit.focus_y = shift_px
    heading.learn_mounting(mounted, around, fit)
    return mounted


def test_in_a_turn_yaw_is_learnt_slowly_until_it_is_known_how_far_the_camera_sits_before_the_axle(
    situation: Situation,
) -> None:
    straight, turning = after(situation()), after(situation(yaw_rate_radps=0.9))
    assert 0 < turning.mounted_x < 0.8 * straight.mounted_x
    assert turning.sigma_x > straight.sigma_x
    assert (turning.mounted_y, turning.sigma_y) == (straight.mounted_y, straight.sigma_y)


@pytest.mark.parametrize(
    "way",
    [
        pytest.param({"speed_mps": math.nan, "yaw_rate_radps": 0.45}, id="speed unknown"),
        pytest.param({"speed_mps": 0.2, "yaw_rate_radps": 1.5}, id="on the spot"),
    ],
)
def test_a_turn_at_an_unknown_speed_or_on_the_spot_teaches_nothing_to_the_side(
    situation: Situation, way: dict[str, float]
) -> None:
    turning = after(situation(**way))
    assert (turning.mounted_x, turning.lever_m) == (0.0, 0.0)
    assert turning.sigma_x == pytest.approx(UNKNOWN_RAD, rel=1e-3)


def test_straight_ahead_yaw_is_learnt_at_an_unknown_speed_too(situation: Situation) -> None:
    assert after(situation(speed_mps=math.nan)).mounted_x > 0


@pytest.mark.parametrize("yaw_rate_radps", [0.8, -0.8])
@pytest.mark.parametrize(("ahead_m", "configured_m"), [(0.4, 0.0), (0.0, 0.4), (0.4, 0.4)])
def test_how_far_the_camera_sits_before_the_axle_is_learnt_in_a_turn(
    drive: Drive, yaw_rate_radps: float, ahead_m: float, configured_m: float
) -> None:
    """Seven seconds around among landmarks on all sides."""
    random, n = np.random.default_rng(5), 2500
    around_m, direction = random.uniform(2.0, 14.0, n), random.uniform(0, 2 * np.pi, n)
    down_m = random.uniform(-1.5, 0.3, n)
    points = np.stack([around_m * np.sin(direction), down_m, around_m * np.cos(direction)], axis=1)
    turn = drive(points, frames=140, speed_mps=1.0, yaw_rate_radps=yaw_rate_radps, camera_ahead_m=ahead_m)
    seen = learnt(turn, ahead_m=configured_m)
    assert seen[0].ahead_m == pytest.approx(configured_m, abs=0.05)
    assert seen[-1].ahead_m == pytest.approx(ahead_m, abs=0.1)
    assert seen[-1].ahead_sigma_m < 0.3 * seen[0].ahead_sigma_m


def test_a_straight_drive_teaches_nothing_of_the_lever_arm(avenue: Any) -> None:
    (first, *_, last) = learnt(avenue)
    assert last.ahead_m == pytest.approx(0.0, abs=0.02)
    assert last.ahead_sigma_m == pytest.approx(first.ahead_sigma_m, rel=0.05)


def test_in_a_left_turn_a_camera_before_the_axle_goes_to_the_left() -> None:
    mounted = Heading(Camera(ahead_m=0.5), 0.3)
    heading.turn_aside(mounted, 1.0, 0.4)
    left = mounted.aside_x
    assert -0.5 * 0.4 < left < -0.5 * 0.3
    heading.turn_aside(mounted, 1.0, -0.4)
    assert mounted.aside_x == -left
    heading.turn_aside(mounted, -1.0, 0.4)  # backwards, its line leads to the other side
    assert mounted.aside_x == -left


def test_a_fit_that_shows_nothing_teaches_nothing(situation: Situation) -> None:
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


@given(st.floats(1e-4, 0.05), st.floats(1e-4, 0.3), st.floats(0.01, 1))
def test_the_gain_is_a_share_and_less_with_more_doubt(mounting_rad: float, sigma_rad: float, dt_s: float) -> None:
    def gain(doubt_rad: float) -> npt.NDArray[np.float64]:
        noise = heading.fit_noise(0.31, doubt_rad, dt_s)
        return np.float64(heading.mounting_gain(mounting_rad, noise))

    assert 0 <= gain(sigma_rad + 0.01) <= gain(sigma_rad) < 1
