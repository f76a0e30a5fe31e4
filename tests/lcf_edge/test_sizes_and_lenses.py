"""One drive, rendered at three sizes and through three lenses, gives the same circles: angles count, not pixels."""

from dataclasses import replace

import pytest

from benchmarks.methods import FILTER
from benchmarks.playing import config_of, play_drive
from benchmarks.score import Score, score
from lcf_edge.rendered import scenes
from lcf_edge.rendered.drives import Lens

LENSES = {
    "320x240": Lens(320, 240, 250.0),
    "640x480": Lens(640, 480, 500.0),
    "1280x960": Lens(1280, 960, 1000.0),
    "barrel": Lens(640, 480, 420.0, "radial-tangential", (-0.25, 0.06, 0.0, 0.0)),
    "fisheye": Lens(640, 480, 300.0, "equidistant", (0.0, 0.0, 0.0, 0.0)),
}


def scored(kind: str, lens: Lens) -> Score:
    drive = scenes.make(kind, 0, seconds=5.0)
    drive = replace(drive, lens=replace(lens, vignetting=drive.lens.vignetting))
    moments = list(play_drive(drive, config_of(drive), [FILTER]))
    truths = [moment.truth for moment in moments if moment.truth is not None]
    return score([moment.scenes[FILTER] for moment in moments], truths, min_trust=3.0)


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_what_crosses_is_found_with_every_camera(lens: Lens) -> None:
    found = scored("crossing", lens)
    assert found.targets_never_hit == 0
    assert found.recall > 0.85
    assert found.false_circles <= 2
    assert found.ttc_error < 0.2


@pytest.mark.parametrize("name", ["320x240", "fisheye"])
def test_nothing_is_found_where_nothing_is_with_another_camera(name: str) -> None:
    assert scored("passing", LENSES[name]).false_per_quiet_frame <= 0.03
