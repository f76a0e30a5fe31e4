"""Own parts in view: nothing is looked for there."""

from collections.abc import Callable

import cv2
import msgspec
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.methods import FilterMethod
from benchmarks.playing import config_of, feed
from lcf_edge.config import Camera, Filter
from lcf_edge.corners.detector import CornerDetector
from lcf_edge.corners.own_parts import MARGIN_PX, in_sight, polygons
from lcf_edge.lens import Lens
from lcf_edge.messages import Kind
from lcf_edge.rendered import scenes

TRIANGLE = [[100.0, 479.0], [320.0, 240.0], [540.0, 479.0]]


def test_without_a_mask_everything_is_in_sight() -> None:
    assert in_sight(Camera(), 640, 480) is None
    assert polygons(Camera(), 640, 480) == ()


@given(size=st.sampled_from([(640, 480), (320, 240), (1280, 960), (160, 480)]))
def test_polygons_scale_with_the_image(size: tuple[int, int]) -> None:
    (scaled,) = polygons(Camera(mask=[TRIANGLE]), *size)
    expected = (np.array(TRIANGLE) + 0.5) * np.array(size) / (640, 480) - 0.5  # pixel centres at whole numbers
    np.testing.assert_allclose(scaled, expected, atol=1e-4)


def test_what_lies_inside_or_next_to_a_polygon_is_hidden() -> None:
    seen = in_sight(Camera(mask=[TRIANGLE, [[0, 0], [50, 0], [50, 50]]]), 640, 480)
    assert seen is not None
    assert (seen[400, 320], seen[10, 40]) == (0, 0)  # in the one and in the other
    assert (seen[240 - MARGIN_PX, 320], seen[240 - MARGIN_PX - 3, 320]) == (0, 255)
    assert (seen[100, 320], seen[400, 20]) == (255, 255)


def test_where_polygons_overlap_is_hidden_too() -> None:
    seen = in_sight(Camera(mask=[TRIANGLE, TRIANGLE]), 640, 480)
    assert seen is not None
    assert seen[400, 320] == 0


@pytest.mark.parametrize("adaptive", [True, False])
def test_no_corner_is_found_on_own_parts_and_all_the_others_are(
    noise: Callable[..., npt.NDArray[np.uint8]], adaptive: bool
) -> None:
    image = np.asarray(cv2.GaussianBlur(noise(), (0, 0), 1.5), np.uint8)
    settings = Filter(fast_adaptive=adaptive, fast_threshold=20)
    lens = Lens(640, 480, 500.0, 500.0, 319.5, 239.5)
    seen = in_sight(Camera(mask=[TRIANGLE]), 640, 480)
    assert seen is not None
    masked, _ = CornerDetector(settings, lens, 32767, seen).detect(image)
    every, _ = CornerDetector(settings, lens, 32767).detect(image)
    x, y = masked.pixel.T
    assert (seen[y, x] > 0).all()
    if not adaptive:
        x, y = every.pixel.T
        assert np.array_equal(masked.pixel, every.pixel[seen[y, x] > 0])


def rebels_on_own_parts(seed: int) -> tuple[list[int], list[int]]:
    """How many rebels each frame has on the own bumper and on nothing that moves: with a mask, and without."""
    drive = scenes.make("own_bumper", seed, seconds=3.0)
    masked = config_of(drive)
    bare = msgspec.structs.replace(masked, camera=msgspec.structs.replace(masked.camera, mask=[]))
    lens = Lens.from_config(masked.camera, 640, 480)
    methods = {"masked": FilterMethod(masked, lens), "bare": FilterMethod(bare, lens)}
    on_own_parts: dict[str, list[int]] = {name: [] for name in methods}
    seen = in_sight(masked.camera, 640, 480)
    assert seen is not None
    for moment in feed(drive, methods):
        assert moment.truth is not None
        free = seen > 0
        for x, y, width, height in (thing.box for thing in moment.truth.objects if thing.moving):
            free[max(0, int(y) - 8) : int(y + height) + 9, max(0, int(x) - 8) : int(x + width) + 9] = True
        for name, scene in moment.scenes.items():
            rebels = scene.circles[(scene.circles["kind"] == Kind.REBEL) & (scene.circles["trust"] >= 3)]
            on_own_parts[name].append(np.count_nonzero(~free[rebels["y"].astype(int), rebels["x"].astype(int)]))
    return on_own_parts["masked"], on_own_parts["bare"]


@pytest.fixture(scope="module")
def drives() -> list[tuple[list[int], list[int]]]:
    """What three drives have."""
    return [rebels_on_own_parts(seed) for seed in (1, 2, 3)]


def test_where_own_parts_are_masked_they_are_never_rebels(drives: list[tuple[list[int], list[int]]]) -> None:
    assert [sum(masked) for masked, _ in drives] == [0, 0, 0]


def test_own_parts_are_rebels_for_a_second_at_most(drives: list[tuple[list[int], list[int]]]) -> None:
    _, bare = drives[0]
    second = len(bare) // 3
    assert sum(bare[:second]) > 0
    assert sum(bare[second:]) == 0


def test_at_worst_a_few_are_after_it(drives: list[tuple[list[int], list[int]]]) -> None:
    second = len(drives[0][1]) // 3
    at_first, later = (sum(sum(bare[part]) for _, bare in drives) for part in (slice(second), slice(second, None)))
    assert at_first > 10
    assert later < at_first / 4  # in twice the time
