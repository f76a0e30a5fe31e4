"""Sums over some pixels of an image are those of NumPy over the same pixels."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.corners.image_sums import brightness, compare, fine_share_of_columns, fine_share_of_rows

Grey = npt.NDArray[np.uint8]

sizes = pytest.mark.parametrize(("width", "height"), [(64, 48), (61, 47), (5, 4), (1, 1)])


@sizes
def test_every_fourth_pixel_is_taken_and_compared(width: int, height: int, noise: Callable[..., Grey]) -> None:
    image, others = noise(1, width, height), np.ascontiguousarray(noise(2, width, height)[::4, ::4])
    samples = np.empty_like(others)
    change = compare(image.ravel().data, width, height, samples.ravel().data, others.ravel().data)
    assert samples.tolist() == image[::4, ::4].tolist()
    assert change == np.abs(image[::4, ::4].astype(int) - others).sum()


@sizes
@pytest.mark.parametrize("step", [1, 3, 8])
def test_brightness_is_that_of_some_pixels(width: int, height: int, step: int, noise: Callable[..., Grey]) -> None:
    image, sums = noise(3, width, height), np.empty(2, np.int32)
    brightness(image.ravel().data, width, height, step, 200, sums.data)
    some = image[::step, ::step]
    assert sums.tolist() == [some.sum(), (some >= 200).sum()]


def test_the_fine_share_is_that_of_rows_or_columns(noise: Callable[..., Grey]) -> None:
    image = noise(4, 61, 47)
    rows, columns = image[5::9].astype(float), image[:, 5::9].T.astype(float)
    shares = [(np.diff(each) ** 2).mean() / ((each[:, 4:] - each[:, :-4]) ** 2).mean() for each in (rows, columns)]
    flat = image.ravel().data
    assert fine_share_of_rows(flat, 61, 47, 5, 9, 4) == pytest.approx(shares[0])
    assert fine_share_of_columns(flat, 61, 47, 5, 9, 4) == pytest.approx(shares[1])


def test_in_a_plain_image_no_share_is_fine() -> None:
    plain = np.full(100, 9, np.uint8).data
    assert fine_share_of_rows(plain, 10, 10, 0, 1, 4) == fine_share_of_columns(plain, 10, 10, 0, 1, 4) == 0
