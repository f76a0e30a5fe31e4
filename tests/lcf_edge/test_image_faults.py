"""What spoils the images of a drive is told, and nothing is where they are good."""

from dataclasses import replace
from typing import Any

import pytest

from benchmarks.methods import FilterMethod
from benchmarks.playing import config_of, feed
from lcf_edge.lens import Lens
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


@pytest.mark.parametrize("kind", ["vibration", "turn_ahead_of_axle", "own_bumper", "repetitive", "reversing", "crowd"])
def test_where_they_are_good_nothing_is_told(kind: str) -> None:
    assert not any(faults_of(scenes.make(kind, 3)))
