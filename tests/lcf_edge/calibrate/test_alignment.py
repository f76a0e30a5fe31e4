"""Axes of the IMU, and offset of its clock, from the gyro against the camera's own rotation."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given as each
from hypothesis import settings
from hypothesis import strategies as st

from lcf_edge.calibrate.alignment import align
from lcf_edge.calibrate.axes import axes_result, snapped
from lcf_edge.calibrate.by_camera import axes_of, calibrate_by_camera
from lcf_edge.calibrate.compare import Watched
from lcf_edge.calibrate.guide import Guide
from lcf_edge.calibrate.result import CalibrationError
from lcf_edge.calibrate.rotations import EXACT, angle_rad, best_rotation, in_words, nearest_exact
from lcf_edge.calibrate.time_offset import calibrate_time
from lcf_edge.config import Config, Imu
from lcf_edge.lens import Lens
from lcf_edge.rendered import scenes

Floats = npt.NDArray[np.float64]
Make = Callable[..., Any]

UNEVEN = np.random.default_rng(7)
CHIP = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])  # x ahead, y left, z up


def some_rotation(seed: int) -> Floats:
    return best_rotation(np.random.default_rng(seed).normal(size=(3, 3)))[0]


@pytest.fixture(scope="module")
def rendered(turntable: Make, given: Make) -> tuple[Any, Floats, float]:
    """A source of images and samples, the IMU's axes, and the offset."""
    axes, offset_s = some_rotation(5) @ CHIP, 0.0373
    table = turntable(axes=axes, offset_s=offset_s)
    return given(table.samples(), table.frames(), lens=table.lens), axes, offset_s


def test_images_show_the_axes_within_a_degree(rendered: tuple[Any, Floats, float], guide: Guide) -> None:
    source, axes, _ = rendered
    found = calibrate_by_camera(source, Config(), None, 0.0, guide)
    assert np.degrees(angle_rad(np.array(found.values["axes"]), axes)) < 0.5
    assert any("37 ms apart, which is not configured: run lcf-edge calibrate time" in line for line in found.findings)


def test_images_show_the_offset_within_3_ms(rendered: tuple[Any, Floats, float], guide: Guide) -> None:
    source, _, offset_s = rendered
    assert calibrate_time(source, Config(), None, guide).values["time_offset_s"] == pytest.approx(offset_s, abs=0.001)


def test_a_drive_past_near_things_shows_the_offset_within_3_ms(given: Make, guide: Guide) -> None:
    drive = scenes.make("turn", 4)
    weave = scenes.Profile(tuple((0.5 * knot, float(rate)) for knot, rate in enumerate(UNEVEN.uniform(-0.5, 0.5, 13))))
    drive = replace(drive, seconds=6.0, yaw_rate=weave, lens=scenes.Lens(width=240, height=180, focal_px=190.0))
    late = [replace(sample, stamp_ns=sample.stamp_ns + 45_000_000) for sample in scenes.imu(drive)]
    lens = Lens(240, 180, 190.0, 190.0, 119.5, 89.5)
    source = given([frame for frame, _ in scenes.frames(drive)], late, lens=lens)
    assert calibrate_time(source, Config(), None, guide).values["time_offset_s"] == pytest.approx(-0.045, abs=0.003)


@settings(max_examples=6)
@each(seed=st.integers(0, 1000), offset_s=st.floats(-0.3, 0.3))
def test_any_axes_and_any_offset_are_found(turntable: Make, seed: int, offset_s: float) -> None:
    axes = some_rotation(seed)
    table = turntable(axes=axes, offset_s=offset_s, seconds=8.0)
    found = align(table.turns(), table.samples())
    assert found.offset_s == pytest.approx(offset_s, abs=0.003)
    assert angle_rad(found.axes, axes) < np.radians(0.5)
    assert found.gyro_bias_radps == pytest.approx(table.bias_radps, abs=0.01)
    assert angle_rad(found.axes, axes) < 6 * found.axes_sigma_rad
    assert abs(found.offset_s - offset_s) < 6 * found.offset_sigma_s + 1e-4


def test_wild_intervals_do_not_matter(turntable: Make) -> None:
    table = turntable(axes=CHIP)
    turns = [replace(turn, rate_radps=-turn.rate_radps) if i % 9 == 4 else turn for i, turn in enumerate(table.turns())]
    assert angle_rad(align(turns, table.samples()).axes, CHIP) < np.radians(0.5)


def only(row: int, rate: float = 1.0) -> Callable[[Floats], Floats]:
    """Turning about one axis alone."""

    def angles(times_s: Floats) -> Floats:
        all_of_them = np.zeros((len(times_s), 3))
        all_of_them[:, row] = rate * 0.3 * (np.sin(2 * np.pi * 0.7 * times_s) + np.sin(2 * np.pi * 0.41 * times_s + 1))
        return all_of_them

    return angles


def test_one_axis_shows_the_offset_but_not_the_axes(turntable: Make) -> None:
    table = turntable(only(0), offset_s=0.02)
    assert align(table.turns(), table.samples()).offset_s == pytest.approx(0.02, abs=0.002)
    with pytest.raises(CalibrationError, match=r"turn more about the camera's (x: nod|z: roll) and (x: nod|z: roll)"):
        axes_of(Watched(table.turns(), table.samples()), Config(), 0.0)


def swinging(times_s: Floats) -> Floats:
    return np.outer(np.sin(2 * np.pi * 4 * times_s), (0.1, 0.0, 0.0))


@pytest.mark.parametrize(
    ("message", "change"),
    [
        ("turned too little", {"angles": only(0, 0.02)}),
        ("several offsets", {"angles": swinging}),
        ("apart by more than 0.5 s", {"offset_s": 0.53}),
    ],
)
def test_motion_that_shows_nothing_is_refused(turntable: Make, message: str, change: dict[str, Any]) -> None:
    table = turntable(**change)
    with pytest.raises(CalibrationError, match=message):
        align(table.turns(0.002), table.samples())


def test_an_offset_far_away_is_found_from_the_configured_one(turntable: Make) -> None:
    table = turntable(offset_s=2.53)
    assert align(table.turns(), table.samples(), around_s=2.4).offset_s == pytest.approx(2.53, abs=0.002)


def test_rotations_that_do_not_agree_are_refused(turntable: Make) -> None:
    table, other = turntable(), turntable(lambda times_s: np.sin(np.outer(times_s, (5.0, 7.1, 6.3)) + 2) * 0.2)
    with pytest.raises(CalibrationError, match="their rotations do not agree"):
        align(table.turns(), other.samples())


def test_a_saturated_gyro_is_refused(turntable: Make) -> None:
    table = turntable()
    samples = [replace(sample, saturated=i % 20 == 0) for i, sample in enumerate(table.samples())]
    with pytest.raises(CalibrationError, match=r"end of the range; turn more slowly, or raise imu.gyro_range_dps"):
        align(table.turns(), samples)


def test_too_little_is_refused(turntable: Make) -> None:
    with pytest.raises(CalibrationError, match="seen in 20 intervals"):
        align(turntable().turns()[:20], turntable().samples())
    with pytest.raises(CalibrationError, match="hardly overlap"):
        align(turntable().turns(), turntable().samples()[:600])


def test_there_are_24_exact_axes_and_the_nearest_is_named() -> None:
    assert len(EXACT) == 24
    assert in_words(CHIP) == "x ahead, y left, z up"
    for exact in EXACT:
        near, off_rad = nearest_exact(exact @ best_rotation(np.eye(3) + 0.05 * some_rotation(1))[0])
        assert (near == exact).all()
        assert off_rad < 0.1


def test_axes_are_taken_as_exact_within_the_tolerance() -> None:
    axes = some_rotation(5) @ CHIP
    exact, off_rad = nearest_exact(axes)
    assert (snapped(axes, off_rad - 0.02)[0] == axes).all()
    taken, words = snapped(axes, off_rad + 0.02)
    assert (taken == exact).all()
    assert "taken as exact (--snap 0 keeps what was measured)" in words[0]


def test_how_far_the_configured_axes_are_is_reported() -> None:
    config = Config(imu=Imu(axes=CHIP.tolist()))
    result = axes_result(CHIP, ("measured",), {}, config, lambda _: None)
    assert result.findings == ("measured", "the configured axes are 0.0° from these")
    assert result.values == {"axes": CHIP.tolist()}
