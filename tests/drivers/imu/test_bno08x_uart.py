"""BNO08x in UART-SHTP mode: its frames, and what it is told."""

import math
import struct
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.imu.bno08x_uart import MAX_FRAME_BYTES, ShtpUartParser, framed
from drivers.imu.serial_imu import open_port
from drivers.imu.settings import ImuSettings
from hil_mocks.serial_imu import SerialImuStandIn, ShtpUartEncoder, shtp_packet, still


def reports(gyro: tuple[int, int, int], accel: tuple[int, int, int], number: int = 0) -> bytes:
    cargo = b"\xfb" + bytes(4)
    for sensor, values in ((1, accel), (2, gyro)):
        cargo += struct.pack("<4B3h", sensor, number, 3, 0, *values)
    return shtp_packet(3, number, cargo)


RESET_COMPLETE = shtp_packet(1, 0, b"\x01")
STATUS = b"\x7e\x00\x00\x01\x7e"


def sensors(said: list[bytes]) -> list[tuple[int, int]]:
    """Sensor and interval in µs of each request."""
    return [(one[7], struct.unpack_from("<I", one, 11)[0]) for one in said]


def test_units_are_those_of_the_reference_manual() -> None:
    (reading,) = ShtpUartParser().feed(reports((512, -256, 51), (2560, -256, 128)))
    assert reading.gyro == pytest.approx((1.0, -0.5, 51 / 512))
    assert reading.accel == pytest.approx((10.0, -1.0, 0.5))


def test_flags_and_escapes_among_the_values_are_values() -> None:
    (reading,) = ShtpUartParser().feed(reports((0x7E, 0x7D, 0x5E), (0x7D7E, 0, 0x20))) or [None]
    assert reading is None  # 125 m/s² is no acceleration
    (reading,) = ShtpUartParser().feed(reports((0x7E, 0x7D, 0x5E), (0x7E, 0x7D, 0x20)))
    assert reading.gyro == pytest.approx((0x7E / 512, 0x7D / 512, 0x5E / 512))
    assert framed(b"\x7e\x7d\x00") == b"\x7e\x01\x7d\x5e\x7d\x5d\x00\x7e"


@pytest.mark.parametrize("place", range(6))
def test_the_end_of_the_range_is_flagged(place: int) -> None:
    values = [0] * 6
    values[place] = round(math.radians(2000) * 512) if place < 3 else round(8 * 9.80665 * 256)
    gyro, accel = (values[0], values[1], values[2]), (values[3], values[4], values[5])
    (reading,) = ShtpUartParser().feed(reports(gyro, accel))
    assert reading.saturated


def test_missing_numbers_are_lost_samples() -> None:
    parser = ShtpUartParser()
    parser.feed(reports((1, 1, 1), (0, 0, 2510), number=254))
    (reading,) = parser.feed(reports((1, 1, 1), (0, 0, 2510), number=1))
    assert reading.lost == parser.counts["lost"] == 2


def test_buffer_states_and_announcements_are_passed_over() -> None:
    parser = ShtpUartParser()
    stream = STATUS + shtp_packet(0, 0, bytes(272)) + RESET_COMPLETE + reports((1, 1, 1), (0, 0, 2510))
    assert len(parser.feed(stream)) == 1
    assert not +parser.counts


def test_a_packet_of_another_length_than_it_says_is_refused() -> None:
    parser = ShtpUartParser()
    good = reports((1, 1, 1), (0, 0, 2510))
    assert parser.feed(good[:-5] + b"\x7e" + good) != []
    assert parser.counts["bad_frame"] == 1


def test_a_line_without_flags_is_not_kept() -> None:
    parser = ShtpUartParser()
    parser.feed(b"7" * 100_000)
    assert len(parser._rest) <= MAX_FRAME_BYTES


def test_it_is_asked_at_once_again_when_silent_and_anew_after_a_reset() -> None:
    parser = ShtpUartParser()
    asked = parser.to_say(200.0, 0)
    assert sensors(asked) == [(1, 5000), (2, 5000)]
    assert [one[5] for one in asked] == [0, 1]  # numbers of the packets
    assert parser.to_say(200.0, 300_000_000) == []
    assert len(parser.to_say(200.0, 800_000_000)) == 2
    parser.feed(reports((1, 1, 1), (0, 0, 2510)))
    assert parser.to_say(200.0, 1_400_000_000) == []
    assert parser.to_say(200.0, 1_600_000_000) == []
    parser.feed(RESET_COMPLETE)
    assert sensors(parser.to_say(200.0, 1_600_000_001)) == [(1, 5000), (2, 5000)]
    assert parser.counts["chip_reset"] == 1


def test_a_rate_that_the_gyro_does_not_have_is_asked_for_as_400() -> None:
    assert sensors(ShtpUartParser().to_say(1000.0, 0)) == [(1, 2500), (2, 2500)]


@pytest.fixture
def plugged(tmp_path: Path) -> Iterator[SerialImuStandIn]:
    one = SerialImuStandIn(ShtpUartEncoder(), still(200.0), tmp_path / "imu")
    yield one
    one.close()


def test_the_port_carries_the_question_and_the_samples(plugged: SerialImuStandIn) -> None:
    device = open_port("bno08x_uart", plugged.port, 0, ImuSettings(rate_hz=100.0))
    assert device.read() == []
    parts = [part for part in plugged.heard().split(b"\x7e") if part]
    assert [(part[6], struct.unpack_from("<I", part, 10)[0]) for part in parts] == [(1, 10000), (2, 10000)]
    plugged.send(3)
    samples = list(device.read())
    assert samples[0].accel == pytest.approx((0.0, 0.0, 9.80665), abs=0.005)
    device.close()
