"""Corners are distinguished from points along an edge by the structure tensor around them."""

from collections.abc import Callable

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.corners.along_edge import BORDER_PX, WITHIN, keep_round
from lcf_edge.corners.along_edge import roundness as roundness_at

Grey = npt.NDArray[np.uint8]
MIDDLE = 20, 20


def roundness(image: Grey, x: int, y: int) -> float:
    return roundness_at(image.ravel().data, image.shape[1], WITHIN, x, y)


def half_plane(degrees: float) -> Grey:
    """Dark and bright on the two sides of a smooth edge through the middle."""
    y, x = np.mgrid[:41, :41] - 20.0
    across = x * np.cos(np.radians(degrees)) + y * np.sin(np.radians(degrees))
    return np.asarray(128 + 80 * np.tanh(across / 1.5), np.uint8)


@given(seed=st.integers(0, 2**32 - 1))
def test_it_is_the_ratio_of_opencvs_eigenvalues(noise: Callable[..., Grey], seed: int) -> None:
    image = noise(seed, 40, 30)
    y, x = np.mgrid[BORDER_PX : 30 - BORDER_PX, BORDER_PX : 40 - BORDER_PX]
    both = cv2.cornerEigenValsAndVecs(image, 7, 3)[y, x, :2]
    expected = both.min(axis=2) / both.max(axis=2)
    found = [roundness(image, *at) for at in zip(x.ravel().tolist(), y.ravel().tolist(), strict=True)]
    np.testing.assert_allclose(found, expected.ravel(), atol=2e-4)


@pytest.mark.parametrize("degrees", range(0, 180, 15))
def test_along_an_edge_there_is_next_to_none(degrees: int) -> None:
    assert roundness(half_plane(degrees), *MIDDLE) < 0.01


@pytest.mark.parametrize("degrees", range(0, 180, 15))
def test_where_two_edges_meet_there_is_much(degrees: int) -> None:
    corner = np.minimum(half_plane(degrees), half_plane(degrees + 90))
    assert roundness(corner, *MIDDLE) > 0.2


def test_light_and_contrast_make_no_difference(noise: Callable[..., Grey]) -> None:
    image = noise(3, 41, 41) // 4
    assert roundness(image, *MIDDLE) == pytest.approx(roundness(2 * image + 50, *MIDDLE), rel=1e-5)


def test_a_plain_image_has_none() -> None:
    assert roundness(np.full((41, 41), 77, np.uint8), *MIDDLE) == 0


@given(
    places=st.lists(
        st.tuples(st.integers(BORDER_PX, 39 - BORDER_PX), st.integers(BORDER_PX, 29 - BORDER_PX)), max_size=30
    ),
    least=st.floats(0, 0.5),
)
def test_what_is_round_is_kept_in_its_order_with_its_strength(
    noise: Callable[..., Grey], places: list[tuple[int, int]], least: float
) -> None:
    image = noise(3, 40, 30)
    pixel = np.array(places, np.int32).reshape(-1, 2)
    strength = np.arange(len(pixel), dtype=np.float32)
    count = keep_round(image.ravel().data, 40, WITHIN, pixel.data, strength.data, least)
    kept = [(at, k) for k, at in enumerate(places) if roundness(image, *at) >= least]
    assert [(tuple(at), k) for at, k in zip(pixel[:count].tolist(), strength[:count].tolist(), strict=True)] == kept
