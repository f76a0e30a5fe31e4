"""Xsens MTData2 messages, in every number format that they come in."""

import math
import struct

import pytest

from drivers.imu.xsens import XsensParser
from drivers.samples import ImuSample
from hil_mocks.serial_imu import XsensEncoder, mtdata2

GYRO = struct.pack(">3f", 0.5, -0.25, 2.0)
ACCEL = struct.pack(">3f", 0.125, -9.5, 1.0)


def item(identifier: int, value: bytes) -> bytes:
    return struct.pack(">HB", identifier, len(value)) + value


def message(*items: tuple[int, bytes]) -> bytes:
    return mtdata2(b"".join(item(*each) for each in items))


def test_a_message_is_as_the_protocol_says() -> None:
    assert mtdata2(b"\x10\x20\x02\x00\x01") == bytes.fromhex("FA FF 36 05 10 20 02 00 01 93")


def test_rate_of_turn_and_acceleration_are_a_sample() -> None:
    (reading,) = XsensParser().feed(message((0x4020, ACCEL), (0x8020, GYRO)))

    assert reading.gyro == (0.5, -0.25, 2.0)
    assert reading.accel == (0.125, -9.5, 1.0)
    assert (reading.saturated, reading.lost, reading.ticks) == (False, 0, None)


@pytest.mark.parametrize("form", [0, 1, 2, 3])
def test_every_number_format_is_read(form: int) -> None:
    sample = ImuSample(12_345_600_000, (0.5, -0.25, -2.0), (0.125, -9.5, 300.0))

    (reading,) = XsensParser().feed(XsensEncoder(form)(sample))

    assert reading.gyro == sample.gyro
    assert reading.accel == sample.accel
    assert reading.ticks == 123_456  # of 0.1 ms


@pytest.mark.parametrize(("form", "value"), [(1, "FFF80000"), (2, "80000000FFFF"), (3, "BFE0000000000000")])
def test_minus_a_half_in_each_format(form: int, value: str) -> None:
    (reading,) = XsensParser().feed(message((0x4020, ACCEL), (0x8020 | form, bytes.fromhex(value) * 3)))

    assert reading.gyro == (-0.5, -0.5, -0.5)


def test_the_coordinate_system_does_not_matter() -> None:
    (reading,) = XsensParser().feed(message((0x4024, ACCEL), (0x8028, GYRO)))  # NED, NWU: of orientations only

    assert reading.gyro == (0.5, -0.25, 2.0)


@pytest.mark.parametrize("bit", range(32))
def test_an_axis_out_of_its_range_is_flagged(bit: int) -> None:
    status = struct.pack(">I", 1 << bit)

    (reading,) = XsensParser().feed(message((0x8020, GYRO), (0x4020, ACCEL), (0xE020, status)))

    assert reading.saturated == (8 <= bit <= 13)


def test_missing_packets_are_known_by_the_counter_also_where_it_begins_anew() -> None:
    parser = XsensParser()
    messages = [
        message((0x1020, struct.pack(">H", number)), (0x4020, ACCEL), (0x8020, GYRO)) for number in (65533, 65535, 0, 3)
    ]

    assert [reading.lost for reading in parser.feed(b"".join(messages))] == [0, 1, 0, 2]
    assert parser.counts["lost"] == 3


def test_a_counter_that_jumps_far_has_begun_anew() -> None:
    parser = XsensParser()
    messages = [message((0x1020, struct.pack(">H", number)), (0x4020, ACCEL), (0x8020, GYRO)) for number in (9000, 0)]

    assert [reading.lost for reading in parser.feed(b"".join(messages))] == [0, 0]


@pytest.mark.parametrize(
    "items",
    [
        [(0x4020, ACCEL)],
        [(0x8020, GYRO)],
        [(0x4020, ACCEL), (0x8020, GYRO[:8])],
        [(0x4020, ACCEL), (0x8020, struct.pack(">3f", 0.0, math.nan, 0.0))],
        [(0x4020, struct.pack(">3f", math.inf, 0.0, 0.0)), (0x8020, GYRO)],
    ],
)
def test_a_message_without_both_gives_no_sample(items: list[tuple[int, bytes]]) -> None:
    parser = XsensParser()

    assert parser.feed(message(*items)) == []
    assert parser.counts["incomplete"] == 1


def test_an_item_that_reaches_beyond_its_message_ends_it() -> None:
    parser = XsensParser()
    long = item(0x4020, ACCEL) + item(0x8020, GYRO)[:-1]

    assert parser.feed(mtdata2(long)) == []
    assert parser.counts["incomplete"] == 1


def test_long_messages_have_two_more_bytes_of_length() -> None:
    rest = (0x3010, bytes(100))

    (reading,) = XsensParser().feed(message(rest, rest, rest, (0x4020, ACCEL), (0x8020, GYRO)))

    assert reading.accel == (0.125, -9.5, 1.0)


def test_a_length_that_no_message_has_is_damage() -> None:
    parser = XsensParser()

    readings = parser.feed(b"\xfa\xff\x36\xff\xff\xff" + message((0x4020, ACCEL), (0x8020, GYRO)))

    assert len(readings) == 1
    assert parser.counts["skipped_bytes"] == 6
