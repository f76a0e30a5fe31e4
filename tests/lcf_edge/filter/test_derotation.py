"""Step 0: the rotation is taken out of everything; what the gyro missed, the flow shows."""

import math
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.config import Filter
from lcf_edge.filter import derotation, flow, matching
from lcf_edge.filter.derotation import OffLine
from lcf_edge.filter.flow import Homography, Pinhole, line_distance, set_homography
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.line_circle_filter import Residual
from lcf_edge.filter.matching import CornerIndex
from lcf_edge.filter.memory import memory_of
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.tables import CircleTable, CornerTable, EdgeTable, PsiTable
from lcf_edge.lens import Lens

PINHOLE = Pinhole(500.0, 500.0, 319.5, 239.5)
SIGMA_RAD = 0.01
SETTINGS = Settings(Filter(), PINHOLE)

Vector = tuple[float, float, float]

angle = st.floats(-0.006, 0.006)


def rotation_of(axis: tuple[float, float, float]) -> npt.NDArray[np.float64]:
    return np.asarray(cv2.Rodrigues(np.array(axis))[0])


def homography(rotation: npt.NDArray[np.float64]) -> Homography:
    h = Homography()
    set_homography(h, PINHOLE, np.ascontiguousarray(rotation)[None], 0)
    return h


def warp(rotation: npt.NDArray[np.float64], x: npt.NDArray[Any], y: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """(2, n) places after a rotation."""
    h, places = homography(rotation), []
    for place in zip(x.tolist(), y.tolist(), strict=True):
        flow.warp(h, *place)
        places.append((h.x, h.y))
    return np.array(places).T


def derotate(
    rotation: npt.NDArray[np.float64], edges: EdgeTable, circles: tuple[CircleTable, ...], psi: PsiTable
) -> None:
    h, roll = homography(rotation), math.atan2(rotation[1, 0], rotation[0, 0])
    derotation.derotate_edges(edges.columns, h, roll)
    for table in circles:
        derotation.derotate_circles(table.columns, h, roll)
    derotation.derotate_psi(psi.columns, h)


def spread(number: int, seed: int = 0) -> npt.NDArray[np.float32]:
    """(2, n) places in the image."""
    return np.random.default_rng(seed).uniform([[10], [10]], [[630], [470]], (2, number)).astype(np.float32)


# Everything stored


def test_every_stored_position_is_warped() -> None:
    edges, circles, psi = EdgeTable(20, 10, 10), (CircleTable(5), CircleTable(3)), PsiTable(4)
    edges.append(20)
    edges.rebel[:20:2], edges.suspect_keys[1:20:4] = True, 1  # the origin of others means nothing
    before = spread(20)
    edges.x[:20], edges.y[:20] = before
    edges.origin_x[:20], edges.origin_y[:20] = before[::-1]
    for table in (*circles, psi):
        table.x[:], table.y[:] = before[:, : table.capacity]
        table.active[:] = True
    rotation = rotation_of((0.0, 0.0, 0.1)) @ rotation_of((0.01, -0.02, 0.0))
    derotate(rotation, edges, circles, psi)

    after = warp(rotation, *before)
    assert np.allclose([edges.x[:20], edges.y[:20]], after, atol=1e-3)
    origins = warp(rotation, *before[::-1])
    own_way = edges.own_way()
    assert np.count_nonzero(own_way) == 15
    assert np.allclose(np.stack([edges.origin_x[:20], edges.origin_y[:20]])[:, own_way], origins[:, own_way], atol=1e-3)
    for table in (*circles, psi):
        assert np.allclose([table.x, table.y], after[:, : table.capacity], atol=1e-3)


@pytest.mark.parametrize(
    ("axis", "roll"),
    [
        ((0, 0, 0.1), 0.1),
        ((0, 0, -0.3), -0.3),
        ((0.04, 0, 0), 0),
        ((0, 0.04, 0), 0),
    ],
)
def test_own_directions_turn_with_a_roll_and_with_nothing_else(axis: tuple[float, float, float], roll: float) -> None:
    """As the middle of the image does."""
    edges, circles = EdgeTable(4, 2, 2), (CircleTable(3), CircleTable(3))
    edges.append(4)
    edges.beta[:4], edges.rebel[:2], edges.suspect_keys[2:4] = 0.5, True, 1
    for table in circles:
        table.beta[:] = -1.0
        table.active[:] = True
    derotate(rotation_of(axis), edges, circles, PsiTable(2))
    assert edges.beta[:4] == pytest.approx(0.5 + roll, abs=2e-3)
    for table in circles:
        assert table.beta == pytest.approx(-1.0 + roll, abs=2e-3)


# What the gyro missed


Edges = tuple[EdgeTable, CornerTable]


def off_the_lines(missed: npt.NDArray[np.float64], outliers: float, number: int = 200, seed: int = 0) -> Edges:
    """Trusted edges predicted anywhere on their lines, and their corners where ``missed`` puts them."""
    random = np.random.default_rng(seed)
    edges, corners = EdgeTable(number, 1, 1), CornerTable(number)
    edges.append(number)
    x, y = spread(number, seed)
    beta = np.arctan2(y - PINHOLE.cy, x - PINHOLE.cx)
    along = random.uniform(-6, 6, number)  # the depth is not known
    seen = warp(missed, x + along * np.cos(beta), y + along * np.sin(beta))
    noise = random.normal(0, 0.4, (2, number))
    odd = random.random(number) < outliers
    noise[:, odd] += random.choice([-1, 1], (2, np.count_nonzero(odd))) * random.uniform(8, 30)
    corners.x[:], corners.y[:] = seen + noise
    corners.columns.count = number
    edges.predicted_x[:number], edges.predicted_y[:number] = x, y
    edges.cos[:number], edges.sin[:number] = np.cos(beta), np.sin(beta)
    edges.trust[:number], edges.corner[:number] = SETTINGS.tr_max, np.arange(number)
    return edges, corners


def missing_rotation(
    edges: EdgeTable, corners: CornerTable, sigma_rad: float
) -> tuple[npt.NDArray[np.float64], float, Residual]:
    """The rotation that the gyro missed, (3, 3), what stays uncertain of it, and what the flow shows by itself."""
    off = OffLine()
    for row in range(edges.count):
        derotation.off_line(off, edges.columns, row, corners.columns, PINHOLE)
    derotation.missing_rotation(off, PINHOLE.focal, sigma_rad)
    alone = Residual(np.array(off.alone), np.array(off.alone_sigma))
    return np.eye(3) + np.cross(np.eye(3), [off.turn_x, off.turn_y, off.turn_z]), off.sigma, alone


@given(st.tuples(angle, angle, angle), st.integers(0, 1000))
def test_a_small_rotation_is_recovered_although_a_third_moves(axis: tuple[float, float, float], seed: int) -> None:
    missed = rotation_of(axis)
    found, sigma_rad, _ = missing_rotation(*off_the_lines(missed, 0.3, seed=seed), SIGMA_RAD)
    assert found == pytest.approx(missed, abs=1.2e-3)
    assert 0 < sigma_rad < 0.1 * SIGMA_RAD


def test_edges_on_their_lines_ask_for_no_rotation() -> None:
    found, _, alone = missing_rotation(*off_the_lines(np.eye(3), 0.0), SIGMA_RAD)
    assert found == pytest.approx(np.eye(3), abs=2e-4)
    assert alone.turn_rad == pytest.approx(np.zeros(3), abs=4e-4)


@given(st.tuples(angle, angle, angle), st.integers(0, 1000))
def test_what_the_flow_shows_by_itself_is_free_of_the_gyro(axis: tuple[float, float, float], seed: int) -> None:
    missed = rotation_of(axis)
    _, _, alone = missing_rotation(*off_the_lines(missed, 0.1, seed=seed), SIGMA_RAD)
    off_rad = alone.turn_rad - cv2.Rodrigues(missed)[0].ravel()
    assert (np.abs(off_rad) < 4 * alone.sigma_rad).all()
    assert (alone.sigma_rad > 0).all()
    assert (alone.sigma_rad < 0.01).all()


def test_edges_that_scatter_make_it_uncertain() -> None:
    neat, wild = (missing_rotation(*off_the_lines(np.eye(3), n), SIGMA_RAD)[2] for n in (0.0, 0.7))
    assert (wild.sigma_rad > 2 * neat.sigma_rad).all()


def test_a_gyro_that_is_sure_is_believed() -> None:
    found, sigma_rad, _ = missing_rotation(*off_the_lines(rotation_of((0.004, 0.004, 0.0)), 0.0), 1e-6)
    assert found == pytest.approx(np.eye(3), abs=1e-5)
    assert sigma_rad == pytest.approx(1e-6, rel=0.1)


def test_more_edges_leave_less_uncertain() -> None:
    sigmas = [missing_rotation(*off_the_lines(np.eye(3), 0.0, number), SIGMA_RAD)[1] for number in (25, 100, 200)]
    assert sigmas == sorted(sigmas, reverse=True)
    assert all(math.isfinite(sigma) for sigma in sigmas)


def test_a_few_edges_show_no_rotation() -> None:
    edges, corners = off_the_lines(np.eye(3), 0.0, 24)
    assert not derotation.measure_off_line(OffLine(), edges.columns, corners.columns, PINHOLE, SETTINGS)


def test_of_many_edges_an_even_sample_is_enough() -> None:
    edges, corners = off_the_lines(np.eye(3), 0.0, 900)
    off = OffLine()
    assert derotation.measure_off_line(off, edges.columns, corners.columns, PINHOLE, SETTINGS)
    assert off.count == 180  # every fifth


def test_the_distance_from_the_flow_line_is_that_of_the_corner() -> None:
    edges, corners = off_the_lines(rotation_of((0.0, 0.004, 0.0)), 0.0, 25)
    off = OffLine()
    derotation.measure_off_line(off, edges.columns, corners.columns, PINHOLE, SETTINGS)
    for row in range(25):
        dx, dy = corners.x[row] - edges.predicted_x[row], corners.y[row] - edges.predicted_y[row]
        assert np.asarray(off.px)[row] == pytest.approx(line_distance(dx, dy, edges.cos[row], edges.sin[row]))


# Which of two rotations the corners agree with

LENS = Lens(640, 480, 500.0, 500.0, 319.5, 239.5)


def share_found(number: int, turned: Vector, asked: Vector) -> float:
    """Share of ``number`` trusted edges found again by a rotation, where their corners have turned by another one."""
    x, y = spread(number)
    edges, corners, index = EdgeTable(400, 1, 1), CornerTable(400), CornerIndex(640, 480, 400)
    rows = edges.append(number)
    edges.x[rows], edges.y[rows], edges.trust[rows], edges.corner[rows] = x, y, SETTINGS.tr_s, 0
    looks = np.random.default_rng(1).integers(0, 256, (number, 16)).astype(np.uint8)
    edges.appearance[rows] = looks
    moved = warp(rotation_of(turned), x, y)
    seen = ((moved >= 0) & (moved.T <= (639, 479)).T).all(axis=0)
    pixel = np.ascontiguousarray(np.rint(moved.T[seen]), np.int32)
    words = np.ascontiguousarray(looks[seen]).view(np.uint64)
    matching.take_corners(corners.columns, memory_of(pixel), memory_of(pixel.astype(np.float32)), memory_of(words))
    matching.fill(index, corners.columns)
    h, plane = homography(rotation_of(asked)), ImagePlane(LENS)
    return derotation.found_share(index, plane, edges.columns, corners.columns, h, 0.05, SETTINGS)


@given(st.floats(-0.09, 0.09), st.floats(-0.09, 0.09))
def test_the_rotation_that_happened_finds_nearly_all_edges_again_and_another_one_hardly_any(
    pitch: float, yaw: float
) -> None:
    assert share_found(200, (pitch, yaw, 0.0), (pitch, yaw, 0.0)) > 0.95
    assert share_found(200, (pitch, yaw, 0.0), (pitch, yaw + 0.04, 0.0)) < 0.2


def test_too_few_edges_agree_with_no_rotation() -> None:
    assert share_found(14, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)) == 0.0
    assert share_found(15, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)) == 1.0
