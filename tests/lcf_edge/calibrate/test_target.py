"""Boards are named, printed and found again."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from lcf_edge.calibrate.target import Target
from lcf_edge.errors import UsageError

NAMES = ("checkerboard:9x6:25mm", "charuco:8x6:30mm:22.5mm:4X4_250", "charuco:5x7:40mm:20mm:5X5_100")


@pytest.mark.parametrize("name", NAMES)
def test_a_name_is_read_as_it_is_written(name: str) -> None:
    assert Target.parse(name).name == name


@pytest.mark.parametrize(
    "name",
    [
        "checkerboard",
        "checkerboard:9x6",
        "checkerboard:9x6:25",
        "checkerboard:2x6:25mm",
        "checkerboard:9x6:0mm",
        "charuco:8x6:30mm:31mm",
        "charuco:30x30:30mm:20mm:4X4_50",
        "chess:9x6:25mm",
    ],
)
def test_other_names_are_refused(name: str) -> None:
    with pytest.raises(UsageError, match=f"--board {name}"):
        Target.parse(name)


@pytest.mark.parametrize("name", NAMES)
def test_a_printed_board_has_its_size_and_is_found_again(tmp_path: Path, name: str) -> None:
    board = Target.parse(name)
    width_mm, height_mm = board.print_to(tmp_path / "board.png")
    extra = 2 if board.kind == "checkerboard" else 1  # squares around the corners, and the margin
    assert width_mm == pytest.approx(1000 * board.square_m * (board.columns + extra))
    assert height_mm == pytest.approx(1000 * board.square_m * (board.rows + extra))
    printed = np.asarray(cv2.imread(str(tmp_path / "board.png"), cv2.IMREAD_GRAYSCALE))
    assert printed.shape[1] == pytest.approx(width_mm / 25.4 * 300, abs=1)
    small = cv2.resize(printed, None, fx=0.3, fy=0.3, interpolation=cv2.INTER_AREA)
    found = board.find(np.asarray(small, np.uint8))
    assert found is not None
    assert len(found.corners) == len(board.places)
    steps = np.hypot(*np.diff(found.corners.reshape(-1, board.corner_columns, 2), axis=1).reshape(-1, 2).T)
    assert steps == pytest.approx(1000 * board.square_m / 25.4 * 300 * 0.3, rel=0.02)


def test_a_blurred_board_shows_wide_edges() -> None:
    board = Target.parse("checkerboard:9x6:25mm")
    sharp = cv2.copyMakeBorder(board.draw(40), 40, 40, 40, 40, cv2.BORDER_CONSTANT, value=255)
    widths = []
    for sigma in (1.0, 2.0, 4.0):
        found = board.find(np.asarray(cv2.GaussianBlur(sharp, (0, 0), sigma), np.uint8))
        assert found is not None
        widths.append(found.edge_px)
    assert widths == pytest.approx([2.56 * sigma for sigma in (1.0, 2.0, 4.0)], rel=0.15)  # 10 to 90 % of a Gaussian
