"""Where what stands still goes: angles, flow lines, rotation, key frames."""

import math
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.filter import key_frames
from lcf_edge.filter.flow import Homography, Pinhole, line_distance, set_homography, warp, wrap
from lcf_edge.filter.inputs import KEYS
from lcf_edge.filter.key_frames import KeyFrames

PINHOLE = Pinhole(500.0, 480.0, 319.5, 239.5)
AHEAD = (0.0, 0.0, 1.0)
PI = math.pi

small = st.floats(-0.3, 0.3)
aside = st.floats(-1.0, 1.0)


def project(points_m: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(n, 3) → (n, 2) px."""
    middle, focal = np.array([PINHOLE.cx, PINHOLE.cy]), np.array([PINHOLE.fx, PINHOLE.fy])
    return np.asarray(middle + focal * points_m[:, :2] / points_m[:, 2:])


def warped(h: Homography, x: float, y: float) -> tuple[float, float]:
    """Where a homography takes a place, px."""
    warp(h, x, y)
    return h.x, h.y


# Angles


@given(st.floats(-50, 50))
def test_wrapped_angles_are_the_same_angle_within_half_a_turn(angle: float) -> None:
    wrapped = wrap(angle)
    assert -PI < wrapped <= PI
    turns = (wrapped - angle) / (2 * math.pi)
    assert turns == pytest.approx(round(turns), abs=1e-9)


@pytest.mark.parametrize("turns", range(-4, 5))
def test_half_a_turn_is_plus_pi(turns: int) -> None:
    assert abs(wrap(math.pi + 2 * math.pi * turns)) == pytest.approx(math.pi, abs=1e-6)
    assert (wrap(PI), wrap(-PI)) == (PI, PI)


# Flow lines


@given(st.floats(-3.1, 3.1), st.floats(-100, 100), st.floats(-100, 100))
def test_distance_from_the_line_is_what_is_across_it_to_the_right(beta: float, along: float, across: float) -> None:
    """y points down: to the right of a flow that goes right is down."""
    dx = along * math.cos(beta) - across * math.sin(beta)
    dy = along * math.sin(beta) + across * math.cos(beta)
    assert line_distance(dx, dy, math.cos(beta), math.sin(beta)) == pytest.approx(across, abs=1e-4)


@given(st.floats(0.01, 3.1), st.floats(-100, 100), st.floats(-100, 100))
def test_distance_from_the_line_is_the_papers(beta: float, dx: float, dy: float) -> None:
    """|-Δx + m·Δy| / √(1 + m²), m the slope against the vertical."""
    slope = 1 / math.tan(beta)
    expected = abs(-dx + slope * dy) / math.sqrt(1 + slope**2)
    assert abs(line_distance(dx, dy, math.cos(beta), math.sin(beta))) == pytest.approx(expected, abs=1e-6)


# Rotation


@given(st.tuples(small, small, small), st.lists(st.tuples(aside, aside), min_size=1, max_size=8))
def test_an_image_warped_by_h_is_the_projection_of_rotated_rays(
    axis: tuple[float, float, float], rays: list[tuple[float, float]]
) -> None:
    rotation = cv2.Rodrigues(np.array(axis))[0]
    points = np.array([(x, y, 1.0) for x, y in rays])
    before, after = project(points), project(points @ rotation.T)
    h = Homography()
    set_homography(h, PINHOLE, rotation[None], 0)
    assert np.array([warped(h, x, y) for x, y in before.tolist()]) == pytest.approx(after, abs=1e-6)


def test_a_homography_is_that_of_one_rotation_of_many() -> None:
    rotations = np.stack([cv2.Rodrigues(np.array([0.1 * i, -0.05, 0.02]))[0] for i in range(4)])
    h, alone = Homography(), Homography()
    for k, rotation in enumerate(rotations):
        set_homography(h, PINHOLE, rotations, k)
        set_homography(alone, PINHOLE, rotation[None], 0)
        assert warped(h, 100, 200) == warped(alone, 100, 200)


# Key frames


def shown(keys: KeyFrames, slot: int, points_m: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Where points of a key frame's axes are seen now."""
    return project(points_m @ np.asarray(keys.rotation)[slot].T - np.asarray(keys.displacement)[slot])


def advance(keys: KeyFrames, rotation: npt.NDArray[np.float64], way_m: float, dt_s: float) -> None:
    """Drive straight ahead."""
    key_frames.advance(keys, rotation[None], *AHEAD, way_m, dt_s)


@pytest.mark.parametrize("yaw_rate_radps", [0.0, 0.3, -0.5])
@pytest.mark.parametrize("speed_mps", [2.0, -1.0])
def test_what_stands_still_is_seen_where_its_key_frame_says(
    yaw_rate_radps: float, speed_mps: float, drive: Callable[..., Any], box: Callable[..., Any]
) -> None:
    way = drive(box((0.3, -0.2, 8), (4, 2, 3)), speed_mps=speed_mps, yaw_rate_radps=yaw_rate_radps, frames=20)
    keys = KeyFrames()
    marked: dict[int, int] = {}
    for seq, (_, motion) in enumerate(way):
        advance(keys, np.ascontiguousarray(motion.rotation), motion.speed_mps * motion.dt_s, motion.dt_s)
        for slot, key in marked.items():
            predicted = shown(keys, slot, way.in_camera(key))
            assert predicted == pytest.approx(project(way.in_camera(seq)), abs=0.1)
            assert keys.elapsed_s[slot] == pytest.approx((seq - key) / way.fps)
        if seq % 4 == 0:
            marked[key_frames.mark(keys)] = seq


def test_a_rotation_of_the_camera_alone_moves_nothing_nearer() -> None:
    keys = KeyFrames()
    slot = key_frames.mark(keys)
    rotation = cv2.Rodrigues(np.array([0.02, -0.1, 0.03]))[0]
    for _ in range(5):
        advance(keys, rotation, 0.0, 0.05)
    assert np.asarray(keys.displacement)[slot] == pytest.approx(np.zeros(3))
    assert np.asarray(keys.rotation)[slot] == pytest.approx(np.linalg.matrix_power(rotation, 5))


def test_a_correction_counts_as_if_the_gyro_had_measured_it() -> None:
    measured, missed = (cv2.Rodrigues(np.array(axis))[0] for axis in ((0, 0.05, 0), (0.01, -0.004, 0.006)))
    corrected, whole = KeyFrames(), KeyFrames()
    for keys in (corrected, whole):
        key_frames.mark(keys)
        advance(keys, measured, 0.2, 0.1)
        key_frames.mark(keys)
    advance(corrected, measured, 0.0, 0.1)
    key_frames.turn(corrected, missed[None])
    advance(whole, missed @ measured, 0.0, 0.1)
    assert np.asarray(corrected.rotation) == pytest.approx(np.asarray(whole.rotation))
    assert np.asarray(corrected.displacement) == pytest.approx(np.asarray(whole.displacement))


def test_uncertainties_of_rotation_add_as_independent_ones_since_each_key_frame() -> None:
    keys = KeyFrames()
    first = key_frames.mark(keys)
    key_frames.inflate(keys, 0.003, 0.05)
    second = key_frames.mark(keys)
    key_frames.inflate(keys, 0.004, 0.05)
    assert keys.sigma_rad[first] == pytest.approx(0.005)
    assert keys.sigma_rad[second] == pytest.approx(0.004)


def test_a_key_frame_takes_the_place_of_the_oldest() -> None:
    keys = KeyFrames()
    slots = [key_frames.mark(keys) for _ in range(KEYS + 1)]
    assert sorted(slots[:KEYS]) == list(range(KEYS))
    assert slots[KEYS] == slots[0]
    assert keys.number == KEYS + 1
