"""What several tests drive with: a wall of clutter that comes nearer, something that crosses, any lens; a free port."""

import os
import socket
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import settings

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.compilation import extension
from lcf_edge.lens import Lens

# A shared machine may be slow at any moment; what failed once is printed, not kept in the tree.
# Emulated (make test-arm64), each example takes twenty times as long.
settings.register_profile("lcf-edge", deadline=None, database=None, print_blob=True, derandomize=True)
settings.register_profile("emulated", settings.get_profile("lcf-edge"), max_examples=20)
settings.load_profile("lcf-edge")

pytest_plugins = ("tests.lcf_edge.chromium",)

Grey = npt.NDArray[np.uint8]
Item = Frame | ImuSample | SpeedSample

PINHOLE = Lens(320, 240, 250.0, 250.0, 159.5, 119.5)
IMU_HZ = 100
GRAVITY_MPS2 = 9.81


def pytest_configure() -> None:
    """No test runs uncompiled by mistake: an extension older than its sources is not used."""
    compiled = extension()
    if compiled.outdated or (compiled.reason and os.environ.get("LCF_EDGE_COMPILED") == "1"):
        raise pytest.UsageError(f"the filter is not compiled: {compiled.reason}; {compiled.command}")


@dataclass(frozen=True)
class Approach:
    """A straight drive at ``speed_mps`` towards a wall that fills the image, ``wall_m`` away at the start.

    In front of it a square of 48 px goes to the right at 80 px/s.
    Iterating gives images, IMU samples and speeds in the order in which a recording delivers them.
    """

    frames: int = 16
    lens: Lens = PINHOLE
    fps: float = 20.0
    speed_mps: float = 2.0
    wall_m: float = 8.0
    start_ns: int = 1_700_000_000_000_000_000
    imu: bool = True
    odometry: bool = True

    def __iter__(self) -> Iterator[Item]:
        step_ns = round(1e9 / IMU_HZ)
        sample_ns = self.start_ns
        for seq in range(self.frames):
            frame_ns = self.stamp_ns(seq)
            while sample_ns <= frame_ns + step_ns:
                if self.imu:
                    yield ImuSample(sample_ns, (0.0, 0.0, 0.0), (0.0, -GRAVITY_MPS2, 0.0))
                if self.odometry:
                    yield SpeedSample(sample_ns, self.speed_mps, 0.0)
                sample_ns += step_ns
            yield Frame(frame_ns, seq, self.image(seq))

    def stamp_ns(self, seq: int) -> int:
        """Time of an image."""
        return self.start_ns + round(seq * 1e9 / self.fps)

    def image(self, seq: int) -> Grey:
        """(height, width); black where the lens sees nothing."""
        scale = (self.wall_m - self.speed_mps * seq / self.fps) / self.wall_m
        middle = np.float32(self._wall.shape[0] / 2)
        at = self._rays * np.float32(scale * PINHOLE.fx) + middle
        seen = cv2.remap(self._wall, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        image = np.asarray(np.where(np.isfinite(at[..., 0]), seen, 0), np.uint8)
        x = 60 + round(80 * seq / self.fps)
        image[60:108, x : x + 48] = self._wall[:48, :48]
        return image

    @cached_property
    def _rays(self) -> npt.NDArray[np.float32]:
        """(height, width, 2): x/z, y/z of every pixel."""
        lens = self.lens
        x, y = np.meshgrid(np.arange(lens.width), np.arange(lens.height))
        ideal = lens.undistort(np.stack((x.ravel(), y.ravel()), axis=1).astype(np.float32))
        rays = (ideal - (lens.cx, lens.cy)) / (lens.fx, lens.fy)
        return np.asarray(rays.reshape(lens.height, lens.width, 2), np.float32)

    @cached_property
    def _wall(self) -> Grey:
        """Patches of 12 px that meet in good corners."""
        patches = np.random.default_rng(1).integers(20, 236, (64, 64), np.uint8)
        return np.asarray(cv2.GaussianBlur(np.kron(patches, np.ones((12, 12), np.uint8)), (3, 3), 0), np.uint8)


@pytest.fixture
def endpoint() -> str:
    """A free one on loopback, in place of the usual."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


@pytest.fixture(scope="session")
def approach() -> Callable[..., Approach]:
    return Approach


@pytest.fixture(scope="session")
def noise() -> Callable[..., Grey]:
    """Images in which everything is a corner."""

    def draw(seed: int = 0, width: int = 640, height: int = 480) -> Grey:
        return np.random.default_rng(seed).integers(0, 256, (height, width), np.uint8)

    return draw
