"""A large body straight ahead is found in the downscaled image, with its time to contact, without a single corner."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.config import Camera, Config, Vehicle
from lcf_edge.filter import LineCircleFilter, Motion
from lcf_edge.filter.inputs import NO_CORNERS
from lcf_edge.messages import Cause
from tests.lcf_edge.filter.test_coarse_motion import BACKGROUND, LENS, SMALL

CONFIG = Config(camera=Camera(height_m=0.5), vehicle=Vehicle(half_width_m=0.4, height_m=1.2))
DT_S = 0.05


@dataclass(frozen=True)
class Body:
    """Blobs on something flat that faces the camera, before a far background; iterating gives motion and image.

    ``left_m``, ``right_m``, ``low_m``, ``high_m``: its edges, from O. ``from_m``: its range in the first image.
    ``speed_mps``: of the vehicle, ``measured_mps``: if that is another. ``own_mps``: of the body, to the right and
    ahead. ``gap_m``: half width of a hole in its middle. ``contrast``: of its blobs, grey levels.
    """

    left_m: float = -0.5
    right_m: float = 0.5
    low_m: float = -0.5
    high_m: float = 0.5
    from_m: float = 4.0
    speed_mps: float = 2.0
    measured_mps: float | None = None
    own_mps: tuple[float, float] = (0.0, 0.0)
    gap_m: float = 0.0
    contrast: float = 25.0
    frames: int = 26

    def range_m(self, seq: int) -> float:
        return self.from_m + (self.own_mps[1] - self.speed_mps) * seq * DT_S

    def __iter__(self) -> Iterator[tuple[Motion, npt.NDArray[np.uint8]]]:
        random = np.random.default_rng(2)
        columns, rows = np.meshgrid(np.arange(LENS.width) - LENS.cx, LENS.cy - np.arange(LENS.height))
        for seq in range(self.frames):
            across_m = columns * self.range_m(seq) / LENS.fx - self.own_mps[0] * seq * DT_S
            up_m = rows * self.range_m(seq) / LENS.fy
            inside = (across_m > self.left_m) & (across_m < self.right_m) & (up_m > self.low_m) & (up_m < self.high_m)
            inside &= (np.abs(across_m) >= self.gap_m) if self.gap_m else True
            place = np.clip(np.stack([up_m, across_m]) * 400 + 240, 0, 479).astype(int)
            paint = 90 + self.contrast * (BACKGROUND[:, : LENS.width][place[0], place[1]] - 150.0) / 25
            image = np.where(inside, paint, BACKGROUND[:, LENS.width : 2 * LENS.width]) + random.normal(
                0, 2, rows.shape
            )
            measured_mps = self.speed_mps if self.measured_mps is None else self.measured_mps
            motion = Motion(DT_S, np.eye(3), 0.0, measured_mps, 0.0)
            yield motion, np.asarray(np.clip(image, 0, 255), np.uint8)


def driven(body: Body, config: Config = CONFIG) -> Iterator[tuple[int, LineCircleFilter]]:
    """The filter after each image."""
    tables = LineCircleFilter(config, LENS)
    for seq, (motion, image) in enumerate(body):
        tables.step(NO_CORNERS, motion, image, SMALL.of(image))
        yield seq, tables


def contacts(body: Body, config: Config = CONFIG) -> list[tuple[float, float]]:
    """Time to contact by the circle that is met soonest, and the true one, of each image with such a circle."""
    found, closing_mps = [], body.speed_mps - body.own_mps[1]
    for seq, tables in driven(body, config):
        rebel = tables.rebel
        coming = rebel.active & (rebel.trust >= 3) & (rebel.cause == Cause.INCOMING)
        if coming.any():
            true_s = body.range_m(seq) / closing_mps if closing_mps > 0 else math.inf
            found.append((float(rebel.ttc[coming].min()), true_s))
    return found


@pytest.mark.parametrize(
    "body",
    [
        pytest.param(Body(), id="stands"),
        pytest.param(Body(contrast=10.0), id="stands, with little contrast"),
        pytest.param(Body(measured_mps=math.nan), id="stands, at a speed that is not known"),
        pytest.param(Body(own_mps=(0.0, 0.8), from_m=2.4), id="leads, and is slower"),
        pytest.param(Body(own_mps=(0.0, -1.0), from_m=6.0), id="comes towards the vehicle"),
    ],
)
def test_a_body_that_fills_the_way_is_met_when_it_is_met(body: Body) -> None:
    found = contacts(body)
    assert len(found) >= 10
    assert [said for said, _ in found[3:]] == pytest.approx([true for _, true in found[3:]], rel=0.2)


def test_it_is_an_object_in_the_middle_of_the_way() -> None:
    for seq, tables in driven(Body()):
        if seq == 25:
            objects = tables.objects
            (o,) = np.flatnonzero(objects.active & (objects.trust >= 3))
            assert objects.ttc[o] == pytest.approx(Body().range_m(25) / 2.0, rel=0.2)
            assert abs(objects.lateral[o]) < 0.2


def test_a_body_whose_one_half_is_plain_is_found_by_how_the_other_grows() -> None:
    assert contacts(Body(left_m=0.05, right_m=0.6))


@pytest.mark.parametrize("right_mps", [0.5, 1.0])
def test_what_moves_aside_does_not_come(right_mps: float) -> None:
    assert not contacts(Body(left_m=0.1, right_m=0.6, own_mps=(right_mps, 2.0)))


def test_between_two_posts_the_way_is_free() -> None:
    assert not contacts(Body(left_m=-0.8, right_m=0.8, gap_m=0.5))


def test_under_a_bridge_the_way_is_free() -> None:
    low = Config(camera=Camera(height_m=0.5), vehicle=Vehicle(half_width_m=0.4, height_m=0.6))
    assert not contacts(Body(low_m=0.15, high_m=2.0), low)


def test_what_is_far_off_is_not_met_soon() -> None:
    assert not contacts(Body(from_m=30.0))


@pytest.mark.parametrize("measured_mps", [0.0, math.nan])
def test_before_a_vehicle_that_stands_nothing_is_met(measured_mps: float) -> None:
    assert not contacts(Body(speed_mps=0.0, measured_mps=measured_mps))
