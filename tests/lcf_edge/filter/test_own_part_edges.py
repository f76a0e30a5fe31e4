"""Edges that stay where they are in the image are the vehicle's own, and nobody's rebels."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.config import Config
from lcf_edge.filter import Corners, LineCircleFilter, Motion

Drive = Callable[..., Any]
Landmarks = Callable[..., npt.NDArray[np.float64]]

FPS = 20
OWN_PART_S = 1.0
ONE_SECOND = FPS + 1  # the first image begins it


class Bumper:
    """Corners at fixed pixels on top of a drive; from ``leaves`` on they move to the side, px a frame."""

    def __init__(self, way: Any, leaves: int = 10**6) -> None:
        self._way, self._leaves = way, leaves
        self.pixel = np.random.default_rng(7).integers([250, 400], [390, 470], (40, 2)).astype(np.int32)
        self.looks = np.random.default_rng(8).integers(0, 256, (40, 16), np.uint8)

    def __iter__(self) -> Any:
        for seq, (corners, motion) in enumerate(self._way):
            yield self._on_top_of(corners, max(0, seq - self._leaves) * 8), motion

    def _on_top_of(self, corners: Corners, aside_px: int) -> Corners:
        pixel = self.pixel + np.array([aside_px, 0], np.int32)
        return replace(
            corners,
            pixel=np.concatenate([corners.pixel, pixel]),
            position=np.concatenate([corners.position, pixel.astype(np.float32)]),
            appearance=np.concatenate([corners.appearance, self.looks]),
        )

    def rows(self, tables: LineCircleFilter) -> npt.NDArray[np.intp]:
        """Of the table of edges."""
        own = {looks.tobytes() for looks in self.looks}
        seen = tables.edges.appearance[: tables.edges.count]
        return np.array([row for row, looks in enumerate(seen) if looks.tobytes() in own], np.intp)


@pytest.fixture(scope="session")
def street(drive: Drive, clutter: Landmarks) -> Any:
    random, n = np.random.default_rng(2), 150
    ground = np.stack([random.uniform(-3, 3, n), np.full(n, 0.3), random.uniform(1.5, 14, n)], axis=1)
    return replace(drive(ground) + drive(clutter(200)), frames=40)


def is_own_part(tables: LineCircleFilter, row: int) -> bool:
    return bool(tables.edges.fixed_s[row] >= OWN_PART_S)


def test_what_stays_in_the_image_for_a_second_is_nobodys_rebel(street: Any) -> None:
    tables, bumper = LineCircleFilter(Config(), street.lens), Bumper(street)
    for seq, (corners, motion) in enumerate(bumper):
        tables.step(corners, motion)
        rows = bumper.rows(tables)
        own = [row for row in rows if is_own_part(tables, row)]
        if seq < ONE_SECOND - 1:
            assert not own
        if seq > ONE_SECOND:
            assert len(own) > 0.8 * len(bumper.pixel)
        assert not tables.edges.rebel[own].any()
        assert not tables.edges.suspect_keys[own].any()


def test_what_flows_is_no_own_part(street: Any) -> None:
    tables = LineCircleFilter(Config(), street.lens)
    for corners, motion in street:
        tables.step(corners, motion)
    flowing = np.flatnonzero(tables.edges.matched[: tables.edges.count])
    away = np.hypot(tables.edges.x[flowing] - tables.focus[0], tables.edges.y[flowing] - tables.focus[1])
    assert not any(is_own_part(tables, row) for row in flowing[away > 60])


def test_it_is_released_when_it_moves(street: Any) -> None:
    tables, bumper = LineCircleFilter(Config(), street.lens), Bumper(street, leaves=30)
    for seq, (corners, motion) in enumerate(bumper):
        tables.step(corners, motion)
        owned = sum(is_own_part(tables, row) for row in bumper.rows(tables) if tables.edges.matched[row])
        if seq == 30:
            assert owned > 0.8 * len(bumper.pixel)
    assert owned == 0


def test_a_vehicle_that_stands_has_own_parts_everywhere_until_it_drives(street: Any) -> None:
    tables = LineCircleFilter(Config(), street.lens)
    stands = replace(street, speed_mps=0.0)
    for corners, motion in stands:
        tables.step(corners, motion)
    assert sum(is_own_part(tables, row) for row in range(tables.edges.count)) > 0.8 * tables.edges.count
    for corners, motion in replace(street, frames=12):
        tables.step(corners, Motion(motion.dt_s, motion.rotation, 0.0, motion.speed_mps, 0.0))
    far = np.hypot(tables.edges.x - tables.focus[0], tables.edges.y - tables.focus[1])[: tables.edges.count] > 60
    moving = np.flatnonzero(far & tables.edges.matched[: tables.edges.count])
    assert len(moving) > 50
    assert sum(is_own_part(tables, row) for row in moving) < 0.1 * len(moving)


def test_a_walker_before_what_is_too_far_off_to_flow_is_a_rebel(drive: Drive, clutter: Landmarks) -> None:
    random, n = np.random.default_rng(3), 60
    far = np.stack([random.uniform(-36, 36, n), random.uniform(-24, -3, n), random.uniform(300, 400, n)], axis=1)
    walker = np.stack([random.uniform(-0.3, 0.3, 20), random.uniform(-1.2, 0.4, 20), np.full(20, 10.0)], axis=1)
    way = replace(drive(clutter(150)) + drive(far) + drive(walker, velocity_mps=(0.6, 0, 0)), frames=40)
    tables = LineCircleFilter(Config(), way.lens)
    for seq, (corners, motion) in enumerate(way):
        tables.step(corners, motion)
        if seq >= ONE_SECOND:
            assert sum(is_own_part(tables, row) for row in range(tables.edges.count)) > 20
            assert (tables.rebel.active & (tables.rebel.trust >= 3)).any()
