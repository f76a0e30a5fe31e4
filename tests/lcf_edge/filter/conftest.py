"""What the filter's tests drive through: landmarks in space, projected exactly, each with looks of its own."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.config import Config
from lcf_edge.filter import Corners, LineCircleFilter, Motion, line_expert
from lcf_edge.filter.flow import Pinhole
from lcf_edge.filter.heading import Heading
from lcf_edge.filter.inputs import APPEARANCE_SAMPLES
from lcf_edge.filter.situation import Situation, follow
from lcf_edge.filter.tables import PsiTable
from lcf_edge.lens import Lens

LENS = Lens(640, 480, 500.0, 500.0, 319.5, 239.5)

Metres = npt.NDArray[np.float64]
Pair = tuple[float, float]


@dataclass(frozen=True)
class Drive:
    """A vehicle at constant speed and yaw rate among landmarks; iterating gives what each step takes.

    ``points_m``: (n, 3), where the landmarks are at the start, camera axes. ``velocity_mps``: (n, 3) or (3,), of each
    over ground. ``camera_ahead_m``: of the axle, which moves along the heading. ``from_s``, ``until_s``: the landmarks
    move only between these times. ``shake_rad``: by which the camera pitches and yaws to and fro. ``readout_s``: from
    the first row to the last, the middle one at the stamp.
    """

    points_m: Metres
    velocity_mps: Metres = field(default_factory=lambda: np.zeros(3))
    frames: int = 24
    fps: float = 20.0
    speed_mps: float = 2.0
    yaw_rate_radps: float = 0.0
    sigma_rad: float = 0.0
    camera_ahead_m: float = 0.0
    shake_rad: float = 0.0
    readout_s: float = 0.0
    lens: Lens = LENS
    from_s: float = 0.0
    until_s: float = np.inf
    seed: int = 0

    def __iter__(self) -> Iterator[tuple[Corners, Motion]]:
        before = self.pose(0)[0]
        for seq in range(self.frames):
            rotation = self.pose(seq)[0]
            turned = rotation @ before.T
            before = rotation
            yield (
                self.corners(seq),
                Motion(1 / self.fps, turned, self.sigma_rad, self.speed_mps, self.yaw_rate_radps, self.rate_radps(seq)),
            )

    def __add__(self, other: "Drive") -> "Drive":
        """The same drive among the landmarks of both."""
        velocity = [np.broadcast_to(drive.velocity_mps, drive.points_m.shape) for drive in (self, other)]
        points = np.concatenate([self.points_m, other.points_m])
        return replace(self, points_m=points, velocity_mps=np.concatenate(velocity))

    def mirrored(self) -> "Drive":
        """Left and right exchanged; the principal point must be in the middle."""
        flip = np.array([-1.0, 1.0, 1.0])
        return replace(
            self,
            points_m=self.points_m * flip,
            velocity_mps=self.velocity_mps * flip,
            yaw_rate_radps=-self.yaw_rate_radps,
        )

    def rate_radps(self, seq: int) -> tuple[float, float, float]:
        """About the camera's axes: a direction turns by exp(-[ω]× dt)."""
        step = 1e-3
        turned = self.pose(seq + step)[0] @ self.pose(seq - step)[0].T
        x, y, z = (-cv2.Rodrigues(turned)[0].ravel() * self.fps / (2 * step)).tolist()
        return x, y, z

    def shaken(self, time_s: float) -> Metres:
        """(3, 3) rotation of directions by the shaking."""
        angles = np.sin(2 * np.pi * np.array([4.3, 3.1, 0.0]) * time_s) * self.shake_rad
        return np.asarray(cv2.Rodrigues(angles)[0])

    def pose(self, seq: float) -> tuple[Metres, Metres]:
        """Rotation into the camera's axes (3, 3) and its place (3,), in the axes of the start."""
        time_s = seq / self.fps
        turn = self.yaw_rate_radps * time_s
        rotation = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
        reach = self.speed_mps * time_s
        along, aside = (np.sin(turn) / turn, (1 - np.cos(turn)) / turn) if turn else (1.0, 0.0)
        swing = self.camera_ahead_m * np.array([-np.sin(turn), 0, np.cos(turn) - 1])
        return self.shaken(time_s) @ rotation, np.array([-reach * aside, 0, reach * along]) + swing

    def in_camera(self, seq: float) -> Metres:
        """(n, 3) landmarks in the camera's axes."""
        moved_s = np.clip(seq / self.fps, self.from_s, self.until_s) - self.from_s
        rotation, place = self.pose(seq)
        return np.asarray((self.points_m + self.velocity_mps * moved_s - place) @ rotation.T)

    def in_image(self, seq: float) -> npt.NDArray[np.float32]:
        """(n, 2) px of the ideal pinhole; NaN behind the camera."""
        x, y, z = self.in_camera(seq).T
        z = np.where(z > 0.05, z, np.nan)
        lens = self.lens
        return np.stack([lens.cx + lens.fx * x / z, lens.cy + lens.fy * y / z], axis=1).astype(np.float32)

    def read_out(self, seq: int) -> npt.NDArray[np.float32]:
        """(n, 2) px of the input frame, bands of ten rows each at its own time; NaN: not in the image."""
        raw = np.full((len(self.points_m), 2), np.nan, np.float32)
        for top in range(0, self.lens.height, 10):
            late_s = self.readout_s * ((top + 5) / self.lens.height - 0.5)
            then = self.lens.distort(self.in_image(seq + late_s * self.fps))
            inside = (then[:, 1] >= top) & (then[:, 1] < top + 10)
            raw[inside] = then[inside]
        return raw

    def corners(self, seq: int) -> Corners:
        """Those in the image, at whole pixels of the input frame."""
        raw = np.rint(self.read_out(seq) if self.readout_s else self.lens.distort(self.in_image(seq)))
        size = self.lens.width, self.lens.height
        seen = np.flatnonzero(((raw >= 0) & (raw < size)).all(axis=1))  # NaN compares false
        pixel = raw[seen].astype(np.int32)
        return Corners(pixel, self.lens.undistort_pixels(pixel[:, 0], pixel[:, 1]), self.looks[seen])

    @cached_property
    def looks(self) -> npt.NDArray[np.uint8]:
        """(n, 16) no two alike."""
        shape = (len(self.points_m), APPEARANCE_SAMPLES)
        return np.random.default_rng(self.seed).integers(0, 256, shape, np.uint8)

    def landmarks(self, tables: LineCircleFilter) -> npt.NDArray[np.intp]:
        """Which landmark each edge is, by its looks; int (edges,)."""
        number = {looks.tobytes(): landmark for landmark, looks in enumerate(self.looks)}
        return np.array([number[a.tobytes()] for a in tables.edges.appearance[: tables.edges.count]], np.intp)

    def rebels(self, tables: LineCircleFilter) -> set[int]:
        """Landmarks of which an edge is a rebel."""
        return set(self.landmarks(tables)[tables.edges.rebel[: tables.edges.count]].tolist())


def _box(middle_m: Sequence[float], size_m: Sequence[float], landmarks: int = 30, seed: int = 0) -> Metres:
    """(n, 3) landmarks spread over the front of a box."""
    spread = np.random.default_rng(seed).uniform(-0.5, 0.5, (landmarks, 3))
    return np.asarray(np.array(middle_m) + spread * np.array(size_m))


def _clutter(landmarks: int = 300, seed: int = 1) -> Metres:
    """(n, 3) landmarks left and right of a straight path, above the ground, 3 to 16 m ahead."""
    random = np.random.default_rng(seed)
    side = random.choice([-1.0, 1.0], landmarks)
    x, y, z = random.uniform([1.0, -1.5, 3.0], [5.0, 0.2, 16.0], (landmarks, 3)).T
    return np.stack([side * x, y, z], axis=1)


def _situation(*, speed_mps: float = 2.0, yaw_rate_radps: float = 0.0, **changes: Any) -> Situation:
    """A rover on its way that looks straight ahead; ``changes``: fields of ``Situation``."""
    config = Config()
    around = Situation(config, Pinhole(LENS.fx, LENS.fy, LENS.cx, LENS.cy))
    heading = Heading(config.camera, config.vehicle.half_width_m)
    follow(around, heading.ray_x, heading.ray_y, speed_mps, yaw_rate_radps, 0.05)
    for name, value in changes.items():
        setattr(around, name, value)
    return around


def _psi_at(psi: PsiTable, x: npt.NDArray[Any], y: npt.NDArray[Any]) -> npt.NDArray[np.int32]:
    """Row of the ψ region that holds each point, -1: none."""
    line_expert.list_live(psi.columns)
    places = zip(x.tolist(), y.tolist(), strict=True)
    return np.array([line_expert.psi_at(psi.columns, *place) for place in places], np.int32)


def _driven(drive: Drive, config: Config | None = None) -> LineCircleFilter:
    """The filter after a drive."""
    tables = LineCircleFilter(config or Config(), drive.lens)
    for corners, motion in drive:
        tables.step(corners, motion)
    return tables


@pytest.fixture(scope="session")
def lens() -> Lens:
    return LENS


@pytest.fixture(scope="session")
def drive() -> type[Drive]:
    return Drive


@pytest.fixture(scope="session")
def box() -> Callable[..., Metres]:
    return _box


@pytest.fixture(scope="session")
def clutter() -> Callable[..., Metres]:
    return _clutter


@pytest.fixture(scope="session")
def situation() -> Callable[..., Situation]:
    return _situation


@pytest.fixture(scope="session")
def psi_at() -> Callable[..., npt.NDArray[np.int32]]:
    return _psi_at


@pytest.fixture(scope="session")
def driven() -> Callable[..., LineCircleFilter]:
    return _driven
