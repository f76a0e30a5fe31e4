"""The lens that a board was seen through is recovered, or the reason why not is reported."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from drivers.samples import Frame
from lcf_edge.calibrate.camera import calibrate_camera, solve
from lcf_edge.calibrate.guide import Guide
from lcf_edge.calibrate.result import CalibrationError, Result
from lcf_edge.calibrate.target import Target
from lcf_edge.calibrate.views import Views
from lcf_edge.config import Camera
from lcf_edge.lens import Lens

CHECKERBOARD, CHARUCO = Target.parse("checkerboard:9x6:25mm"), Target.parse("charuco:8x6:30mm")
WEBCAM = Lens(640, 480, 520.0, 518.0, 322.3, 236.1, "radial-tangential", (-0.28, 0.09, 0.0008, -0.0006))
FISHEYE = Lens(640, 480, 380.0, 381.0, 318.3, 243.1, "equidistant", (-0.02, 0.005, -0.003, 0.0005))

Make = Callable[..., Any]


@pytest.fixture(scope="module")
def views(studio: Make) -> list[Frame]:
    return list(studio(CHECKERBOARD, WEBCAM).views(13))


@pytest.fixture(scope="module")
def found(given: Make, guide: Guide, views: list[Frame]) -> Result:
    return calibrated(given, views, CHECKERBOARD, guide)


def calibrated(
    given: Make, frames: list[Frame], board: Target, guide: Guide, model: str = "radial-tangential"
) -> Result:
    source = replace(given(frames), film=False)
    return calibrate_camera(source, board, model, 20, guide)  # type: ignore[arg-type]


def is_that_lens(result: Result, lens: Lens) -> None:
    fx, fy, cx, cy = result.values["intrinsics"]  # type: ignore[misc]
    assert fx == pytest.approx(lens.fx, rel=0.005)
    assert fy == pytest.approx(lens.fy, rel=0.005)
    assert (cx, cy) == pytest.approx((lens.cx, lens.cy), abs=2.0)
    found = Lens.from_config(Camera(**result.values), lens.width, lens.height)  # type: ignore[arg-type]
    x, y = np.meshgrid(np.linspace(40, 600, 8), np.linspace(40, 440, 6))
    points = np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float32)
    bearings = [(one.undistort(points) - (one.cx, one.cy)) / (one.fx, one.fy) for one in (found, lens)]
    assert np.abs(np.arctan(bearings[0]) - np.arctan(bearings[1])).max() < np.radians(0.4)


def test_a_checkerboard_determines_the_lens(found: Result) -> None:
    is_that_lens(found, WEBCAM)


def test_a_charuco_board_determines_a_fisheye(given: Make, guide: Guide, studio: Make) -> None:
    is_that_lens(calibrated(given, studio(CHARUCO, FISHEYE).views(11), CHARUCO, guide, "equidistant"), FISHEYE)


@pytest.mark.parametrize(("lens", "model"), [(WEBCAM, "radial-tangential"), (FISHEYE, "equidistant")])
def test_the_stated_uncertainty_is_about_right(studio: Make, lens: Lens, model: Any) -> None:
    result = solve(studio(CHECKERBOARD, lens).sightings(20), model)
    line = next(line for line in result.findings if "focal" in line)
    value, sigma = (float(text) for text in line.removeprefix("focal length: ").split(",")[0].split(" ± "))
    assert abs(value - lens.fx) < 4 * sigma < 0.005 * lens.fx
    assert "reprojection error: 0.1" in result.findings[2]


@pytest.mark.parametrize(
    ("message", "views"),
    [
        ("in one place; move it", {"spread": 0.1}),
        ("tilted in 0 views, 3 are needed", {"tilt_rad": 0.05}),
        (r"corners are \d.\d+ px from where a radial-tangential lens would put them", {"noise_px": 3.0}),
    ],
)
def test_views_that_determine_no_lens_are_refused(studio: Make, message: str, views: dict[str, float]) -> None:
    with pytest.raises(CalibrationError, match=message):
        solve(studio(CHECKERBOARD, WEBCAM).sightings(12, **views), "radial-tangential")


def test_views_of_the_middle_alone_are_refused(studio: Make) -> None:
    views = studio(Target.parse("checkerboard:5x4:25mm"), WEBCAM).sightings(9, spread=0.6)
    for view in views.kept:
        view.corners[:] = view.corners.mean(axis=0) + 0.3 * (view.corners - view.corners.mean(axis=0))
    with pytest.raises(CalibrationError, match=r"corners were seen in \d+% of the image"):
        solve(views, "radial-tangential")


def test_too_few_views_are_refused_with_what_was_wrong_with_the_others(
    given: Make, guide: Guide, views: list[Frame]
) -> None:
    blurred = [replace(frame, image=cv2.GaussianBlur(frame.image, (0, 0), 3.0)) for frame in views[:2]]
    frames = [*views[4:6], *blurred, views[4]]
    with pytest.raises(CalibrationError, match=r"2 usable views .* 2 blurred, 1 seen like this before"):
        calibrated(given, frames, CHECKERBOARD, guide)


def test_another_board_than_was_shown_is_not_taken_for_it(given: Make, guide: Guide, views: list[Frame]) -> None:
    with pytest.raises(CalibrationError, match=r"usable views of checkerboard:7x4:25mm.*check --board"):
        calibrated(given, views[:2], Target.parse("checkerboard:7x4:25mm"), guide)


def test_a_board_in_motion_is_waited_for(views: list[Frame]) -> None:
    film = Views(CHECKERBOARD, film=True)
    first, other = (replace(frame, stamp_ns=i * 10**8) for i, frame in enumerate(views[:2]))
    assert film.consider(first) == "moving"  # nothing to compare it with
    assert film.consider(other) == "moving"
    assert film.consider(replace(other, stamp_ns=2 * 10**8)) == ""
    assert film.consider(replace(other, stamp_ns=3 * 10**8)) == "seen like this before"
    assert film.consider(replace(other, stamp_ns=4 * 10**8, image=np.full((480, 640), 90, np.uint8))) == "no board"
    assert "hold it in the" in film.wish()


def test_a_view_whose_error_stands_out_is_left_out_and_reported(studio: Make) -> None:
    views = studio(CHECKERBOARD, WEBCAM).sightings(12)
    views.kept[3].corners[20:30, 0] += 4.0  # as when somebody bends it
    result = solve(views, "radial-tangential")
    assert "; 1 view left out, with outlying errors" in result.findings[0]
    is_that_lens(result, WEBCAM)
