"""Where the vehicle heads: shaking turns the camera, a turn of the vehicle both."""

import math
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest

from lcf_edge.config import Camera, Config
from lcf_edge.filter import Motion
from lcf_edge.filter.flow import Pinhole
from lcf_edge.filter.heading import Heading, turn_heading
from lcf_edge.filter.situation import Situation, follow, ground_inverse, ground_range_m

PINHOLE = Pinhole(500.0, 500.0, 319.5, 239.5)


class Ahead:
    """A heading, and the focus that it implies."""

    def __init__(self, **camera: float) -> None:
        self.heading = Heading(Camera(**camera), 0.3)  # type: ignore[arg-type]
        self._around = Situation(Config(), PINHOLE)

    def turn(self, moved: Motion) -> None:
        turn_heading(self.heading, moved.rotation[None], moved.path_yaw_rate_radps, moved.dt_s)

    @property
    def focus(self) -> tuple[float, float]:
        follow(self._around, self.heading.ray_x, self.heading.ray_y, 2.0, 0.0, 0.05)
        return self._around.focus_x, self._around.focus_y


def motion(axis: tuple[float, float, float], yaw_rate_radps: float = 0.0, dt_s: float = 0.05) -> Motion:
    return Motion(dt_s, cv2.Rodrigues(np.array(axis))[0], 0.0, 2.0, yaw_rate_radps)


def test_a_camera_that_looks_along_the_path_has_its_focus_at_the_principal_point() -> None:
    assert Ahead().focus == pytest.approx((319.5, 239.5))


def test_a_camera_that_looks_up_or_right_sees_the_focus_below_or_left() -> None:
    x, y = Ahead(pitch_rad=0.1, yaw_rad=0.2).focus
    assert (x, y) == pytest.approx((319.5 - 500 * math.tan(0.2), 239.5 + 500 * math.tan(0.1)))


def test_a_turn_of_the_vehicle_leaves_the_focus_where_it_is() -> None:
    """A left turn moves the image right, and with it nothing that drives."""
    ahead = Ahead()
    for _ in range(40):
        ahead.turn(motion((0.0, 0.4 * 0.05, 0.0), yaw_rate_radps=0.4))
    assert ahead.focus == pytest.approx((319.5, 239.5), abs=0.1)


@pytest.mark.parametrize(("axis", "shift"), [((0.02, 0, 0), (0, -10)), ((0, 0.02, 0), (10, 0))])
def test_a_shake_moves_the_focus_with_the_image(axis: tuple[float, float, float], shift: tuple[float, float]) -> None:
    ahead = Ahead()
    ahead.turn(motion(axis))
    assert np.array(ahead.focus) - (319.5, 239.5) == pytest.approx(shift, abs=2)


def test_the_mounting_prevails_in_the_long_run() -> None:
    ahead = Ahead(pitch_rad=0.05)
    mounted = ahead.focus
    ahead.turn(motion((0.03, 0.03, 0.0)))
    assert np.abs(np.array(ahead.focus) - mounted).max() > 5
    for _ in range(200):
        ahead.turn(motion((0.0, 0.0, 0.0)))
    assert ahead.focus == pytest.approx(mounted, abs=0.1)


def test_a_turn_that_lasts_is_told_from_a_swerve() -> None:
    around = Situation(Config(), PINHOLE)
    for yaw_rate_radps, seconds, lasting in ((0.3, 0.1, 0.3), (0.0, 3.0, 0.0), (0.3, 0.1, 0.09), (0.3, 3.0, 0.3)):
        for _ in range(round(seconds / 0.05)):
            follow(around, 0.0, 0.0, 2.0, yaw_rate_radps, 0.05)
        assert around.lasting_yaw_radps == pytest.approx(lasting, abs=0.02)


@pytest.mark.parametrize("range_m", [0.6, 2.0, 8.0])
def test_the_ground_is_seen_at_its_range(range_m: float, situation: Callable[..., Any]) -> None:
    around = situation(camera_height_m=0.3)
    row = around.horizon_y + 500 * 0.3 / range_m
    assert ground_range_m(around, row) == pytest.approx(range_m, rel=1e-4)


def test_no_ground_is_seen_at_the_horizon_or_from_an_unknown_height(situation: Callable[..., Any]) -> None:
    known, unknown = situation(camera_height_m=0.3), situation(camera_height_m=0.0)
    for row in (0, 239, 240, 241):
        assert math.isnan(ground_range_m(known, row))
        assert math.isnan(ground_range_m(unknown, row + 200))


@pytest.mark.parametrize("range_m", [0.6, 2.0, 8.0])
def test_the_inverse_range_of_the_ground_is_that_of_its_range(range_m: float, situation: Callable[..., Any]) -> None:
    around = situation(camera_height_m=0.3)
    row = around.horizon_y + 500 * 0.3 / range_m
    assert ground_inverse(around, row) == pytest.approx(1 / ground_range_m(around, row), rel=1e-12)


def test_the_inverse_range_of_the_ground_falls_to_0_at_the_horizon(situation: Callable[..., Any]) -> None:
    around = situation(camera_height_m=0.3)
    rows = [around.horizon_y + below for below in (4, 1, 0.25, 0, -100)]
    assert [ground_inverse(around, row) for row in rows] == pytest.approx([4 / 150, 1 / 150, 1 / 600, 0, 0])
