"""UART-RVC frames of a BNO08x, and the rates that are taken from their angles."""

import math
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.imu.bno08x_rvc import MAX_SPAN, RvcParser, decode
from drivers.samples import ImuSample
from hil_mocks.serial_imu import RvcEncoder

EXAMPLE = bytes.fromhex("AAAA DE 0100 92FF 2508 8DFE ECFF D103 000000 E7")  # of the data sheet, section 1.3.5.2
G = 9.80665


def frame(
    number: int, yaw: float = 0, pitch: float = 0, roll: float = 0, accel: tuple[int, int, int] = (0, 0, 1000)
) -> bytes:
    """Angles in degrees, acceleration in mg."""
    body = struct.pack("<B6h3x", number % 256, round(100 * yaw), round(100 * pitch), round(100 * roll), *accel)
    return b"\xaa\xaa" + body + bytes([sum(body) % 256])


def test_the_example_of_the_data_sheet() -> None:
    found = decode(EXAMPLE)

    assert found.number == 222
    assert found.accel == pytest.approx((-0.371 * G, -0.020 * G, 0.977 * G))
    assert not found.clipped


def test_the_angles_of_the_example_agree_with_its_acceleration() -> None:
    """At rest the acceleration is up, seen in the axes of the chip: this is how the axes of the angles are known."""
    found = decode(EXAMPLE)
    w, x, y, z = found.turn
    up = np.array([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])

    assert up == pytest.approx(np.array(found.accel) / np.linalg.norm(found.accel), abs=2e-3)


@pytest.mark.parametrize(
    ("angles", "gyro_dps"), [((-0.5, 0, 0), (0, 0, 50)), ((0, 0.5, 0), (50, 0, 0)), ((0, 0, 0.5), (0, 50, 0))]
)
def test_a_turn_between_two_frames_is_a_rate(
    angles: tuple[float, float, float], gyro_dps: tuple[int, int, int]
) -> None:
    (reading,) = RvcParser().feed(frame(0) + frame(1, *angles))

    assert reading.gyro == pytest.approx([math.radians(rate) for rate in gyro_dps], abs=1e-6)
    assert (reading.spans, reading.lost) == (1, 0)


def test_the_first_frame_has_no_rate() -> None:
    assert RvcParser().feed(frame(7)) == []


@pytest.mark.parametrize(("before", "after"), [(179.8, -179.9), (-179.9, 179.8)])
def test_yaw_and_roll_go_on_across_half_a_turn(before: float, after: float) -> None:
    (yawed,) = RvcParser().feed(frame(0, yaw=before) + frame(1, yaw=after))
    (rolled,) = RvcParser().feed(frame(0, roll=before) + frame(1, roll=after))

    expected = math.copysign(math.radians(0.3) * 100, before)
    assert yawed.gyro == pytest.approx((0, 0, -expected), abs=1e-6)
    assert rolled.gyro == pytest.approx((0, expected, 0), abs=1e-6)


def test_the_acceleration_is_the_mean_of_the_two_frames() -> None:
    (reading,) = RvcParser().feed(frame(0, accel=(0, 100, 1000)) + frame(1, accel=(200, -100, 1000)))

    assert reading.accel == pytest.approx((0.1 * G, 0.0, G))


def test_missing_frames_are_known_by_the_index() -> None:
    parser = RvcParser()

    (reading,) = parser.feed(frame(254) + frame(1, yaw=-3.0))

    assert (reading.lost, reading.spans, parser.counts["lost"]) == (2, 3, 2)
    assert reading.gyro[2] == pytest.approx(math.radians(100))


def test_over_a_long_gap_there_is_no_rate() -> None:
    parser = RvcParser()

    assert parser.feed(frame(0) + frame(MAX_SPAN + 1, yaw=90)) == []
    (after,) = parser.feed(frame(MAX_SPAN + 2, yaw=90))
    assert after.gyro == (0.0, 0.0, 0.0)
    assert after.lost == MAX_SPAN + 1


def test_a_frame_that_comes_twice_counts_once() -> None:
    parser = RvcParser()

    assert parser.feed(frame(0) + frame(0)) == []
    assert parser.counts["repeated"] == 1


@pytest.mark.parametrize("clipped", [frame(1, accel=(0, 8000, 0)), frame(1, yaw=25)])
def test_the_end_of_a_range_is_flagged(clipped: bytes) -> None:
    (reading,) = RvcParser().feed(frame(0) + clipped)

    assert reading.saturated


@given(st.integers(0, 1000), st.floats(0.05, 3.0))
def test_rates_add_up_to_the_turn_that_was_made(seed: int, max_radps: float) -> None:
    """The angles are told to 0.01°; their steps cancel, whatever the orientation."""
    rng = np.random.default_rng(seed)
    phases, speeds = rng.uniform(0, 2 * math.pi, 3), rng.uniform(1.0, 4.0, 3)
    times = np.arange(100) / 100
    gyro = max_radps * np.sin(phases + speeds * times[:, None])
    encoder, parser = RvcEncoder(), RvcParser()
    found = [
        reading.gyro
        for time, rate in zip(times, gyro, strict=True)
        for reading in parser.feed(encoder(ImuSample(round(time * 1e9), tuple(rate), (0.0, 0.0, G))))
    ]

    truth = (gyro[1:] + gyro[:-1]) / 2
    for begin in range(0, 90, 10):
        window = slice(begin, begin + 5)  # a frame interval
        turned = np.sum(np.array(found)[window], axis=0) / 100
        assert turned == pytest.approx(np.sum(truth[window], axis=0) / 100, abs=math.radians(0.03) + 2e-4 * max_radps)
