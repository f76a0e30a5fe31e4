"""WitMotion's standard protocol, by its data sheet's formulas."""

import math

import pytest

from drivers.imu.witmotion import WitMotionParser

G = 9.80665


def frame(kind: int, *values: int) -> bytes:
    """0x55, type, four int16 low byte first, sum."""
    body = bytes([0x55, kind]) + b"".join(value.to_bytes(2, "little", signed=True) for value in values)
    return body + bytes([sum(body) % 256])


ACCELERATION = frame(0x51, 16384, -2048, 2048, 2500)
ANGULAR_VELOCITY = frame(0x52, -16384, 8192, 0, 2500)
ANGLE = frame(0x53, 1, 2, 3, 4)


def test_units_are_those_of_the_data_sheet() -> None:
    (reading,) = WitMotionParser().feed(ACCELERATION + ANGULAR_VELOCITY)

    assert reading.accel == pytest.approx((8 * G, -G, G))
    assert reading.gyro == pytest.approx((math.radians(-1000), math.radians(500), 0.0))
    assert not reading.saturated


def test_times_angles_and_the_rest_are_passed_over() -> None:
    parser = WitMotionParser()

    readings = parser.feed(
        (frame(0x50, 1, 2, 3, 4) + ACCELERATION + ANGULAR_VELOCITY + ANGLE + frame(0x54, 0, 0, 0, 0)) * 3
    )

    assert len(readings) == 3
    assert not +parser.counts


@pytest.mark.parametrize("kind", [0x51, 0x52])
@pytest.mark.parametrize("raw", [32767, -32768])
def test_the_end_of_the_range_is_flagged(kind: int, raw: int) -> None:
    clipped = frame(kind, 0, raw, 0, 0)
    pair = clipped + ANGULAR_VELOCITY if kind == 0x51 else ACCELERATION + clipped

    (reading,) = WitMotionParser().feed(pair)

    assert reading.saturated


def test_halves_of_two_samples_are_not_one() -> None:
    parser = WitMotionParser()

    lost_gyro = parser.feed(ACCELERATION)
    (after,) = parser.feed(ACCELERATION + ANGULAR_VELOCITY)
    lost_accel = parser.feed(ANGULAR_VELOCITY)
    (last,) = parser.feed(ACCELERATION + ANGULAR_VELOCITY)

    assert lost_gyro == lost_accel == []
    assert (after.lost, last.lost) == (1, 1)
    assert parser.counts["incomplete"] == 2


def test_a_wrong_sum_is_refused_and_the_next_frame_is_found() -> None:
    parser = WitMotionParser()
    damaged = bytearray(ACCELERATION)
    damaged[4] ^= 0x10

    readings = parser.feed(bytes(damaged) + ANGULAR_VELOCITY + ACCELERATION + ANGULAR_VELOCITY)

    assert len(readings) == 1
    assert parser.counts["bad_frame"] >= 1
