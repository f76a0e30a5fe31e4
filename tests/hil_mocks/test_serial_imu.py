"""The stand-in for a serial IMU is as real as it gets: what a UART hears, what a terminal does, true time."""

import math
import os
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from drivers.samples import ImuSample
from hil_mocks.serial_imu import (
    CsvEncoder,
    SerialImuStandIn,
    cut_short,
    flipped_bits,
    garbage,
    heard_at,
    silent,
    still,
    yaw_pitch_roll,
)

BAUDS = [9600, 57600, 115200, 230400, 921600]


@pytest.fixture
def stand_in(tmp_path: Path) -> Iterator[SerialImuStandIn]:
    stand_in = SerialImuStandIn(CsvEncoder(), islice(still(100), 30), tmp_path / "imu")
    yield stand_in
    stand_in.close()


def lines_of(port: serial.Serial, count: int) -> list[bytes]:
    return [port.readline() for _ in range(count)]


def test_what_is_sent_is_read(stand_in: SerialImuStandIn) -> None:
    with serial.Serial(stand_in.port, 115200, timeout=5) as port:
        assert stand_in.send(3) == 3

        assert lines_of(port, 3) == [CsvEncoder()(sample) for sample in islice(still(100), 3)]


def test_the_recording_ends(stand_in: SerialImuStandIn) -> None:
    with serial.Serial(stand_in.port, 115200):
        assert stand_in.send(100) == 30
        assert stand_in.send(1) == 0


def test_a_line_that_nobody_reads_loses_what_is_sent(stand_in: SerialImuStandIn) -> None:
    with serial.Serial(stand_in.port, 115200):
        for _ in range(100):
            stand_in.send_bytes(bytes(10_000))


def test_sent_to_nobody(stand_in: SerialImuStandIn) -> None:
    stand_in.unplug()

    stand_in.send_bytes(b"hello")
    assert not os.path.lexists(stand_in.port)


def test_played_in_true_time(stand_in: SerialImuStandIn) -> None:
    with serial.Serial(stand_in.port, 115200, timeout=5) as port:
        stand_in.play()

        assert all(line.endswith(b"\r\n") for line in lines_of(port, 30))
        stand_in.wait()
    assert stand_in.sent == 30


def test_pulled_out_by_hand_while_it_plays_it_stays_out(stand_in: SerialImuStandIn) -> None:
    with serial.Serial(stand_in.port, 115200, timeout=5) as port:
        stand_in.play()
        port.readline()
        stand_in.unplug()
        stand_in.wait()

    assert not os.path.lexists(stand_in.port)
    assert stand_in.sent == 30


def test_closing_ends_the_play_and_takes_the_name_away(stand_in: SerialImuStandIn) -> None:
    stand_in.play()
    stand_in.close()
    stand_in.close()

    assert not os.path.lexists(stand_in.port)


def test_a_reader_at_another_rate_hears_something_else(stand_in: SerialImuStandIn) -> None:
    with serial.Serial(stand_in.port, 57600, timeout=5) as port:
        stand_in.send(10)
        heard = port.read(60)

    assert len(heard) == 60
    assert heard not in b"".join(CsvEncoder()(sample) for sample in islice(still(100), 30))


@given(st.binary(max_size=40), st.sampled_from(BAUDS))
def test_the_same_rate_hears_what_was_sent(data: bytes, baud: int) -> None:
    assert heard_at(data, baud, baud) == data
    assert heard_at(data, round(baud * 1.0001), baud) == data


@given(st.binary(max_size=200), st.sampled_from(BAUDS), st.sampled_from(BAUDS))
def test_a_receiver_hears_no_more_bytes_than_fit(data: bytes, sent: int, read: int) -> None:
    assert len(heard_at(data, sent, read)) <= len(data) * 10 * read / sent + 1


def test_half_the_rate_by_the_bits_on_the_line() -> None:
    """The receiver's bits are two of the sender's: of nine low ones it takes the start and three of data."""
    assert heard_at(b"\xff", 115200, 57600) == b"\xff"
    assert heard_at(b"\x00", 115200, 57600) == b"\xf8"


def test_faults_do_what_they_say() -> None:
    data = bytes(range(100))

    assert garbage(10)(data)[10:] == data
    assert cut_short(0.3)(data) == data[:30]
    assert silent(data) == b""
    flipped = flipped_bits(3)(data)
    assert sum((a ^ b).bit_count() for a, b in zip(flipped, data, strict=True)) == 3


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_angles_are_those_of_the_rotation(yaw: float, pitch: float, roll: float) -> None:
    def about(axis: int, angle: float) -> np.ndarray:
        cosine, sine = math.cos(angle), math.sin(angle)
        turn = np.roll([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]], (axis, axis), (0, 1))
        return np.asarray(turn)

    turn = about(2, -yaw) @ about(0, pitch) @ about(1, roll)

    assert yaw_pitch_roll(turn) == pytest.approx((yaw, pitch, roll), abs=1e-6)


def test_still_lies_level() -> None:
    assert list(islice(still(200, 5), 2)) == [
        ImuSample(5, (0.0, 0.0, 0.0), (0.0, 0.0, 9.80665)),
        ImuSample(5_000_005, (0.0, 0.0, 0.0), (0.0, 0.0, 9.80665)),
    ]
