"""A siege of a few seconds, with all that takes part in a long one; and what a siege complains of."""

import shutil
from pathlib import Path

import pytest

from hil_mocks.siege.__main__ import BEYOND_MIB, BUDGET_MIB, MIN_SHARE, Figures, besiege
from hil_mocks.siege.place import DAEMON_NICE


@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl here")
def test_a_short_siege_is_withstood(tmp_path: Path) -> None:
    figures = besiege(4.0, tmp_path, min_share=0.0)  # this machine may be busy
    assert figures.complaints == []
    assert all(waves > 0 for waves in figures.waves.values())
    assert len(figures.waves) == 15


def test_the_daemons_priority_is_that_of_its_unit() -> None:
    unit = (Path(__file__).parents[2] / "systemd/lcf-edge.service").read_text(encoding="utf-8")
    assert f"\nNice={DAEMON_NICE}\n" in unit


def test_what_must_not_be_is_complained_of() -> None:
    figures = Figures(let_in_s=[0.1], descriptors={"daemon": 50}, frames_share=1.0, pages=3, excess_bytes=1)
    figures.judge(MIN_SHARE)
    assert figures.complaints == []
    figures = Figures(
        let_in_s=[3.0],
        descriptors={"daemon": 500},
        memory_mib=BUDGET_MIB + BEYOND_MIB + 1,
        frames_share=MIN_SHARE - 0.1,
    )
    figures.judge(MIN_SHARE)
    assert len(figures.complaints) == 6
