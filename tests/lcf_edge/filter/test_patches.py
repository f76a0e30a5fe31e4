"""Patches: a piece of the image is found again with its place and its scale, or not at all."""

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from lcf_edge.filter import patches as functions
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.memory import memory_of
from lcf_edge.filter.patches import Patches
from lcf_edge.filter.situation import Situation
from lcf_edge.filter.tables import EdgeTable
from lcf_edge.lens import Lens
from tests.lcf_edge.filter.boards import pattern

LENS = Lens(640, 480, 500.0, 500.0, 319.5, 239.5)
FISHEYE = Lens(640, 480, 330.0, 330.0, 319.5, 239.5, "equidistant", (0.0, 0.0, 0.0, 0.0))
MIDDLE = 330.0, 225.0
HALF_PX = 12.0
MAX_MISSES, LIFE_S = 4, 2.5  # as the module has them

Grey = npt.NDArray[np.uint8]


def born(image: Grey, lens: Lens = LENS, x: float = MIDDLE[0], y: float = MIDDLE[1]) -> Patches | None:
    patches = Patches(2)
    is_born = functions.give_birth(patches, 0, x, y, HALF_PX, memory_of(image.reshape(-1)), ImagePlane(lens))
    return patches if is_born else None


def follow(patches: Patches, image: Grey, lens: Lens = LENS) -> None:
    functions.follow(patches, memory_of(image.reshape(-1)), ImagePlane(lens))


def grown(image: Grey, scale: float, right_px: float = 0.0, down_px: float = 0.0) -> Grey:
    """The image about the middle of the patch, that many times as large, and shifted."""
    x, y = MIDDLE
    matrix = np.array([[scale, 0, x - scale * x + right_px], [0, scale, y - scale * y + down_px]])
    return np.asarray(cv2.warpAffine(image, matrix, (640, 480), flags=cv2.INTER_CUBIC), np.uint8)


@given(
    st.floats(0.95, 1.08), st.floats(-2.5, 2.5), st.floats(-2.5, 2.5), st.floats(0.7, 1.3), st.integers(-30, 30),
    st.integers(0, 50),
)  # fmt: skip
@settings(max_examples=40)
def test_place_and_scale_are_found_to_a_part_of_a_pixel_whatever_the_light(
    scale: float, right_px: float, down_px: float, contrast: float, light: int, seed: int
) -> None:
    image = pattern(640, 480, seed)
    patches = born(image)
    assume(patches is not None)  # else this place shows no scale
    assert patches is not None
    seen = np.clip(128 + light + contrast * (grown(image, scale, right_px, down_px) - 128.0), 0, 255)
    follow(patches, seen.astype(np.uint8))
    assert not patches.misses[0]
    assert (patches.x[0], patches.y[0]) == pytest.approx((MIDDLE[0] + right_px, MIDDLE[1] + down_px), abs=0.25)
    assert patches.scale[0] == pytest.approx(scale, abs=3 * patches.sigma[0])
    assert patches.sigma[0] < 0.03


def test_over_many_images_the_scale_is_that_since_the_first_one() -> None:
    image = pattern(640, 480, 3, 4.0)
    patches = born(image)
    assert patches is not None
    for scale in np.linspace(1.0, 1.8, 30):
        follow(patches, grown(image, scale))
    assert patches.scale[0] == pytest.approx(1.8, abs=0.02)
    assert (patches.x[0], patches.y[0]) == pytest.approx(MIDDLE, abs=0.2)


@given(st.floats(-0.06, 0.06), st.floats(1.0, 1.06), st.integers(0, 50))
@settings(max_examples=30)
def test_what_grows_more_one_way_than_the_other_is_noticed(stretch: float, scale: float, seed: int) -> None:
    """As do things in a row, of which the nearer go outward faster: no one thing grows like that."""
    image = pattern(640, 480, seed)
    patches = born(image)
    assume(patches is not None)
    assert patches is not None
    x, y = MIDDLE
    across, down = scale + stretch, scale - stretch
    matrix = np.array([[across, 0, x - across * x], [0, down, y - down * y]])
    follow(patches, np.asarray(cv2.warpAffine(image, matrix, (640, 480), flags=cv2.INTER_CUBIC), np.uint8))
    assume(not patches.misses[0])
    assert patches.stretch[0] == pytest.approx(stretch, abs=0.02)


def test_the_lens_is_in_what_is_compared() -> None:
    """Towards the rim a fisheye shows things smaller; what turns there has not gone away."""
    image = pattern(1200, 1200, 5, 4.0)
    x, y = np.meshgrid(np.arange(640, dtype=np.float32), np.arange(480, dtype=np.float32))
    ideal = FISHEYE.undistort_pixels(x.ravel().astype(np.int32), y.ravel().astype(np.int32)).reshape(480, 640, 2)

    def shown(right_px: float) -> Grey:
        at = ideal - np.array([right_px - 280, -360], np.float32)
        return np.asarray(cv2.remap(image, at[..., 0], at[..., 1], cv2.INTER_LINEAR), np.uint8)

    patches = born(shown(0), FISHEYE, 340.0, 240.0)
    assert patches is not None
    for right_px in range(2, 162, 2):
        follow(patches, shown(right_px), FISHEYE)
    assert not patches.misses[0]
    assert (patches.x[0], patches.y[0]) == pytest.approx((500.0, 240.0), abs=1.0)
    assert patches.scale[0] == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("nothing", ["plain", "an edge", "at the border"])
def test_what_does_not_show_its_scale_is_no_patch(nothing: str) -> None:
    image = pattern(640, 480, 1)
    if nothing == "plain":
        image[:] = 90
    if nothing == "an edge":
        image[:, :330], image[:, 330:] = 60, 180
    assert born(image, x=5.0 if nothing == "at the border" else MIDDLE[0]) is None


def test_what_is_gone_is_missed_and_ends_after_a_few_images() -> None:
    patches = born(pattern(640, 480, 1))
    assert patches is not None
    for missed in range(1, MAX_MISSES + 1):
        follow(patches, pattern(640, 480, 2))
        assert patches.misses[0] == missed
        assert (patches.x[0], patches.y[0], patches.scale[0]) == (*MIDDLE, 1.0)
    follow(patches, pattern(640, 480, 2))
    assert not patches.active[0]


def test_it_ends_with_its_time(situation: type[Situation]) -> None:
    image = pattern(640, 480, 1)
    old = born(image)
    assert old is not None
    around = situation(speed_mps=0.0)
    while old.active[0]:
        functions.predict(old, around)
        follow(old, image)
    assert old.elapsed_s[0] == pytest.approx(LIFE_S, abs=2 * around.dt_s)


def nearer(situation: type[Situation]) -> Patches:
    """A patch on something that stood 5 m and stands 4 m ahead."""
    image, around = pattern(640, 480, 7, 4.0), situation(speed_mps=2.0)
    patches = born(image)
    assert patches is not None
    for ahead_m in np.arange(0.1, 1.05, 0.1):
        functions.predict(patches, around)
        right_px, down_px = (
            (MIDDLE[k] - (around.focus_x, around.focus_y)[k]) * ahead_m / (5 - ahead_m) for k in range(2)
        )
        follow(patches, grown(image, 5 / (5 - ahead_m), right_px, down_px))
    return patches


def test_what_stands_shows_its_range_by_how_much_it_grew(situation: type[Situation]) -> None:
    """From 5 m to 4 m: s = 5/4, and 1/Z = (s - 1)/ΔZ."""
    patches = nearer(situation)
    assert patches.depth_m[0] == pytest.approx(1.0)
    assert 1 / patches.inverse[0] == pytest.approx(4.0, rel=0.1)
    assert abs(patches.inverse[0] - 0.25) < 3 * patches.inverse_sigma[0]


@pytest.mark.parametrize("factor", [0.5, 3.0])
def test_its_range_is_corrected_once_the_speed_is_known(factor: float, situation: type[Situation]) -> None:
    patches = nearer(situation)
    before, way_m, sigma = patches.inverse[0], patches.depth_m[0], patches.inverse_sigma[0]
    functions.correct_way(patches, factor)
    assert patches.depth_m[0] == pytest.approx(factor * way_m)
    assert factor * patches.inverse[0] == pytest.approx(before)
    assert factor * patches.inverse_sigma[0] == pytest.approx(sigma)


@pytest.mark.parametrize("factor", [0.0, -0.4])
def test_without_a_way_ahead_it_has_no_range_and_ends(factor: float, situation: type[Situation]) -> None:
    patches = nearer(situation)
    functions.correct_way(patches, factor)
    assert not patches.active[0]


def renew(patches: Patches, image: Grey, around: Situation, x: float = MIDDLE[0], y: float = MIDDLE[1]) -> None:
    """With one edge in the image, at ``x``, ``y``."""
    edges = EdgeTable(1, 1, 1)
    row = edges.append(1).start
    edges.x[row], edges.y[row], edges.matched[row] = x, y, True
    functions.renew(patches, edges.columns, memory_of(image.reshape(-1)), ImagePlane(LENS), around)


@pytest.mark.parametrize(
    ("focus_x", "yaw_rate_radps", "is_kept"),
    [(MIDDLE[0], 0.0, True), (MIDDLE[0], 0.5, True), (MIDDLE[0] - 200, 0.0, False), (MIDDLE[0] - 200, -0.5, True)],
    ids=["straight ahead", "straight ahead, in a turn", "beside the path", "on the arc of a turn"],
)
def test_a_patch_that_is_passed_well_aside_makes_room(
    situation: type[Situation], focus_x: float, yaw_rate_radps: float, is_kept: bool
) -> None:
    """A vehicle that weaves keeps the patches straight ahead: its turn is soon over."""
    image = pattern(640, 480, 1)
    patches = born(image)
    assert patches is not None
    renew(patches, image, situation(focus_x=focus_x, yaw_rate_radps=yaw_rate_radps), y=0.0)
    assert bool(patches.active[0]) == is_kept


@pytest.mark.parametrize(("age_s", "has_successor"), [(0.4 * LIFE_S, False), (0.6 * LIFE_S, True)])
def test_an_old_patch_gets_a_successor_that_has_grown_when_it_ends(
    situation: type[Situation], age_s: float, has_successor: bool
) -> None:
    image, around = pattern(640, 480, 1), situation(speed_mps=0.1, focus_x=MIDDLE[0], focus_y=MIDDLE[1])
    patches = born(image)
    assert patches is not None
    while patches.elapsed_s[0] < age_s:
        functions.predict(patches, around)
        follow(patches, image)
    renew(patches, image, around)
    assert bool(patches.active[1]) == has_successor
    if has_successor:
        assert (patches.x[1], patches.y[1]) == MIDDLE
