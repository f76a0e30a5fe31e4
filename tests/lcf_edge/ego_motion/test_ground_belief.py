"""The speed by the ground in the image, where nothing measures it."""

from collections.abc import Iterator
from math import isnan

import numpy as np
import pytest
from msgspec.structs import replace

from benchmarks.playing import config_of
from lcf_edge.ego_motion.ground_belief import GroundBelief
from lcf_edge.filter.ground_speed import GroundSpeed
from lcf_edge.lens import Lens
from lcf_edge.messages import Scene
from lcf_edge.pipeline import Pipeline
from lcf_edge.rendered import scenes

FRAME_S = 0.05
WARM_UP = 10  # images


def shown(speed_mps: float, sigma_mps: float = 0.1) -> GroundSpeed:
    ground = GroundSpeed()
    ground.speed_mps, ground.sigma_mps, ground.elapsed_s = speed_mps, sigma_mps, 0.2
    return ground


def test_it_is_unknown_until_the_ground_is_seen_and_then_what_it_shows() -> None:
    belief = GroundBelief()
    belief.advance(FRAME_S)
    assert isnan(belief.speed_mps)
    belief.see(shown(1.5), FRAME_S)
    assert belief.speed_mps == 1.5


def test_noise_of_single_images_is_averaged() -> None:
    random, belief, told = np.random.default_rng(0), GroundBelief(), []
    for _ in range(200):
        belief.advance(FRAME_S)
        belief.see(shown(1.5 + random.normal(0, 0.1)), FRAME_S)
        told.append(belief.speed_mps)
    assert np.mean(told) == pytest.approx(1.5, abs=0.03)
    assert np.std(told) < 0.07


@pytest.mark.parametrize("accel_mps2", [1.0, -1.0], ids=["speeds up", "brakes"])
def test_a_vehicle_that_speeds_up_or_brakes_is_followed_though_the_ground_shows_the_middle_of_a_window(
    accel_mps2: float,
) -> None:
    belief, window_s = GroundBelief(), 0.2
    for frame in range(30):
        belief.advance(FRAME_S)
        now_mps = 2.0 + accel_mps2 * frame * FRAME_S
        belief.see(shown(now_mps - accel_mps2 * window_s / 2), FRAME_S)
    assert belief.speed_mps == pytest.approx(now_mps, abs=0.12)


def test_between_images_it_is_the_mean_speed_since_the_last() -> None:
    belief = GroundBelief()
    for frame in range(30):
        belief.advance(FRAME_S)
        belief.see(shown(2.0 + frame * FRAME_S), FRAME_S)
    before_mps = belief.speed_mps
    belief.advance(0.2)
    assert 0.02 < belief.speed_mps - before_mps < 0.1  # of 0.2 at 1 m/s², or less as the acceleration is forgotten


def test_without_ground_it_is_held_for_a_moment_and_then_unknown() -> None:
    belief = GroundBelief()
    belief.see(shown(1.5), FRAME_S)
    for _ in range(4):
        belief.advance(FRAME_S)
    assert belief.speed_mps == 1.5
    for _ in range(8):
        belief.advance(FRAME_S)
    assert isnan(belief.speed_mps)


def test_an_image_that_stands_still_says_that_the_vehicle_does() -> None:
    belief = GroundBelief()
    belief.see(shown(1.5), FRAME_S)
    belief.stand()
    assert belief.speed_mps == 0


def played(source: str) -> Iterator[tuple[Scene, float]]:
    """The scenes of a rendered drive's images alone, and its true speed, m/s."""
    drive = scenes.make("crossing", 3, seconds=3.0)
    config = config_of(drive)
    config = replace(config, vehicle=replace(config.vehicle, speed_source=source))
    pipeline = Pipeline(config, Lens.from_config(config.camera, drive.lens.width, drive.lens.height))
    for frame, _ in scenes.frames(drive):
        yield pipeline.process(frame), float(drive.speed.at(np.array([frame.stamp_ns / 1e9]))[0])


@pytest.mark.parametrize("source", ["auto", "imu"])
def test_images_alone_give_the_speed_and_say_so(source: str) -> None:
    after = list(played(source))[WARM_UP:]
    shares = [scene.vehicle_speed / speed_mps for scene, speed_mps in after]
    assert np.median(shares) == pytest.approx(1, abs=0.1)
    assert np.isfinite(shares).mean() > 0.9
    assert all("speed from ground" in scene.notes for scene, _ in after if np.isfinite(scene.vehicle_speed))


@pytest.mark.parametrize("source", ["odometry", "none"])
def test_who_wants_another_source_gets_no_speed_from_the_ground(source: str) -> None:
    assert all("no speed" in scene.notes for scene, _ in played(source))
