"""Whether the image stands still, by its corners."""

import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.ego_motion.stillness import Stillness

WIDTH, HEIGHT = 320, 240
FRAME_NS = 50_000_000


def corners(seed: int = 0, number: int = 300) -> npt.NDArray[np.int32]:
    """Whole px, all over the image."""
    return np.random.default_rng(seed).integers((12, 12), (WIDTH - 12, HEIGHT - 12), (number, 2)).astype(np.int32)


def verdicts(frames: int, place: npt.NDArray[np.int32], px_a_frame: float = 0.0, jump_px: int = 0) -> list[bool | None]:
    stillness, random = Stillness(WIDTH, HEIGHT), np.random.default_rng(1)
    answers = []
    for frame in range(frames):
        moved = place + np.array([round(px_a_frame * frame), 0]) + random.integers(-jump_px, jump_px + 1, place.shape)
        inside = (moved[:, 0] < WIDTH) & (moved[:, 1] < HEIGHT)
        answers.append(stillness.look(frame * FRAME_NS, moved[inside].astype(np.int32)))
    return answers


def test_half_a_second_must_pass_before_it_decides() -> None:
    answers = verdicts(40, corners())
    assert answers[:10] == [None] * 10
    assert answers[10:] == [True] * 30


def test_motors_may_make_corners_jump_by_a_pixel() -> None:
    assert verdicts(40, corners(), jump_px=1)[10:] == [True] * 30


@pytest.mark.parametrize("px_a_frame", [0.5, 2.0, -7.0])
def test_an_image_that_moves_is_not_still(px_a_frame: float) -> None:
    assert not any(verdicts(25, corners(), px_a_frame)[10:])


@pytest.mark.parametrize(("walkers", "still"), [(60, True), (200, False)])
def test_a_few_corners_may_move_by_themselves(walkers: int, still: bool) -> None:
    stillness, place = Stillness(WIDTH, HEIGHT), corners()
    for frame in range(20):
        place[:walkers, 0] = (place[:walkers, 0] + 6) % WIDTH
        answer = stillness.look(frame * FRAME_NS, place.copy())
    assert answer is still


def test_too_few_corners_and_a_clock_that_goes_back_do_not_decide() -> None:
    stillness, place = Stillness(WIDTH, HEIGHT), corners()
    for frame in range(15):
        assert stillness.look(frame * FRAME_NS, place[:39]) is None
    for frame in range(15):
        last = stillness.look(frame * FRAME_NS, place)
    assert last
    assert stillness.look(0, place) is None


def test_it_starts_to_move_and_stands_again() -> None:
    stillness, place = Stillness(WIDTH, HEIGHT), corners()
    answers = []
    for frame in range(80):
        x = 0 if frame < 30 else min(2 * (frame - 30), 40)
        answers.append(
            stillness.look(frame * FRAME_NS, (place + np.array([x, 0]))[place[:, 0] + x < WIDTH].astype(np.int32))
        )
    assert all(answers[10:30])
    assert not any(answers[33:50])
    assert all(answers[72:])
