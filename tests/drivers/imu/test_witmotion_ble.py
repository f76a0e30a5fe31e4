"""WitMotion's Bluetooth frames, by the formulas of the maker's SDK."""

import math
import struct

import pytest

from drivers.imu.witmotion_ble import WitMotionBleParser

G = 9.80665


def frame(*values: int, kind: int = 0x61) -> bytes:
    """0x55, kind, nine int16 low byte first."""
    return struct.pack("<2B9h", 0x55, kind, *values, *(0,) * (9 - len(values)))


SAMPLE = frame(16384, -2048, 2048, -16384, 8192, 0, 100, 200, 300)


def test_units_are_those_of_the_sdk() -> None:
    first, _ = WitMotionBleParser().feed(SAMPLE * 2 + b"\x55\x61")
    assert first.accel == pytest.approx((8 * G, -G, G))
    assert first.gyro == pytest.approx((math.radians(-1000), math.radians(500), 0.0))
    assert not first.saturated


@pytest.mark.parametrize("place", range(6))
@pytest.mark.parametrize("raw", [32767, -32768])
def test_the_end_of_the_range_is_flagged(place: int, raw: int) -> None:
    values = [0] * 6
    values[place] = raw
    (reading,) = WitMotionBleParser().feed(frame(*values) + b"\x55\x61")
    assert reading.saturated


def test_a_reply_to_a_question_is_no_sample() -> None:
    parser = WitMotionBleParser()
    assert len(parser.feed(SAMPLE + frame(1, 2, 3, kind=0x71) + SAMPLE)) == 2
    assert not +parser.counts


def test_the_first_frame_waits_for_the_next_and_those_after_it_do_not() -> None:
    parser = WitMotionBleParser()
    assert parser.feed(SAMPLE) == []
    assert len(parser.feed(SAMPLE)) == 2
    assert len(parser.feed(SAMPLE)) == 1


def test_halves_of_two_frames_are_not_one() -> None:
    parser = WitMotionBleParser()
    parser.feed(SAMPLE * 2)
    readings = parser.feed(SAMPLE[:10] + frame(0, 0, 2048) * 3)
    assert [reading.accel[2] for reading in readings] == pytest.approx([G] * 3)
    assert all(reading.accel[:2] == (0.0, 0.0) for reading in readings)
    assert parser.counts["bad_frame"] == 1


def test_values_that_look_like_a_header_are_values() -> None:
    parser = WitMotionBleParser()
    looks = frame(0, *struct.unpack("<h", b"\x55\x61"), 2048)
    assert len(parser.feed(SAMPLE + looks * 3 + SAMPLE)) == 5
    assert not +parser.counts
