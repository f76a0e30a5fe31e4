"""A repeated image holds nothing new, and is recognised."""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.corners.repeats import MAX_REPEAT_S, Repeats

FRAME_NS = 40_000_000
Grey = npt.NDArray[np.uint8]

SCENE = np.random.default_rng(1).integers(0, 200, (120, 400), dtype=np.uint8).repeat(4, axis=1)


def view(left: int, noise: float = 0.0, seed: int = 0) -> Grey:
    """What a camera sees that has moved so far to the right, px."""
    random = np.random.default_rng(seed)
    image = SCENE[:, left : left + 160] + random.normal(0, noise, (120, 160))
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def answers(images: list[Grey], every_ns: int = FRAME_NS) -> list[bool]:
    repeats = Repeats()
    return [repeats.is_repeat(number * every_ns, image) for number, image in enumerate(images)]


@given(st.lists(st.integers(1, 3), min_size=4, max_size=12))
def test_copies_are_repeats_however_often_each_comes(times: list[int]) -> None:
    images = [view(6 * number) for number, copies in enumerate(times) for _ in range(copies)]
    first = [copy == 0 for copies in times for copy in range(copies)]
    begun = times[0]  # until the image changes for the first time nothing is known
    assert answers(images)[begun:] == [not new for new in first[begun:]]


def test_what_a_coder_adds_to_a_copy_makes_it_no_new_image() -> None:
    images = [view(6 * (number // 2), noise=0.2, seed=number) for number in range(12)]
    assert answers(images)[2:] == [False, True] * 5


@pytest.mark.parametrize("noise", [1.0, 3.0])
def test_copies_with_noise_of_their_own_are_repeats_once_some_have_come(noise: float) -> None:
    images = [view(6 * (number // 2), noise, number) for number in range(40)]
    assert answers(images)[10:] == [False, True] * 15


def test_an_image_that_now_and_then_is_like_the_last_one_is_no_copy() -> None:
    """A vehicle that moves by fits and starts."""
    at = [number - number // 60 for number in range(300)]
    assert not any(answers([view(6 * place % 1400, 1.0, number) for number, place in enumerate(at)]))


def test_a_source_of_copies_with_noise_shows_a_scene_that_stands() -> None:
    driving = [view(6 * (number // 2), 1.0, number) for number in range(40)]
    standing = [view(6 * 20, 1.0, number) for number in range(40, 80)]
    told = answers([*driving, *standing])
    frozen = round(MAX_REPEAT_S * 1e9 / FRAME_NS)
    assert any(told[41:])
    assert not any(told[41 + frozen :])


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_a_scene_that_stands_still_is_new_in_every_image(noise: float) -> None:
    assert not any(answers([view(0, noise, seed) for seed in range(40)]))


def test_the_noise_of_a_camera_makes_new_images_while_the_vehicle_stands() -> None:
    driving = [view(6 * number, 1.5, number) for number in range(20)]
    standing = [view(6 * 19, 1.5, 20 + number) for number in range(20)]
    assert not any(answers([*driving, *standing]))


def test_a_camera_that_gives_one_image_for_ever_shows_a_scene_that_stands() -> None:
    told = answers([*(view(6 * number) for number in range(20)), *[view(6 * 19)] * 40])
    frozen = round(MAX_REPEAT_S * 1e9 / FRAME_NS)
    assert told[20 : 20 + frozen] == [True] * frozen
    assert not any(told[20 + frozen :])


def test_a_clock_that_goes_back_begins_anew() -> None:
    repeats = Repeats()
    for number in range(10):
        repeats.is_repeat(10**9 + number * FRAME_NS, view(6 * number))
    assert not repeats.is_repeat(0, view(6 * 9))


def test_another_size_begins_anew() -> None:
    repeats = Repeats()
    for number in range(10):
        repeats.is_repeat(number * FRAME_NS, view(6 * number))
    assert not repeats.is_repeat(10 * FRAME_NS, np.ascontiguousarray(view(54)[:60]))
