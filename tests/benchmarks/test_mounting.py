"""Whether the benchmark of the learnt mounting counts what it says."""

import math
from pathlib import Path

import pytest

from benchmarks import mounting, report
from benchmarks.mounting import Learnt, learn, table
from lcf_edge.rendered import scenes

SIGMA_RAD = math.radians(0.1)


def of(start: str, off: float, kind: str = "turn") -> Learnt:
    """Off by this many sigmas up, and half as many to the side."""
    return Learnt(kind, start, off * SIGMA_RAD, SIGMA_RAD, off / 2 * SIGMA_RAD, SIGMA_RAD)


def test_shares_inside_one_and_two_sigmas_are_counted_by_start_and_angle() -> None:
    found = [of("right", off) for off in (0.5, -0.9, 1.5, -2.5)] + [of("2° off", 0.1), of("2° off", -3.0, "dusk")]
    rows = {row[0]: row[1:] for row in table(found).rows}
    assert rows["pitch, configured right"] == ("0.12°", "0.10°", "50 %", "75 %", "-0.25° (turn)")
    assert rows["yaw, configured right"][2:4] == ("75 %", "100 %")
    assert rows["pitch, configured 2° off"][2:] == ("50 %", "50 %", "-0.30° (dusk)")


def test_from_a_wrong_configuration_a_drive_learns_most_of_the_way() -> None:
    drive = scenes.make("passing", 3, seconds=4.0)
    right, off = learn(drive)
    assert (right.start, off.start) == tuple(mounting.STARTS)
    for learnt in (right, off):
        assert abs(learnt.pitch_rad) < 0.5 * mounting.OFF_RAD
        assert abs(learnt.yaw_rad) < 0.5 * mounting.OFF_RAD


def test_the_table_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(report, "RESULTS", tmp_path)
    monkeypatch.setattr(mounting, "_play", lambda task: [of("right", 0.5, task[0]), of("2° off", 0.5, task[0])])
    assert mounting.main(["--kinds", "turn,dusk", "--seeds", "1"]) == 0
    assert "pitch, configured right" in capsys.readouterr().out
    assert (tmp_path / "mounting.md").read_text().count("100 %") == 8
