"""Whether the vehicle is stationary, by the image, although a speed is reported."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.config import Camera, Config
from lcf_edge.filter import LineCircleFilter

Drive = Callable[..., Any]
Landmarks = Callable[..., npt.NDArray[np.float64]]

MEASURED_MPS = 2.0
SOON = 15  # images, 0.75 s


def verdicts(way: Any, config: Config | None = None, measured_mps: float = MEASURED_MPS) -> Iterator[LineCircleFilter]:
    """The filter after each step, given a speed that need not be true."""
    tables = LineCircleFilter(config or Config(), way.lens)
    for corners, motion in way:
        tables.step(corners, replace(motion, speed_mps=measured_mps))
        yield tables


@pytest.fixture(scope="session")
def ground(drive: Drive) -> Any:
    """Landmarks on the ground."""
    random, n = np.random.default_rng(2), 200
    return drive(np.stack([random.uniform(-2, 2, n), np.full(n, 0.3), random.uniform(0.8, 10, n)], axis=1))


@pytest.fixture(scope="session")
def street(ground: Any, drive: Drive, clutter: Landmarks) -> Any:
    """Ground, and what stands beside the path."""
    return ground + drive(clutter(150))


def test_who_stands_is_seen_to_stand_whatever_speed_is_reported(street: Any) -> None:
    """Also after a second, when nothing has left its pixel for so long that it may be a part of the vehicle."""
    stood = [tables.stands for tables in verdicts(replace(street, speed_mps=0.0, frames=50))]
    assert stood[SOON:] == [True] * 35


@pytest.mark.parametrize("speed_mps", [0.5, 2.0, -1.0])
def test_who_drives_does_not_stand(street: Any, speed_mps: float) -> None:
    way = replace(street, speed_mps=speed_mps)
    assert not any(tables.stands for tables in verdicts(way, measured_mps=speed_mps))


def test_who_stands_where_somebody_walks_is_seen_to_stand_in_most_images(
    street: Any, drive: Drive, box: Landmarks
) -> None:
    walker = drive(box((-2, -0.6, 5), (0.5, 1.2, 0.3)), np.array([1.2, 0, 0]))
    stood = [tables.stands for tables in verdicts(replace(street + walker, speed_mps=0.0, frames=50))]
    assert sum(stood[SOON:]) > 0.5 * len(stood[SOON:])


def test_a_leader_in_a_street_that_flows_does_not_make_it_stand(street: Any, drive: Drive, box: Landmarks) -> None:
    leader = drive(box((0.0, 0.1, 2.5), (0.6, 0.35, 0.0), landmarks=40), np.array([0, 0, MEASURED_MPS]))
    assert not any(tables.stands for tables in verdicts(street + leader))


def test_nobody_is_met_while_the_vehicle_stands(street: Any, drive: Drive, box: Landmarks) -> None:
    wall = drive(box((0.0, -0.4, 6.0), (0.5, 0.9, 0.0), landmarks=40))
    *_, tables = verdicts(replace(street + wall, speed_mps=0.0))
    assert tables.stands
    assert not (tables.rebel.active & (tables.rebel.trust >= 3)).any()


def test_it_drives_on_once_the_ground_flows(street: Any) -> None:
    tables = LineCircleFilter(Config(), street.lens)
    stood = []
    for way in (replace(street, speed_mps=0.0), street):
        for corners, motion in way:
            tables.step(corners, replace(motion, speed_mps=MEASURED_MPS))
        stood.append(tables.stands)
    assert stood == [True, False]


def test_without_ground_in_sight_nothing_is_concluded(drive: Drive) -> None:
    """What is high up and far away hardly moves at any speed."""
    random, n = np.random.default_rng(6), 200
    sky = drive(random.uniform([-40, -30, 60], [40, -8, 90], (n, 3)))
    assert not any(tables.stands for tables in verdicts(replace(sky, speed_mps=0.0)))
    assert not any(tables.stands for tables in verdicts(sky))


def test_from_an_unknown_height_nothing_is_concluded(street: Any) -> None:
    unknown = Config(camera=Camera(height_m=0.0))
    assert not any(tables.stands for tables in verdicts(replace(street, speed_mps=0.0), unknown))


@pytest.mark.parametrize("measured_mps", [float("nan"), 0.0])
def test_without_a_speed_there_is_nothing_to_doubt(street: Any, measured_mps: float) -> None:
    assert not any(tables.stands for tables in verdicts(replace(street, speed_mps=0.0), measured_mps=measured_mps))
