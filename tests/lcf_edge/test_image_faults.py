"""What spoils the images of a drive is told, and nothing is where they are good."""

import math
from dataclasses import replace
from typing import Any

import pytest

from benchmarks.methods import FilterMethod
from benchmarks.playing import config_of, feed
from lcf_edge.lens import Lens
from lcf_edge.messages import Kind
from lcf_edge.rendered import scenes
from lcf_edge.rendered.drives import Drive

FAULTS = {"dirty lens", "rolling shutter", "glossy floor"}


def faults_of(drive: Drive) -> list[set[str]]:
    """Those told of each frame."""
    config = config_of(drive)
    method = FilterMethod(config, Lens.from_config(config.camera, drive.lens.width, drive.lens.height))
    return [FAULTS.intersection(moment.scenes["filter"].notes) for moment in feed(drive, {"filter": method})]


@pytest.mark.parametrize("seed", [3, 4])
@pytest.mark.parametrize(
    ("kind", "good", "fault"),
    [
        ("wet_lens", {"drops": ()}, "dirty lens"),
        ("rolling_shutter", {"readout_s": 0.0}, "rolling shutter"),
        ("glossy_floor", {"gloss": 0.0}, "glossy floor"),
    ],
)
def test_what_spoils_the_images_is_told_after_half_of_the_drive(
    kind: str, good: dict[str, Any], fault: str, seed: int
) -> None:
    drive = scenes.make(kind, seed, seconds=6.0)
    told = faults_of(drive)
    assert all(faults == {fault} for faults in told[len(told) // 2 :])
    assert not any(faults_of(replace(drive, **good)))


@pytest.mark.parametrize("seed", [91, 93])
def test_what_drops_show_is_no_rebel_once_they_are_noticed(seed: int) -> None:
    """The world passes upside down in them: 55 and 22 circles of 121 images, if they are only told."""
    drive = scenes.make("wet_lens", seed)
    config = config_of(drive)
    method = FilterMethod(config, Lens.from_config(config.camera, drive.lens.width, drive.lens.height))
    wrong = 0
    for moment in feed(drive, {"filter": method}):
        scene = moment.scenes["filter"]
        noticed = scene.circles[(scene.circles["kind"] == Kind.REBEL) & ("dirty lens" in scene.notes)]
        moving = [each.box for each in moment.truth.objects if each.threat or each.moving] if moment.truth else []
        for x, y in zip(noticed["x"].tolist(), noticed["y"].tolist(), strict=True):
            in_drop = any(math.hypot(x - each.x_px, y - each.y_px) < each.radius_px for each in drive.drops)
            right = any(-30 < x - left < wide + 30 and -30 < y - top < high + 30 for left, top, wide, high in moving)
            wrong += in_drop and not right
    assert wrong <= 5


@pytest.mark.parametrize("kind", ["vibration", "turn_ahead_of_axle", "own_bumper", "repetitive", "reversing", "crowd"])
def test_where_they_are_good_nothing_is_told(kind: str) -> None:
    assert not any(faults_of(scenes.make(kind, 3)))
