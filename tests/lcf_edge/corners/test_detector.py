"""Corners: where they are found, how many are kept, and what they look like."""

import itertools
import math
from collections import Counter
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcf_edge.config import Filter
from lcf_edge.corners.appearance import BORDER_PX, RING_PX
from lcf_edge.corners.detector import SPREAD_PX, THRESHOLDS, CornerDetector
from lcf_edge.filter.inputs import Corners
from lcf_edge.lens import Lens

Grey = npt.NDArray[np.uint8]
Noise = Callable[..., Grey]

STEADY = Filter(fast_adaptive=False)


def pinhole(width: int = 640, height: int = 480) -> Lens:
    return Lens(width, height, 500.0, 500.0, (width - 1) / 2, (height - 1) / 2)


def detector(image: Grey, settings: Filter = STEADY, capacity: int = 1500) -> CornerDetector:
    height, width = image.shape
    return CornerDetector(settings, pinhole(width, height), capacity)


def clutter(cell_px: int, width: int = 640, height: int = 480) -> Grey:
    """Square patches, the smaller the more corners."""
    patches = np.random.default_rng(2).integers(0, 256, (height // cell_px + 1, width // cell_px + 1), np.uint8)
    cells = np.kron(patches, np.ones((cell_px, cell_px), np.uint8))[:height, :width]
    return np.asarray(cv2.GaussianBlur(cells, (3, 3), 0), np.uint8)


# Where


def test_a_bright_square_has_four_corners() -> None:
    image = np.full((120, 160), 60, np.uint8)
    image[40:80, 50:110] = 200
    image = np.asarray(cv2.GaussianBlur(image, (3, 3), 0), np.uint8)  # a sharp one has no single best pixel
    corners, evicted = detector(image).detect(image)
    vertices = np.array([(50, 40), (109, 40), (50, 79), (109, 79)])
    away = np.abs(corners.pixel[:, None] - vertices).max(axis=2)
    assert evicted == 0
    assert (away.min(axis=1) <= 3).all()  # every corner is at a vertex
    assert (away.min(axis=0) <= 3).all()  # and every vertex has one
    assert np.array_equal(corners.position, corners.pixel.astype(np.float32))


def test_no_corner_is_nearer_to_the_border_than_its_samples_reach(noise: Noise) -> None:
    image = noise(width=100, height=60)
    corners, _ = detector(image).detect(image)
    assert corners.pixel.min() == BORDER_PX == 1 + np.abs(RING_PX).max()
    assert corners.pixel[:, 0].max() == 100 - 1 - BORDER_PX
    assert corners.pixel[:, 1].max() == 60 - 1 - BORDER_PX


def test_an_image_without_a_corner_gives_empty_arrays() -> None:
    image = np.full((48, 64), 128, np.uint8)
    corners, evicted = detector(image).detect(image)
    assert (len(corners), evicted) == (0, 0)
    assert (corners.pixel.shape, corners.pixel.dtype) == ((0, 2), np.int32)
    assert (corners.position.shape, corners.position.dtype) == ((0, 2), np.float32)
    assert (corners.appearance.shape, corners.appearance.dtype) == ((0, 16), np.uint8)


@given(
    size=st.tuples(st.integers(1, 48), st.integers(1, 48)),
    seed=st.integers(0, 2**32 - 1),
    capacity=st.integers(1, 40),
    threshold=st.integers(1, 254),
)
def test_any_image_of_any_size(noise: Noise, size: tuple[int, int], seed: int, capacity: int, threshold: int) -> None:
    image = noise(seed, *size)
    steady = Filter(fast_adaptive=False, fast_threshold=threshold)
    every, nothing = detector(image, steady).detect(image)
    corners, evicted = detector(image, steady, capacity).detect(image)
    assert nothing == 0
    assert len(corners) == min(len(every), capacity)
    assert len(corners) + evicted == len(every)
    assert {*map(tuple, corners.pixel.tolist())} <= {*map(tuple, every.pixel.tolist())}


def test_an_image_of_16_px_has_room_for_corners_in_its_middle_only(noise: Noise) -> None:
    images = [noise(seed, 16, 16) for seed in range(20)]
    found = np.concatenate([detector(image).detect(image)[0].pixel for image in images])
    assert set(found.ravel().tolist()) == {7, 8}


def test_rows_of_a_larger_image_may_be_looked_at_in_place(noise: Noise) -> None:
    whole = noise(width=200, height=100)
    part = whole[10:70, 20:120]
    seen, _ = detector(part).detect(part)
    copied, _ = detector(part).detect(part.copy())
    assert same(seen, copied)


# How many


def same(one: Corners, other: Corners) -> bool:
    return all(
        getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in ("pixel", "position", "appearance")
    )


def squares(pixel: npt.NDArray[np.int32]) -> list[tuple[int, int]]:
    return [(x // SPREAD_PX, y // SPREAD_PX) for x, y in pixel.tolist()]


def test_20_000_corners_are_cut_to_the_budget_and_still_cover_the_image(noise: Noise) -> None:
    image = noise()
    corners, evicted = detector(image, Filter(fast_adaptive=False, fast_threshold=8)).detect(image)
    assert len(corners) == 1500
    assert evicted > 20_000
    shares = Counter(squares(corners.pixel))
    assert len(shares) == (640 // SPREAD_PX) * (480 // SPREAD_PX)
    assert max(shares.values()) - min(shares.values()) <= 1


def settled(image: Grey, settings: Filter) -> tuple[int, Corners]:
    """Threshold and corners of a scene that has stood still for a while."""
    adaptive = detector(image, settings)
    for _ in range(20):
        corners, _ = adaptive.detect(image)
    return adaptive.threshold, corners


def within(pixel: npt.NDArray[np.number[Any]], left: int, top: int, right: int, bottom: int) -> int:
    x, y = pixel.T
    return int(np.count_nonzero((x >= left) & (x < right) & (y >= top) & (y < bottom)))


def test_no_square_takes_more_than_four_times_the_mean() -> None:
    image = np.full((480, 640), 128, np.uint8)
    image[:, 320:] = clutter(5)[:, 320:]  # half of the image is as rich as can be
    _, corners = settled(image, Filter(corners_target=384))
    in_square = Counter(map(tuple, (corners.pixel // 40).tolist()))  # 192 of them, 2 corners in the mean
    assert max(in_square.values()) == 8


def dark_body() -> Grey:
    """A body of 240 by 120 px with an eighth of the contrast of the skyline behind it."""
    image = clutter(8)
    image[280:400, 200:440] = image[280:400, 200:440] // 8 + 20
    return image


def test_a_dark_body_before_a_bright_skyline_has_corners_of_its_own() -> None:
    image = dark_body()
    threshold, corners = settled(image, Filter())
    everywhere = cv2.FastFeatureDetector.create(threshold).detect(image)
    inside = 210, 290, 430, 390
    assert within(np.array([each.pt for each in everywhere]), *inside) == 0
    assert within(corners.pixel, *inside) >= 15


def test_above_what_can_be_met_no_faint_corners_are_looked_for() -> None:
    image = dark_body()
    adaptive = detector(image, Filter())
    for _ in range(40):
        corners, _ = adaptive.detect(image, highest_row=450.0)
    assert within(corners.pixel, 210, 290, 430, 350) == 0
    assert within(settled(image, Filter())[1].pixel, 210, 290, 430, 350) > 5


def test_near_the_horizon_a_wide_lens_has_more_corners_because_all_is_smaller() -> None:
    image = dark_body()

    def inside(focal_px: float, horizon_row: float) -> int:
        lens = Lens(640, 480, focal_px, focal_px, 319.5, 239.5)
        adaptive = CornerDetector(Filter(), lens, 1500)
        for _ in range(40):
            corners, _ = adaptive.detect(image, horizon_row=horizon_row)
        return within(corners.pixel, 210, 290, 430, 390)

    narrow, wide = 500.0, 224.0
    assert inside(narrow, 340.0) == inside(narrow, math.nan)
    assert inside(wide, 60.0) == inside(wide, math.nan)  # not the horizon
    assert inside(wide, 340.0) > 3 * inside(wide, math.nan)


@pytest.mark.parametrize(("darkest", "some"), [(20, True), (110, False)])
def test_what_is_dark_has_corners_of_fewer_grey_levels(darkest: int, some: bool) -> None:
    image = clutter(12) // 3 + 80
    image[280:400, 200:440] = darkest
    for x, y in itertools.product(range(215, 430, 20), range(295, 390, 20)):
        image[y : y + 10, x : x + 10] += 14
    _, corners = settled(np.asarray(cv2.GaussianBlur(image, (3, 3), 0), np.uint8), Filter())
    assert (within(corners.pixel, 210, 290, 430, 390) >= 5) == some


def test_no_corner_is_found_twice() -> None:
    _, corners = settled(dark_body(), Filter())
    assert len({*map(tuple, corners.pixel.tolist())}) == len(corners)


@pytest.mark.parametrize("lean_px", [110, 130, 150, 170, 190])
def test_steps_of_a_slanting_line_are_no_corners(lean_px: int) -> None:
    """A painted line, as cameras sharpen it and JPEG leaves it."""
    image = np.full((240, 320), 90, np.uint8)
    outline = np.array([(40, 235), (52, 235), (46 + lean_px, 5), (40 + lean_px, 5)])
    cv2.fillPoly(image, [outline], (220,), cv2.LINE_AA)
    sharp = cv2.addWeighted(image, 2.0, cv2.GaussianBlur(image, (0, 0), 1.2), -1.0, 0)
    image = np.asarray(cv2.imdecode(cv2.imencode(".jpg", sharp, [cv2.IMWRITE_JPEG_QUALITY, 70])[1], 0), np.uint8)
    every, _ = detector(image, Filter(fast_adaptive=False, least_roundness=0)).detect(image)
    corners, _ = detector(image).detect(image)
    middle = 0, 30, 320, 210  # without the ends of the line
    assert within(every.pixel, *middle) > 40
    assert within(corners.pixel, *middle) <= 3


# The threshold


def settle(adaptive: CornerDetector, image: Grey, frames: int = 40) -> list[tuple[int, int]]:
    """Threshold and corners of each frame of a scene that stands still."""
    return [(adaptive.threshold, len(adaptive.detect(image)[0])) for _ in range(frames)]


@pytest.mark.parametrize("cell_px", [5, 7, 9, 12, 20])
@pytest.mark.parametrize("start", [10, 25, 80])
def test_the_threshold_settles_where_about_the_wanted_corners_are_found(cell_px: int, start: int) -> None:
    image = clutter(cell_px) // 3 + 80
    seen = settle(detector(image, Filter(fast_threshold=start, corners_target=500), 5000), image)
    threshold, found = seen[-1]
    assert seen[-10:] == [(threshold, found)] * 10
    assert 0.7 <= found / 500 <= 1.4


def test_the_threshold_stays_within_its_range(noise: Noise) -> None:
    flat, busy = np.full((480, 640), 128, np.uint8), noise()
    assert settle(detector(flat, Filter()), flat)[-1][0] == THRESHOLDS[0]
    assert settle(detector(busy, Filter(corners_target=1)), busy)[-1][0] == THRESHOLDS[1]


def test_without_adaption_the_threshold_stays(noise: Noise) -> None:
    image = noise(width=100, height=60)
    assert {threshold for threshold, _ in settle(detector(image), image, 5)} == {25}


def test_the_same_images_give_the_same_corners() -> None:
    images = [clutter(cell_px) for cell_px in (12, 5, 40, 12, 8)]
    one, other = (detector(images[0], Filter()) for _ in range(2))
    for image in images:
        (seen, cut), (again, cut_again) = one.detect(image), other.detect(image)
        assert same(seen, again)
        assert (cut, one.threshold) == (cut_again, other.threshold)


# Looks


def test_the_appearance_is_the_ring_of_samples_around_the_corner_with_its_mean_at_128() -> None:
    image = cv2.GaussianBlur(clutter(12), (5, 5), 0) // 2 + 60  # contrast that nothing clips
    corners, _ = detector(image).detect(image)
    assert len(corners) > 50
    x, y = corners.pixel.T
    smooth = cv2.blur(image, (3, 3))
    for number, (dx, dy) in enumerate(RING_PX):
        sample = smooth[y + dy, x + dx].astype(int)
        assert (np.diff(sample - corners.appearance[:, number]) == np.diff(mean_of(smooth, x, y))).all()
    assert np.abs(corners.appearance.mean(axis=1) - 128).max() <= 1


def mean_of(image: Grey, x: npt.NDArray[np.int32], y: npt.NDArray[np.int32]) -> npt.NDArray[np.int64]:
    ring = np.array([image[y + dy, x + dx] for dx, dy in RING_PX], np.int64)
    return ring.sum(axis=0) // len(RING_PX)


def test_a_brighter_image_looks_the_same() -> None:
    image = clutter(12) // 2 + 20
    dark, bright = (detector(each).detect(each)[0] for each in (image, image + 90))
    assert same(dark, bright)


def test_samples_stand_all_around_at_4_to_6_px() -> None:
    ring = np.array(RING_PX)
    assert len({*RING_PX}) == 16
    assert {*map(tuple, (-ring).tolist())} == {*RING_PX}  # a corner and its mirror image are seen alike
    assert (np.hypot(*ring.T) >= 4).all()
    assert (np.hypot(*ring.T) < 6.5).all()


# The lens


LENSES = [
    Lens(640, 480, 458.0, 457.0, 367.0, 248.0, "radial-tangential", (-0.28, 0.07, 0.0002, 1.8e-5)),
    Lens(640, 480, 300.0, 300.0, 319.5, 239.5, "equidistant", (-0.01, 0.02, -0.01, 0.002)),
    Lens(640, 480, 160.0, 160.0, 319.5, 239.5, "equidistant", (0.0, 0.0, 0.0, 0.0)),
]


@pytest.mark.parametrize("lens", LENSES, ids=["euroc", "fisheye", "wider than a plane image holds"])
def test_positions_are_those_without_distortion(noise: Noise, lens: Lens) -> None:
    image = noise(width=lens.width, height=lens.height)
    corners, _ = CornerDetector(STEADY, lens, 32767).detect(image)
    every, _ = CornerDetector(STEADY, pinhole(), 32767).detect(image)
    ideal = lens.undistort(every.pixel.astype(np.float32))
    reached = np.isfinite(ideal[:, 0])
    assert np.array_equal(corners.pixel, every.pixel[reached])
    assert np.array_equal(corners.position, ideal[reached])
    assert np.array_equal(corners.appearance, every.appearance[reached])
    assert reached.all() == (lens is not LENSES[2])


@settings(max_examples=20)
@given(capacity=st.integers(1, 400))
def test_what_the_lens_cannot_place_takes_no_part_in_the_budget(noise: Noise, capacity: int) -> None:
    lens = LENSES[2].scaled(160, 120)
    image = noise(width=160, height=120)
    every, _ = CornerDetector(STEADY, lens, 32767).detect(image)
    corners, evicted = CornerDetector(STEADY, lens, capacity).detect(image)
    assert np.isfinite(corners.position).all()
    assert len(corners) + evicted == len(every)
    assert len(corners) == min(capacity, len(every))
