"""FAST-9 of our own: the corners of OpenCV's, of each part of an image, and the same ones uncompiled."""

import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lcf_edge.compilation import uncompiled
from lcf_edge.corners.fast import DARK, Fast
from tests.lcf_edge.corners.test_detector import clutter

Grey = npt.NDArray[np.uint8]

needs_extension = pytest.mark.skipif(bool(uncompiled()), reason=uncompiled())
WIDTH, HEIGHT = 96, 64
WHOLE = np.array([(3, 3, WIDTH - 3, HEIGHT - 3)], np.int32)
PARTS = np.array([(3, 3, 40, 20), (40, 3, 41, 30), (50, 10, 93, 61), (60, 30, 60, 40), (70, 50, 65, 40)], np.int32)


def found(
    image: Grey, threshold: int, parts: npt.NDArray[np.int32], *, compiled: bool, on_dark: int | None = None
) -> list[tuple[float, ...]]:
    """x, y and strength of each corner, in order."""
    height, width = image.shape
    fast = Fast(width, height, compiled=compiled)
    fast.look(image)
    pixel, strength = fast.corners(threshold, parts, on_dark)
    return [(*place, strong) for place, strong in zip(pixel.tolist(), strength.tolist(), strict=True)]


@needs_extension
@given(
    image=arrays(np.uint8, (HEIGHT, WIDTH), elements=st.sampled_from([0, 1, 30, 120, 128, 200, 254, 255])),
    threshold=st.integers(1, 254),
)
def test_the_corners_of_any_image_and_threshold_are_those_of_opencv(image: Grey, threshold: int) -> None:
    keypoints = cv2.FastFeatureDetector.create(threshold, True).detect(image)
    assert found(image, threshold, WHOLE, compiled=True) == [(*one.pt, one.response) for one in keypoints]


@needs_extension
@pytest.mark.parametrize("threshold", [1, 13, 25, 60, 127, 128, 200])
def test_a_part_has_the_corners_that_it_has_as_an_image_of_its_own(threshold: int) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH), np.uint8)
    for image in (noise, clutter(5, WIDTH, HEIGHT)):
        assert found(image, threshold, PARTS, compiled=True) == found(image, threshold, PARTS, compiled=False)


@needs_extension
@given(
    image=arrays(np.uint8, (HEIGHT, WIDTH), elements=st.sampled_from([0, 20, 30, 40, 47, 48, 60, 70, 90])),
    on_dark=st.integers(1, 40),
)
def test_what_is_dark_has_a_threshold_of_its_own(image: Grey, on_dark: int) -> None:
    corners = found(image, 30, PARTS, compiled=True, on_dark=on_dark)
    assert corners == [
        (x, y, strength)
        for x, y, strength in found(image, min(on_dark, 30), PARTS, compiled=True)
        if strength >= 30 or image[int(y), int(x)] < DARK
    ]
    assert corners == found(image, 30, PARTS, compiled=False, on_dark=on_dark)


@needs_extension
def test_a_second_look_with_a_lower_threshold_finds_what_a_first_one_would() -> None:
    image = clutter(5, WIDTH, HEIGHT)
    fast = Fast(WIDTH, HEIGHT, compiled=True)
    fast.look(image)
    fast.corners(60, WHOLE)
    pixel, strength = fast.corners(10, PARTS)
    again = [(*place, strong) for place, strong in zip(pixel.tolist(), strength.tolist(), strict=True)]
    assert again == found(image, 10, PARTS, compiled=True)


@needs_extension
def test_the_next_image_is_looked_at_anew() -> None:
    fast = Fast(WIDTH, HEIGHT, compiled=True)
    fast.look(clutter(5, WIDTH, HEIGHT))
    assert len(fast.corners(10, WHOLE)[0])
    fast.look(np.full((HEIGHT, WIDTH), 90, np.uint8))
    assert not len(fast.corners(10, WHOLE)[0])


def test_an_image_that_is_all_border_has_none() -> None:
    for size in ((1, 1), (7, 6), (640, 3)):
        image = np.zeros(size, np.uint8)
        height, width = size
        for compiled in {not uncompiled(), False}:
            part = np.array([(3, 3, width - 3, height - 3)], np.int32)
            assert found(image, 10, part, compiled=compiled) == []


_DIGEST = """
import zlib, numpy as np
from lcf_edge.corners.fast_scores import Scores, bound, find
image = np.random.default_rng(3).integers(0, 256, (24, 40), np.uint8)
scores = Scores(40, 24, 48)
flat, pixel, strength = image.reshape(-1).data, np.zeros((960, 2), np.int32), np.zeros(960, np.float32)
bound(scores, flat)
parts = np.array([(3, 3, 37, 21), (5, 7, 20, 9)], np.int32)
count = find(scores, flat, 40, 9, parts.data, pixel.data, strength.data)
print(count, zlib.crc32(pixel.tobytes() + strength.tobytes()))
"""


@needs_extension
def test_compiled_and_uncompiled_the_scores_are_the_same() -> None:
    outputs = [
        subprocess.run(
            (sys.executable, "-c", _DIGEST),
            env={**os.environ, **environment},
            cwd=Path(__file__).parents[3],
            check=True,
            capture_output=True,
            text=True,
        ).stdout
        for environment in ({}, {"LCF_EDGE_PURE": "1"})
    ]
    assert outputs[0] == outputs[1]
    assert int(outputs[0].split()[0]) > 10
