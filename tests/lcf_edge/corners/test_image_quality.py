"""Faults of an image are reported in a word."""

from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.corners.image_quality import ImageQuality, sharpness
from lcf_edge.rendered import scenes

Grey = npt.NDArray[np.uint8]


def drive(seconds: float = 1.5) -> list[Grey]:
    return [frame.image for frame, _ in scenes.frames(scenes.make("crossing", 31, seconds=seconds, fps=10.0))]


def moved(image: Grey, length_px: int) -> Grey:
    """As exposed while it moved sideways."""
    return np.asarray(cv2.blur(image, (length_px, 1)), np.uint8)


def test_usual_images_have_no_notes() -> None:
    quality = ImageQuality()
    assert {quality.notes(image, 700) for image in drive()} == {()}


@pytest.mark.parametrize("turned", [False, True], ids=["sideways", "up and down"])
def test_motion_blur_is_reported_while_it_lasts(turned: bool) -> None:
    quality = ImageQuality()
    *before, last = drive()
    for image in before:
        quality.notes(image, 700)
    blurred = np.ascontiguousarray(moved(np.ascontiguousarray(last.T), 9).T) if turned else moved(last, 9)
    assert quality.notes(blurred, 700) == ("blurred",)
    assert quality.notes(last, 700) == ()


def test_a_lens_that_is_always_soft_is_as_usual() -> None:
    quality = ImageQuality()
    soft = [np.asarray(cv2.GaussianBlur(image, (0, 0), 2.0), np.uint8) for image in drive()]
    assert {quality.notes(image, 700) for image in soft} == {()}


@pytest.mark.parametrize(("corners", "notes"), [(0, ("no corners",)), (39, ("few corners",)), (40, ())])
def test_how_many_corners_there_are(corners: int, notes: tuple[str, ...]) -> None:
    assert ImageQuality().notes(drive(0.1)[0], corners) == notes


def test_darkness_and_glare_are_reported() -> None:
    (image,) = drive(0.1)
    assert "dark" in ImageQuality().notes(image // 8, 700)
    dazzled = image.copy()
    dazzled[:160] = 255
    assert ImageQuality().notes(dazzled, 700) == ("glare",)


def test_a_drive_with_long_exposures_while_shaken_is_less_sharp() -> None:
    spec = scenes.make("motion_blur", 31, seconds=1.5, fps=10.0)
    long, short = ([f.image for f, _ in scenes.frames(each)] for each in (spec, replace(spec, exposure_s=0.0)))
    assert np.median([sharpness(image) for image in long]) < 0.9 * np.median([sharpness(image) for image in short])


@given(size=st.tuples(st.integers(1, 70), st.integers(1, 70)), grey=st.integers(0, 255))
def test_any_size_of_image_has_a_sharpness(size: tuple[int, int], grey: int) -> None:
    assert 0 <= sharpness(np.full(size, grey, np.uint8)) <= 1
