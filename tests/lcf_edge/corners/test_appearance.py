"""The samples of a corner, by an own reckoning of what they are."""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.corners.appearance import BORDER_PX, RING_PX, appearance

Grey = npt.NDArray[np.uint8]
Pixels = npt.NDArray[np.int32]


def by_whole_arrays(image: Grey, pixel: Pixels) -> Grey:
    """The same with NumPy, all corners at once."""
    x, y = pixel.T
    nine = [np.roll(image.astype(int), (-down, -right), (0, 1)) for down in (-1, 0, 1) for right in (-1, 0, 1)]
    smooth = np.rint(sum(nine) / 9).astype(int)  # what comes round the border is not within reach
    looks = np.stack([smooth[y + dy, x + dx] for dx, dy in RING_PX], axis=1)
    return np.asarray(np.clip(looks + 128 - looks.sum(axis=1, keepdims=True) // 16, 0, 255), np.uint8)


def places(width: int, height: int, count: int, seed: int) -> Pixels:
    random = np.random.default_rng(seed)
    x = random.integers(BORDER_PX, width - BORDER_PX, count)
    y = random.integers(BORDER_PX, height - BORDER_PX, count)
    return np.stack((x, y), axis=1).astype(np.int32)


@given(
    size=st.tuples(st.integers(2 * BORDER_PX + 1, 60), st.integers(2 * BORDER_PX + 1, 60)),
    count=st.integers(0, 20),
    seed=st.integers(0, 2**32 - 1),
    black_and_white=st.booleans(),
)
def test_samples_are_the_ring_with_its_mean_at_128(
    size: tuple[int, int], count: int, seed: int, black_and_white: bool
) -> None:
    width, height = size
    image = np.random.default_rng(seed).integers(0, 256, (height, width), np.uint8)
    if black_and_white:  # where moving the mean leads out of the range
        image = np.asarray((image > 230) * 255, np.uint8)
    pixel = places(width, height, count, seed)
    samples = appearance(image, pixel)
    assert (samples.dtype, samples.shape) == (np.uint8, (count, 16))
    assert np.array_equal(samples, by_whole_arrays(image, pixel))


@pytest.mark.parametrize("view", ["rows of a larger image", "every second column", "read-only"])
def test_any_image_is_looked_at_in_place(view: str) -> None:
    whole = np.random.default_rng(1).integers(0, 256, (90, 160), np.uint8)
    whole.flags.writeable = view != "read-only"
    image = {"rows of a larger image": whole[10:70, 20:120], "every second column": whole[:, ::2]}.get(view, whole)
    pixel = places(image.shape[1], image.shape[0], 50, 2)
    assert np.array_equal(appearance(image, pixel), by_whole_arrays(image.copy(), pixel))


def test_samples_reach_as_far_as_the_border_that_is_kept_free() -> None:
    assert np.abs(RING_PX).max() < BORDER_PX
    image = np.zeros((15, 15), np.uint8)
    assert (appearance(image, np.array([(7, 7)], np.int32)) == 128).all()
