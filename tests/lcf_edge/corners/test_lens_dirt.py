"""Drops and dirt on the lens are what stays in place while the camera turns, and is small."""

import math
from collections.abc import Iterable, Iterator

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.corners.lens_dirt import APART, LensDirt
from lcf_edge.lens import Lens

Grey = npt.NDArray[np.uint8]

LENS = Lens(640, 480, 500.0, 500.0, 319.5, 239.5)  # a downscaled image has 80x60 px
FOCAL = 500.0 / 8
STEP = 4  # small px by which the camera turns from image to image
LEFT = np.array(cv2.Rodrigues(np.array([0.0, math.atan(STEP / FOCAL), 0.0]))[0])
HERE = np.s_[25:35, 40:50]  # where the drop is


def world(seed: int = 0, images: int = 40) -> Iterator[Grey]:
    """Downscaled images of a camera that turns to the left."""
    noise = np.random.default_rng(seed).normal(0, 60, (60, 80 + STEP * images))
    around = np.clip(128 + 3 * cv2.GaussianBlur(noise, (0, 0), 1.5), 0, 255).astype(np.uint8)
    return (around[:, -80 - STEP * k : -STEP * k or None].copy() for k in range(images))


def behind_a_drop(images: Iterable[Grey], here: tuple[slice, slice] = HERE) -> Iterator[Grey]:
    """Bright at its foot, dark above, and little of the world."""
    for image in images:
        drop = np.linspace(60, 200, here[0].stop - here[0].start)[:, None]
        image[here] = np.rint(0.9 * drop + 0.1 * image[here])
        yield image


def watched(images: Iterable[Grey], *, still: bool = False, visible: Grey | None = None) -> list[bool]:
    dirt, seen = LensDirt(LENS, visible), []
    for image in images:
        dirt.look(image, LEFT, still)
        seen.append(dirt.is_seen)
    return seen


def test_a_drop_is_seen_and_no_longer_when_it_is_wiped_away() -> None:
    images = list(world(images=80))
    seen = watched([*behind_a_drop(images[:40]), *images[40:]])
    assert all(seen[20:40])
    assert not any(seen[70:])


def test_it_is_known_where_the_drop_hides_the_world_until_it_is_wiped_away() -> None:
    dirt = LensDirt(LENS, None)
    images = list(world(images=80))
    for image in behind_a_drop(images[:40]):
        dirt.look(image, LEFT, still=False)
    beside = dirt.hidden.copy()
    beside[HERE[0].start - 3 : HERE[0].stop + 3, HERE[1].start - 3 : HERE[1].stop + 3] = 0
    assert dirt.hidden[HERE].all()
    assert not beside.any()
    in_the_drop, elsewhere, corner = (360, 240), (100, 240), (639, 479)
    assert dirt.shows_world(np.array([in_the_drop, elsewhere, corner], np.int32)).tolist() == [False, True, True]
    for image in images[40:]:
        dirt.look(image, LEFT, still=False)
    assert not dirt.hidden.any()


@pytest.mark.parametrize("seed", range(10))
def test_a_clean_lens_is_clean(seed: int) -> None:
    assert not any(watched(world(seed)))


def test_what_is_level_stays_when_the_camera_turns_and_is_no_dirt() -> None:
    """Where a wall begins, and a shelf."""
    walls = []
    for image in world():
        image[20:22], image[40:46, 10:60] = 240, 30
        walls.append(image)
    assert not any(watched(walls))


@pytest.mark.parametrize("here", [np.s_[45:60, 30:50], np.s_[0:10, 0:10]])
def test_what_reaches_the_border_is_a_part_of_the_vehicle(here: tuple[slice, slice]) -> None:
    assert not any(watched(behind_a_drop(world(), here)))


def test_a_configured_part_of_the_vehicle_is_no_dirt() -> None:
    visible = np.full((480, 640), 255, np.uint8)
    visible[190:290, 310:410] = 0
    assert not any(watched(behind_a_drop(world()), visible=visible))


def test_at_rest_nothing_is_said_though_the_gyro_seems_to_turn() -> None:
    (image, *_) = behind_a_drop(world())
    assert not any(watched([image] * 40, still=True))
    assert not any(watched([image] * 40))


def test_a_camera_that_looks_straight_ahead_says_nothing() -> None:
    """Far things stay in place then."""
    dirt = LensDirt(LENS, None)
    sideways = np.array(cv2.Rodrigues(np.array([0.0, 0.9 * math.atan(APART / FOCAL), 0.0]))[0])
    for number, image in enumerate(behind_a_drop(world())):
        dirt.look(image, sideways if number % 2 else sideways.T, still=False)
        assert not dirt.is_seen
