"""What an IMU shows by itself: noise at rest, and its axes from motions by hand."""

from collections.abc import Callable
from dataclasses import replace
from math import radians
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from drivers.samples import ImuSample
from lcf_edge.calibrate.guide import Guide
from lcf_edge.calibrate.motions import calibrate_motions, camera_from_vehicle
from lcf_edge.calibrate.rest import calibrate_rest, measure
from lcf_edge.calibrate.result import CalibrationError
from lcf_edge.calibrate.rotations import EXACT, angle_rad, best_rotation
from lcf_edge.config import Camera, Config

Floats = npt.NDArray[np.float64]
Make = Callable[..., Any]

CHIP = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


def still(times_s: Floats) -> Floats:
    return np.zeros((len(times_s), 3))


def by_hand(
    nose_deg: float = 45.0, side_deg: float = 45.0, left_deg: float = 90.0, askew_deg: float = 0.0
) -> Callable[[Floats], Floats]:
    """The steps in their order; each motion takes 1.5 s and is held for 1.5 s. Yaw, pitch, roll."""

    def angles(times_s: Floats) -> Floats:
        def moved(start_s: float) -> Floats:
            share = np.clip((times_s - start_s) / 1.5, 0, 1)
            return share * share * (3 - 2 * share)

        nose, side = moved(6) - moved(9), moved(12) - moved(15)
        roll = side_deg * side + askew_deg * nose
        return np.radians(np.stack([-left_deg * moved(18), -nose_deg * nose, roll], axis=1))

    return angles


def of_motions(turntable: Make, **options: Any) -> list[ImuSample]:
    angles = options.pop("angles", by_hand())
    samples: list[ImuSample] = turntable(angles, 21.0, **options).samples()
    return samples


@pytest.fixture(scope="module")
def at_rest(turntable: Make) -> list[ImuSample]:
    samples: list[ImuSample] = turntable(still, 6.0).samples()
    return samples


def test_rest_shows_bias_noise_and_gravity(at_rest: list[ImuSample], given: Make, guide: Guide) -> None:
    rest = measure(at_rest)
    assert rest.bias_radps == pytest.approx((0.01, -0.02, 0.015), abs=0.001)
    assert rest.noise_radps == pytest.approx(0.005, rel=0.1)
    assert rest.gravity_mps2 == pytest.approx(9.81, abs=0.01)
    result = calibrate_rest(given(at_rest), None, guide)
    assert result.values["gyro_noise_radps"] == pytest.approx(0.0052, abs=0.0002)


def changed(samples: list[ImuSample], change: Callable[[int, Floats, Floats], None]) -> list[ImuSample]:
    """Each sample after ``change(row, gyro, accel)``."""
    new = []
    for row, sample in enumerate(samples):
        gyro, accel = np.array(sample.gyro), np.array(sample.accel)
        change(row, gyro, accel)
        new.append(replace(sample, gyro=tuple(gyro.tolist()), accel=tuple(accel.tolist())))
    return new


def nudge(row: int, gyro: Floats, accel: Floats) -> None:  # noqa: ARG001
    gyro += 0.1 * (500 < row < 600)


def tip(row: int, gyro: Floats, accel: Floats) -> None:  # noqa: ARG001
    accel[0] += 0.5 * (row > 800)


def shake(row: int, gyro: Floats, accel: Floats) -> None:  # noqa: ARG001
    gyro += 0.1 * (-1) ** row


def weigh(row: int, gyro: Floats, accel: Floats) -> None:  # noqa: ARG001
    accel *= 1.2


def tremble(row: int, gyro: Floats, accel: Floats) -> None:  # noqa: ARG001
    gyro += 0.02 * (-1) ** row


@pytest.mark.parametrize(
    ("message", "change"),
    [
        ("it moved while it should rest", nudge),
        ("it moved while it should rest", tip),
        ("it moved while it should rest", shake),
        (r"gravity shows as 11.7. m/s², \+20%", weigh),
        ("too noisy for the daemon to see that it is at rest", tremble),
    ],
)
def test_what_is_no_rest_is_refused(at_rest: list[ImuSample], message: str, change: Any) -> None:
    with pytest.raises(CalibrationError, match=message):
        measure(changed(at_rest, change))


def test_too_little_or_saturated_rest_is_refused(at_rest: list[ImuSample]) -> None:
    for few in (at_rest[:300], []):
        with pytest.raises(CalibrationError, match=rf"{len(few)} samples in .* are needed at least"):
            measure(few)
    with pytest.raises(CalibrationError, match="end of its range while at rest"):
        measure([replace(sample, saturated=i == 7) for i, sample in enumerate(at_rest)])


@pytest.mark.parametrize("axes", [CHIP, EXACT[5], EXACT[17]], ids=str)
def test_motions_by_an_unsteady_hand_show_exact_axes(turntable: Make, given: Make, guide: Guide, axes: Floats) -> None:
    samples = of_motions(turntable, axes=axes, angles=by_hand(40, 50, 80, askew_deg=8))
    result = calibrate_motions(given(samples), Config(), radians(15), guide)
    assert result.values["axes"] == axes.tolist()
    assert result.values["gyro_noise_radps"] == pytest.approx(0.0052, abs=0.0003)
    assert any("taken as exact" in line for line in result.findings)


def test_straight_motions_show_any_axes_within_a_degree(turntable: Make, given: Make, guide: Guide) -> None:
    axes = best_rotation(np.random.default_rng(8).normal(size=(3, 3)))[0]
    result = calibrate_motions(given(of_motions(turntable, axes=axes)), Config(), 0.0, guide)
    assert angle_rad(np.array(result.values["axes"]), axes) < radians(1)


def test_the_mounting_of_the_camera_is_allowed_for(turntable: Make, given: Make, guide: Guide) -> None:
    camera = Camera(pitch_rad=-0.2, yaw_rad=0.1)
    travel = camera_from_vehicle(camera) @ (0, 0, 1)
    assert travel / travel[2] == pytest.approx((-np.tan(0.1), np.tan(-0.2), 1), abs=3e-3)
    result = calibrate_motions(given(of_motions(turntable, axes=CHIP)), Config(camera=camera), 0.3, guide)
    assert angle_rad(np.array(result.values["axes"]), camera_from_vehicle(camera) @ CHIP) < 1e-4


@pytest.mark.parametrize(
    ("message", "angles"),
    [
        ("the motions contradict each other", by_hand(side_deg=-45)),
        ("the motions contradict each other", by_hand(left_deg=-90)),
        ("end before this was seen: nose down; expected, in this order: rest on level ground", by_hand(10, 10)),
        ("end before this was seen: right side down", by_hand(10)),
        ("end before this was seen: left turn", by_hand(left_deg=20)),
    ],
)
def test_motions_that_show_no_axes_are_refused(
    turntable: Make, given: Make, guide: Guide, message: str, angles: Any
) -> None:
    with pytest.raises(CalibrationError, match=message):
        calibrate_motions(given(of_motions(turntable, angles=angles)), Config(), 0.3, guide)


def test_a_motion_that_is_too_fast_for_the_gyro_is_refused(turntable: Make, given: Make, guide: Guide) -> None:
    samples = [
        replace(sample, saturated=max(map(abs, sample.gyro)) > 0.6) for sample in of_motions(turntable, axes=CHIP)
    ]
    with pytest.raises(CalibrationError, match=r"end of its range \(nose down\); move more slowly"):
        calibrate_motions(given(samples), Config(), 0.3, guide)
