"""Rotation from the image alone, on images that turned by what is known."""

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcf_edge.ego_motion.image_rotation import ImageRotation, Turn
from lcf_edge.lens import Lens
from lcf_edge.small_image import SmallImage

Grey = npt.NDArray[np.uint8]

LENSES = {
    "640x480": Lens(640, 480, 500.0, 500.0, 319.5, 239.5),
    "160x120": Lens(160, 120, 125.0, 125.0, 79.5, 59.5),
    "1280x720": Lens(1280, 720, 900.0, 900.0, 639.5, 359.5),
    "752x480, barrel": Lens(752, 480, 460.0, 460.0, 375.5, 239.5, "radial-tangential", (-0.28, 0.07, 0.0, 0.0)),
    "640x480, fisheye": Lens(640, 480, 280.0, 280.0, 319.5, 239.5, "equidistant", (0.0,) * 4),
}
HUNDRED_DEGREES_PER_S = np.radians(100) / 20  # an image, at 20 frames a second


def sky_and_walls(seed: int = 0) -> Grey:
    """A far panorama, (1024, 2048), 2.5 mrad a px: marks of all sizes."""
    random = np.random.default_rng(seed)
    whole = np.zeros((1024, 2048), np.float32)
    for size in (8, 32, 128):
        marks = random.normal(0, 30, (1024 // size, 2048 // size)).astype(np.float32)
        whole += cv2.resize(marks, (2048, 1024), interpolation=cv2.INTER_NEAREST)
    return np.clip(whole + 128, 0, 255).astype(np.uint8)


PANORAMA = sky_and_walls()


def image(lens: Lens, turned_rad: npt.ArrayLike = (0.0, 0.0, 0.0), panorama: Grey = PANORAMA) -> Grey:
    """What a camera sees whose directions have turned by the vector since the start; (height, width)."""
    x, y = np.meshgrid(np.arange(lens.width), np.arange(lens.height))
    ideal = lens.undistort(np.stack((x.ravel(), y.ravel()), axis=1).astype(np.float32)).astype(np.float64)
    rays = np.stack([(ideal[:, 0] - lens.cx) / lens.fx, (ideal[:, 1] - lens.cy) / lens.fy, np.ones(len(ideal))])
    far = cv2.Rodrigues(np.array(turned_rad, float))[0].T @ np.nan_to_num(rays)
    azimuth, elevation = np.arctan2(far[0], far[2]), np.arctan2(far[1], np.hypot(far[0], far[2]))
    at = np.stack([azimuth / 0.0025 + 1024, elevation / 0.0025 + 512], axis=1).astype(np.float32)
    at = at.reshape(lens.height, lens.width, 2)
    return np.asarray(cv2.remap(panorama, at[..., 0], at[..., 1], cv2.INTER_LINEAR), np.uint8)


def small(image: Grey) -> Grey:
    return SmallImage(image.shape[1], image.shape[0]).of(image)


def seen(lens: Lens, before: Grey, after: Grey) -> Turn | None:
    rotation = ImageRotation(lens)
    assert rotation.turn(small(before)) is None
    return rotation.turn(small(after))


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
@pytest.mark.parametrize("share", [(0.0, 0.0), (0.0, 1.0), (0.0, -1.0), (0.7, 0.7), (-0.4, 0.1)])
def test_up_to_100_degrees_a_second_are_reported_within_the_stated_sigma(
    lens: Lens, share: tuple[float, float]
) -> None:
    truth = np.array([*share, 0.0]) * HUNDRED_DEGREES_PER_S
    turn = seen(lens, image(lens), image(lens, truth))
    assert turn is not None
    assert (np.abs(turn.turn_rad - truth)[:2] < 2 * turn.sigma_rad[:2]).all()
    assert (turn.sigma_rad[:2] < 0.015).all()


@given(
    st.floats(-1, 1), st.floats(-1, 1), st.floats(-0.5, 0.5), st.integers(0, 5), st.integers(0, 8), st.floats(0.6, 1.4)
)
@settings(max_examples=40)
def test_noise_light_and_roll_change_little(
    pitch: float, yaw: float, roll: float, seed: int, noise: int, gain: float
) -> None:
    lens, random = LENSES["640x480"], np.random.default_rng(seed)
    truth = np.array([pitch, yaw, 0.5 * roll]) * HUNDRED_DEGREES_PER_S
    panorama = sky_and_walls(seed)
    after = image(lens, truth, panorama) * gain + random.normal(0, noise, (480, 640))
    turn = seen(lens, image(lens, (0.0, 0.0, 0.0), panorama), np.clip(after, 0, 255).astype(np.uint8))
    assert turn is not None
    assert (np.abs(turn.turn_rad - truth)[:2] < 3 * turn.sigma_rad[:2]).all()


@pytest.mark.parametrize("share", [0.2, 0.35])
def test_something_large_that_moves_by_itself_is_not_followed(share: float) -> None:
    lens = LENSES["640x480"]
    truth = np.array([0.0, 0.03, 0.0])
    before, after = image(lens), image(lens, truth)
    width = round(share * lens.width)
    body = sky_and_walls(7)[: lens.height, : width + 40]
    before[:, 100 : 100 + width] = body[:, :width]
    after[:, 100 : 100 + width] = body[:, 25 : 25 + width]
    turn = seen(lens, before, after)
    assert turn is not None
    assert (np.abs(turn.turn_rad - truth)[:2] < 3 * turn.sigma_rad[:2]).all()


def test_what_comes_nearer_turns_nothing() -> None:
    lens = LENSES["640x480"]
    whole = image(lens)
    nearer = cv2.resize(whole[12:-12, 16:-16], (640, 480), interpolation=cv2.INTER_LINEAR)  # 5 % in one image
    turn = seen(lens, whole, np.asarray(nearer, np.uint8))
    assert turn is not None
    assert (np.abs(turn.turn_rad)[:2] < turn.sigma_rad[:2]).all()


@pytest.mark.parametrize("what", ["plain", "dark", "other noise", "another place"])
def test_images_that_share_nothing_show_no_rotation(what: str) -> None:
    lens, random = LENSES["640x480"], np.random.default_rng(0)
    before, after = {
        "plain": (np.full((480, 640), 120, np.uint8),) * 2,
        "dark": (np.zeros((480, 640), np.uint8),) * 2,
        "other noise": tuple(random.integers(0, 256, (2, 480, 640), np.uint8)),
        "another place": (image(lens), image(lens, (0.0, 0.0, 0.0), sky_and_walls(9))),
    }[what]
    assert seen(lens, before, after) is None


def test_roll_is_not_reported() -> None:
    lens = LENSES["640x480"]
    turn = seen(lens, image(lens), image(lens))
    assert turn is not None
    assert turn.sigma_rad[2] > 1


def test_after_forgetting_one_image_shows_nothing() -> None:
    lens = LENSES["160x120"]
    rotation = ImageRotation(lens)
    rotation.turn(small(image(lens)))
    rotation.forget()
    assert rotation.turn(small(image(lens))) is None
    assert rotation.turn(small(image(lens))) is not None


@given(width=st.integers(8, 400), height=st.integers(8, 400))
@settings(max_examples=30)
def test_any_size_of_image_works(width: int, height: int) -> None:
    lens = Lens(width, height, float(width), float(width), width / 2, height / 2)
    image = np.random.default_rng(0).integers(0, 256, (height, width), np.uint8)
    turn = seen(lens, image, image)
    if turn is not None:
        assert np.isfinite(turn.turn_rad).all()
        assert (turn.sigma_rad > 0).all()
