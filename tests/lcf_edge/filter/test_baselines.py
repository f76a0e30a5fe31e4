"""What the displacement since a key frame implies, and small rotations on top of it."""

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.filter import baselines as lines
from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.flow import Homography, Pinhole, set_homography, warp

PINHOLE = Pinhole(480.0, 520.0, 310.0, 250.0)  # px that are not square
SLOT = 2

place = st.tuples(st.floats(20, 620), st.floats(20, 460))
axis = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda a: np.linalg.norm(a) > 0.1)


def rotation_of(vector: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return np.asarray(cv2.Rodrigues(vector)[0])


def turned(x: float, y: float, rotation: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Where a rotation takes a place, px."""
    h = Homography()
    set_homography(h, PINHOLE, np.ascontiguousarray(rotation)[None], 0)
    warp(h, x, y)
    return np.array([h.x, h.y])


def since(rotation: npt.NDArray[np.float64]) -> Baselines:
    """Baselines of which one has seen this rotation."""
    baselines = Baselines()
    camera = np.array([[PINHOLE.fx, 0, PINHOLE.cx], [0, PINHOLE.fy, PINHOLE.cy], [0, 0, 1]])
    np.asarray(baselines.h)[SLOT] = (camera @ rotation @ np.linalg.inv(camera)).ravel()
    return baselines


def then(baselines: Baselines, x: float, y: float) -> npt.NDArray[np.float64]:
    return np.array([lines.then_x(baselines, SLOT, x, y), lines.then_y(baselines, SLOT, x, y)])


@given(place, axis)
def test_a_place_then_is_derotated_to_now(at: tuple[float, float], about: tuple[float, float, float]) -> None:
    rotation = rotation_of(0.2 * np.array(about))
    assert then(since(rotation), *at) == pytest.approx(turned(*at, rotation), abs=1e-6)


@given(place, axis)
def test_a_small_turn_comes_on_top_of_the_rotation_since(
    at: tuple[float, float], about: tuple[float, float, float]
) -> None:
    before, small = rotation_of(np.array([0.03, -0.05, 0.02])), 1e-3 * np.array(about)
    baselines = since(before)
    lines.turn(baselines, SLOT, PINHOLE, *small.tolist())
    assert then(baselines, *at) == pytest.approx(turned(*at, rotation_of(small) @ before), abs=5e-3)


@given(place, st.integers(0, 2), st.floats(-3, 3))
def test_px_a_radian_are_those_of_the_exact_rotation(at: tuple[float, float], about: int, beta: float) -> None:
    small = 1e-6
    moved = (turned(*at, rotation_of(small * np.eye(3)[about])) - at) / small
    along = np.cos(beta), np.sin(beta)
    assert lines.turn_px(PINHOLE, about, *at, *along) == pytest.approx(float(moved @ along), abs=0.05)
