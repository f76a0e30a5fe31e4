"""``lcf-edge bench``: what it measures and the line that can be sent in."""

import re

import numpy as np
import pytest

from lcf_edge.cli.bench import WARM_UP, Computer, Drive, Measured, measure, report
from lcf_edge.cli.command_line import main
from lcf_edge.compilation import uncompiled

BOARD = Computer("A board", "aarch64", 4, "Python 3.11.2, NumPy 2.1.0, OpenCV 4.10.0")


def measured(scale: float, cpu_s: float) -> Measured:
    """Of 101 frames: detect 1 to 2 ms, filter twice, the whole four times that."""
    detect = np.linspace(1, 2, 101)
    return Measured(np.stack((detect, 2 * detect, 4 * detect), axis=1) * scale, cpu_s, 700.0)


def test_share_of_a_core_and_frames_a_second_are_those_of_the_time_that_the_processor_was_busy() -> None:
    assert measured(1, 0.004).frames_a_second == pytest.approx(250)
    assert measured(1, 0.004).share_of_a_core == pytest.approx(0.12)


def test_the_report_has_medians_and_99th_percentiles_and_ends_with_a_line_that_says_all() -> None:
    *lines, empty, short = report(BOARD, measured(1, 0.004), measured(2, 0.005))
    assert lines[0] == "computer   A board, aarch64, 4 cores; Python 3.11.2, NumPy 2.1.0, OpenCV 4.10.0"
    assert lines[1] == f"filter     {uncompiled() or 'compiled'}"
    assert lines[3] == (
        "full speed 250 frames a second on one core; "
        "detect 1.50 / 1.99, filter 3.00 / 3.98, whole 6.00 / 7.96 ms (median / 99 %)"
    )
    assert lines[4] == (
        "30 a second 15.0% of a core; detect 3.00 / 3.98, filter 6.00 / 7.96, whole 12.00 / 15.92 ms (median / 99 %)"
    )
    assert empty == ""
    for text in (
        "uncompiled" if uncompiled() else " compiled |",
        "A board, aarch64, 4 cores",
        "700 corners",
        "250 frames/s",
        "filter 3.00/3.98/6.00/7.96 ms",
        "15.0% of a core at 30/s",
    ):
        assert text in short
    assert short.isprintable()


def test_every_stage_of_real_frames_is_measured_after_the_tables_have_filled() -> None:
    drive = Drive()
    counted = [counts for (counts, _), _ in zip(drive.steps(), range(60), strict=False)]
    assert counted[: WARM_UP + 1] == [False] * WARM_UP + [True]
    assert counted[50] is False  # the drive begins anew, with empty tables
    found = measure(drive, 0.0, rate_hz=None)
    assert found.stages_ms.shape == (1, 3)
    assert (found.stages_ms[:, 2] >= found.stages_ms[:, 0] + found.stages_ms[:, 1]).all()
    assert found.corners > 100
    assert found.cpu_s > 0


def test_the_command_measures_for_as_long_as_it_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--seconds", "1"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines if line] == ["computer", "filter", "drive", "full", "30", "lcf-edge"]
    assert re.search(r" \| \d+ frames/s \| .* \| [\d.]+% of a core at 30/s$", lines[-1])


@pytest.mark.parametrize("seconds", ["0", "-1", "nan", "1e9", "soon"])
def test_a_time_that_makes_no_sense_is_refused(seconds: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "--seconds", seconds]) == 2
    assert "--seconds" in capsys.readouterr().err
