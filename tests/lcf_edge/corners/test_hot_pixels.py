"""Pixels of the sensor that are hot or dead are no corners; fine texture that moves is."""

import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.config import Filter
from lcf_edge.corners.detector import CornerDetector
from lcf_edge.corners.hot_pixels import SINGLES, keep_cool
from lcf_edge.filter.memory import integers
from lcf_edge.lens import Lens

Grey = npt.NDArray[np.uint8]
WIDTH, HEIGHT, PLAIN = 160, 120, 100
IMAGES, MISSED, ALONE_GREY = 5, 2, 10  # what the module promises; its constants are compiled away


def plain_with(*dots: tuple[int, int], grey: int = 255) -> Grey:
    """A plain image but for single pixels, x and y."""
    image = np.full((HEIGHT, WIDTH), PLAIN, np.uint8)
    for x, y in dots:
        image[y, x] = grey
    return image


class Keeper:
    """``keep_cool`` with one table, image after image."""

    def __init__(self) -> None:
        self._singles, self._number = integers(*SINGLES), 0

    def kept(self, image: Grey, *places: tuple[int, int], again: bool = False) -> list[tuple[int, int]]:
        """Of corners as strong as their pixel differs from the plain, those that are kept."""
        self._number += not again
        pixel = np.array(places, np.int32).reshape(-1, 2)
        strength = np.abs(image[pixel[:, 1], pixel[:, 0]].astype(np.float32) - PLAIN)
        count = keep_cool(self._singles, self._number, image.ravel().data, WIDTH, pixel.data, strength.data)
        return [(x, y) for x, y in pixel[:count].tolist()]


@pytest.mark.parametrize("grey", [0, PLAIN - ALONE_GREY, PLAIN + ALONE_GREY, 255])
def test_what_stands_alone_at_one_pixel_image_after_image_is_hot(grey: int) -> None:
    keeper, image = Keeper(), plain_with((40, 30), grey=grey)
    kept = [keeper.kept(image, (40, 30)) for _ in range(IMAGES + 3)]
    assert kept == [[(40, 30)]] * (IMAGES - 1) + [[]] * 4


def test_noise_is_not() -> None:
    keeper, image = Keeper(), plain_with((40, 30), grey=PLAIN + ALONE_GREY - 1)
    assert all(keeper.kept(image, (40, 30)) for _ in range(3 * IMAGES))


def test_nor_is_what_moves() -> None:
    keeper = Keeper()
    places = [(20 + k // (IMAGES - 1), 30) for k in range(40)]
    assert all(keeper.kept(plain_with(place), place) == [place] for place in places)


def test_nor_is_what_is_wider_than_a_pixel() -> None:
    keeper, image = Keeper(), plain_with((40, 30), (41, 30))
    assert all(keeper.kept(image, (40, 30)) for _ in range(3 * IMAGES))


@pytest.mark.parametrize(("around", "hot"), [(120, True), (140, False)])
def test_a_defect_stands_out_from_those_around_it_nearly_as_much_as_from_the_ring(around: int, hot: bool) -> None:
    keeper, image = Keeper(), plain_with()
    image[29:32, 39:42] = around
    image[30, 40] = 200
    kept = [keeper.kept(image, (40, 30)) for _ in range(IMAGES)]
    assert (kept[-1] == []) == hot


def test_a_hot_pixel_may_be_missed_for_a_moment_but_not_for_long() -> None:
    keeper, image = Keeper(), plain_with((40, 30))
    for _ in range(IMAGES):
        keeper.kept(image, (40, 30))
    for _ in range(MISSED):
        keeper.kept(image)
    assert not keeper.kept(image, (40, 30))
    for _ in range(MISSED + 1):
        keeper.kept(image)
    assert keeper.kept(image, (40, 30))


def test_one_image_counts_once_in_however_many_parts_it_is_given() -> None:
    keeper, image = Keeper(), plain_with((40, 30))
    assert all(keeper.kept(image, (40, 30), again=k > 0) for k in range(3 * IMAGES))


def test_corners_beside_it_stay_in_their_order() -> None:
    keeper, image = Keeper(), plain_with((40, 30), (60, 30), (61, 30), (20, 80), (21, 80))
    for _ in range(IMAGES - 1):
        keeper.kept(image, (40, 30))
    assert keeper.kept(image, (20, 80), (40, 30), (60, 30)) == [(20, 80), (60, 30)]


def test_of_two_pixels_with_one_row_the_first_keeps_it_while_it_lasts() -> None:
    first, second = (10, 10), ((10 * WIDTH + 10 + SINGLES[0]) % WIDTH, (10 * WIDTH + 10 + SINGLES[0]) // WIDTH)
    keeper, both = Keeper(), plain_with((10, 10), second)
    for _ in range(2 * IMAGES):
        kept = keeper.kept(both, first, second)
    assert kept == [second]
    for _ in range(MISSED + 1 + IMAGES):
        kept = keeper.kept(plain_with(second), second)
    assert kept == []


def test_the_detector_finds_none_where_the_threshold_follows_the_scene() -> None:
    places = [(30, 40), (80, 60), (120, 90)]
    lens = Lens(WIDTH, HEIGHT, 100.0, 100.0, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
    for settings, found in ((Filter(), 0), (Filter(fast_adaptive=False, least_roundness=0.0), 3)):
        detector = CornerDetector(settings, lens, 100)
        numbers = [len(detector.detect(plain_with(*places))[0]) for _ in range(IMAGES + 2)]
        assert (numbers[0], numbers[-1]) == (3, found)
