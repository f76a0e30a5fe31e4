"""What is calibrated with: boards before a known lens, a camera that turns in a textured room, an IMU beside it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from drivers.samples import Frame, ImuSample
from lcf_edge.calibrate.guide import Guide
from lcf_edge.calibrate.image_rotation import Turn
from lcf_edge.calibrate.target import Sighting, Target
from lcf_edge.calibrate.views import Views
from lcf_edge.lens import Lens
from lcf_edge.rendered.trajectory import rotation as attitudes

Floats = npt.NDArray[np.float64]
Grey = npt.NDArray[np.uint8]

START_NS = 1_700_000_000_000_000_000
GRAVITY_MPS2 = 9.81
ROOM_LENS = Lens(240, 180, 210.0, 210.0, 119.5, 89.5)
_PIXELS_PER_SQUARE = 64


def rotation(*vector_rad: float) -> Floats:
    """By a rotation vector."""
    return np.asarray(cv2.Rodrigues(np.array(vector_rad))[0], np.float64)


@dataclass
class Given:
    """A source that gives what it was given. ``known``: its lens."""

    given: Sequence[Frame | ImuSample]
    known: Lens | None = None
    film: bool = True
    live: bool = False

    def items(self) -> Iterator[Frame | ImuSample]:
        return iter(self.given)

    def lens(self, width: int, height: int) -> Lens | None:
        return self.known.scaled(width, height) if self.known else None


@dataclass(frozen=True)
class Studio:
    """Images of a board through a lens, anti-aliased, with noise."""

    board: Target
    lens: Lens
    noise: float = 2.0

    @cached_property
    def _rays(self) -> Floats:
        """(2 height, 2 width, 3), two to a pixel each way."""
        x, y = np.meshgrid(np.arange(2 * self.lens.width), np.arange(2 * self.lens.height))
        at = np.stack([x.ravel(), y.ravel()], axis=1) / 2 - 0.25
        ideal = self.lens.undistort(at.astype(np.float32)).astype(np.float64)
        rays = (ideal - (self.lens.cx, self.lens.cy)) / (self.lens.fx, self.lens.fy)
        return np.column_stack([rays, np.ones(len(rays))]).reshape(2 * self.lens.height, 2 * self.lens.width, 3)

    @cached_property
    def _drawn(self) -> Grey:
        """With a white margin of one square."""
        margin = (_PIXELS_PER_SQUARE,) * 4
        drawn = cv2.copyMakeBorder(self.board.draw(_PIXELS_PER_SQUARE), *margin, cv2.BORDER_CONSTANT, value=255)
        return np.asarray(drawn, np.uint8)

    @property
    def middle(self) -> Floats:
        """Of the board, m."""
        return np.asarray((self.board.places.min(axis=0) + self.board.places.max(axis=0)) / 2, np.float64)

    def image(self, turn: Floats, shift: Floats, seed: int = 0) -> Grey:
        """The board with its middle at ``shift`` (3,) m, turned by ``turn`` (3, 3)."""
        plane = np.column_stack([turn[:, 0], turn[:, 1], shift - turn @ self.middle])
        at = self._rays @ np.linalg.inv(plane).T
        with np.errstate(divide="ignore", invalid="ignore"):
            # A place on the board is a corner's distance from its first inner corner.
            on_board = at[..., :2] / at[..., 2:] / self.board.square_m + 2
        texels = (on_board * _PIXELS_PER_SQUARE - 0.5).astype(np.float32)
        texels[~np.isfinite(texels).all(axis=2) | (at[..., 2] <= 0)] = -1e4
        seen = cv2.remap(
            self._drawn,
            texels[..., 0],
            texels[..., 1],
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=90,
        )
        small = cv2.resize(seen, (self.lens.width, self.lens.height), interpolation=cv2.INTER_AREA)
        grain = np.random.default_rng(seed).normal(0, self.noise, small.shape)
        return np.clip(20 + small * 0.85 + grain, 0, 255).astype(np.uint8)

    def poses(
        self, count: int, *, tilt_rad: float = 0.6, spread: float = 1.0, seed: int = 1
    ) -> Iterator[tuple[Floats, Floats]]:
        """The board all over the image, tilted each way: rotation and shift of each view."""
        random = np.random.default_rng(seed)
        wide = np.ptp(self.board.places[:, 0])
        for seq in range(count):
            u, v = np.array([seq % 3 - 1, seq // 3 % 3 - 1]) * 0.27 * spread + random.uniform(-0.04, 0.04, 2) * spread
            depth = self.lens.fx * wide / (0.42 * self.lens.width) * random.uniform(0.9, 1.3)
            x, y = u * self.lens.width / self.lens.fx, v * self.lens.height / self.lens.fy
            turn = rotation(*random.uniform(-tilt_rad, tilt_rad, 2), random.uniform(-0.2, 0.2))
            yield turn, depth * np.array([x, y, 1.0])

    def views(self, count: int) -> list[Frame]:
        """Images of the board in different poses."""
        return [
            Frame(START_NS + seq * 10**9, seq, self.image(turn, shift, seq))
            for seq, (turn, shift) in enumerate(self.poses(count))
        ]

    def sightings(self, count: int, noise_px: float = 0.1, **poses: float) -> Views:
        """What would be found in such images, and in ones that no image holds."""
        random = np.random.default_rng(2)
        views = Views(self.board, film=False, size=(self.lens.width, self.lens.height))
        for turn, shift in self.poses(count, **poses):
            rays = (self.board.places - self.middle) @ turn.T + shift
            ideal = rays[:, :2] / rays[:, 2:] * (self.lens.fx, self.lens.fy) + (self.lens.cx, self.lens.cy)
            corners = self.lens.distort(ideal.astype(np.float32)) + random.normal(0, noise_px, ideal.shape)
            views.kept.append(Sighting(corners.astype(np.float32), np.arange(len(ideal)), 1.0))
        return views


@dataclass(frozen=True)
class Turntable:
    """A camera that turns in the middle of a large room, and an IMU beside it.

    ``angles``: times (n,) s to yaw, pitch, roll (n, 3) about y, x, z of the camera. ``axes``: the IMU's axes to the
    camera's. ``offset_s``: camera time less IMU time.
    """

    angles: Callable[[Floats], Floats]
    seconds: float
    axes: Floats = field(default_factory=lambda: np.eye(3))
    offset_s: float = 0.0
    bias_radps: tuple[float, float, float] = (0.01, -0.02, 0.015)
    gyro_noise_radps: float = 0.005
    accel_noise_mps2: float = 0.05
    lens: Lens = ROOM_LENS
    fps: float = 20.0
    imu_hz: float = 200.0

    def attitude(self, times_s: Floats) -> Floats:
        """(n, 3, 3) camera to room."""
        return attitudes(*self.angles(times_s).T)

    def rates(self, times_s: Floats, step_s: float) -> Floats:
        """(n, 3) rad/s, camera axes, mean over ``step_s`` from each time on."""
        turned = np.einsum("nji,njk->nik", self.attitude(times_s), self.attitude(times_s + step_s))
        half = np.stack([turned[:, 2, 1], turned[:, 0, 2], turned[:, 1, 0]], axis=1)
        sine = half - np.stack([turned[:, 1, 2], turned[:, 2, 0], turned[:, 0, 1]], axis=1)
        angle = np.arcsin(np.clip(np.linalg.norm(sine, axis=1) / 2, 0, 1))
        return sine / (2 * np.sinc(angle / np.pi)[:, None]) / step_s

    def samples(self) -> list[ImuSample]:
        """In the IMU's axes, from 1 s before the first image to 1 s after the last."""
        random = np.random.default_rng(3)
        times_s = np.arange(-1.0, self.seconds + 1.0, 1 / self.imu_hz)
        rates = self.rates(times_s - 5e-4, 1e-3)
        force = np.einsum("nji,j->ni", self.attitude(times_s), (0.0, -GRAVITY_MPS2, 0.0))
        gyro = rates @ self.axes + self.bias_radps + random.normal(0, self.gyro_noise_radps, rates.shape)
        accel = force @ self.axes + random.normal(0, self.accel_noise_mps2, force.shape)
        return [
            ImuSample(START_NS + round((time_s - self.offset_s) * 1e9), tuple(rate), tuple(specific))
            for time_s, rate, specific in zip(times_s.tolist(), gyro.tolist(), accel.tolist(), strict=True)
        ]

    def turns(self, noise_radps: float = 0.02) -> list[Turn]:
        """What a camera would make of it."""
        times_s = np.arange(round(self.seconds * self.fps)) / self.fps
        rates = self.rates(times_s, 1 / self.fps)
        rates += np.random.default_rng(4).normal(0, noise_radps, rates.shape)
        stamps_ns = [START_NS + round(time_s * 1e9) for time_s in (*times_s.tolist(), self.seconds)]
        return [Turn(*span, rate, noise_radps) for span, rate in zip(pairwise(stamps_ns), rates, strict=True)]

    def frames(self) -> list[Frame]:
        """Images of the room."""
        times_s = np.arange(round(self.seconds * self.fps)) / self.fps
        x, y = np.meshgrid(np.arange(self.lens.width), np.arange(self.lens.height))
        ideal = self.lens.undistort_pixels(x.ravel(), y.ravel()).astype(np.float64)
        rays = np.column_stack([(ideal - (self.lens.cx, self.lens.cy)) / self.lens.fx, np.ones(len(ideal))])
        clutter = np.random.default_rng(5).integers(0, 256, (120, 240), np.uint8)
        wall = cv2.resize(cv2.GaussianBlur(clutter, (3, 3), 0), (1920, 960), interpolation=cv2.INTER_CUBIC)
        frames = []
        for seq, (time_s, attitude) in enumerate(zip(times_s.tolist(), self.attitude(times_s), strict=True)):
            right, down, ahead = (rays @ attitude.T).astype(np.float32).T
            across = (np.arctan2(right, ahead) / np.float32(2 * np.pi) + 0.5) * wall.shape[1]
            along = (np.arctan2(down, np.hypot(right, ahead)) / np.float32(np.pi) + 0.5) * wall.shape[0]
            at = (values.reshape(self.lens.height, self.lens.width) for values in (across, along))
            image = cv2.remap(wall, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
            frames.append(Frame(START_NS + round(time_s * 1e9), seq, np.asarray(image, np.uint8)))
        return frames


def shaken(times_s: Floats) -> Floats:
    """To and fro about all axes, unevenly; up to about 1 rad/s."""
    waves = ((0.31, 0.47, 0.25, 0.9), (0.45, 0.61, 0.2, 1.3), (0.23, 0.37, 0.2, 1.1))
    columns = [a * np.sin(2 * np.pi * f * times_s) + b * np.sin(2 * np.pi * g * times_s + 1) for f, a, b, g in waves]
    return np.stack(columns, axis=1) * 0.5


def in_order(*items: Sequence[Frame | ImuSample], lens: Lens | None = None) -> Given:
    """As a recording delivers them."""
    return Given(sorted((item for some in items for item in some), key=lambda item: item.stamp_ns), lens)


@pytest.fixture(scope="session")
def guide() -> Guide:
    return Guide()


@pytest.fixture(scope="session")
def studio() -> type[Studio]:
    return Studio


@pytest.fixture(scope="session")
def turntable() -> Callable[..., Turntable]:
    """Shaken about all axes unless told otherwise."""

    def make(angles: Callable[[Floats], Floats] = shaken, seconds: float = 6.0, **known: Any) -> Turntable:
        return Turntable(angles, seconds, **known)

    return make


@pytest.fixture(scope="session")
def given() -> Callable[..., Given]:
    return in_order
