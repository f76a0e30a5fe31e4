"""What every parser of a serial protocol promises: any bytes, split anyhow, are survived in bounded memory."""

import math
from collections.abc import Callable, Iterator
from itertools import islice, pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.imu.registry import protocols
from drivers.imu.serial_frames import Parser, Reading
from drivers.samples import ImuSample
from hil_mocks.serial_imu import ENCODERS, Encoder, cut_short, flipped_bits, garbage

MAX_HELD_BYTES = 2100

PROTOCOLS = protocols()
UNCHECKED = ("witmotion_ble", "bno08x_uart")  # no checksum: a wrong bit among the values is not noticed
names = pytest.mark.parametrize("name", sorted(PROTOCOLS))


def moving(rate_hz: float = 100.0) -> Iterator[ImuSample]:
    """An IMU that turns and shakes."""
    for number in range(1_000_000):
        swing = math.sin(number / 20)
        yield ImuSample(
            round(number * 1e9 / rate_hz), (0.3 * swing, -0.2 * swing, 0.5), (0.5 * swing, -0.3, 9.8 + 0.2 * swing)
        )


def spoken(encoder: Encoder, count: int) -> list[bytes]:
    return [encoder(sample) for sample in islice(moving(), count)]


def fed(parser: Parser, data: bytes, splits: list[int] | None = None) -> list[Reading]:
    bounds = [0, *sorted(min(split, len(data)) for split in splits or []), len(data)]
    return [reading for begin, end in pairwise(bounds) for reading in parser.feed(data[begin:end])]


def opening(name: str) -> bytes:
    """What a stream begins with before its first sample can be read."""
    return b"\n" if name == "csv" else b""


def held_bytes(parser: Parser) -> int:
    framer = getattr(parser, "_framer", None)
    return framer.held_bytes if framer else len(getattr(parser, "_rest"))  # noqa: B009


stream_parts = st.one_of(
    st.binary(max_size=60),
    st.sampled_from(
        [b"\x55", b"\x55\x51", b"\xaa\xaa", b"\xfa\xff\x36", b"\xfa\xff\x36\xff\x08\x00", b"\n", b"1,2,3,4,5,6\n"]
    ),
    st.integers(0, 9),  # a sample as the IMU sends it
)


@names
@given(st.lists(stream_parts, max_size=12), st.lists(st.integers(0, 800), max_size=12))
def test_any_bytes_give_the_same_readings_however_they_are_split(
    name: str, parts: list[bytes | int], splits: list[int]
) -> None:
    samples = spoken(ENCODERS[name](), 10)
    data = b"".join(samples[part] if isinstance(part, int) else part for part in parts)
    whole, pieces = PROTOCOLS[name].parser(), PROTOCOLS[name].parser()

    assert fed(whole, data) == fed(pieces, data, splits)
    assert whole.counts == pieces.counts
    assert held_bytes(whole) == held_bytes(pieces) <= MAX_HELD_BYTES


@names
def test_memory_is_bounded_by_the_longest_frame(name: str) -> None:
    parser = PROTOCOLS[name].parser()
    for seed in range(50):
        parser.feed(np.random.default_rng(seed).bytes(2000))
        assert held_bytes(parser) <= MAX_HELD_BYTES
    parser.feed(b"7" * 100_000)
    assert held_bytes(parser) <= MAX_HELD_BYTES


@names
def test_a_clean_stream_counts_nothing(name: str) -> None:
    parser = PROTOCOLS[name].parser()

    readings = fed(parser, opening(name) + b"".join(spoken(ENCODERS[name](), 50)))

    assert len(readings) >= 49
    assert not +parser.counts
    assert sum(reading.lost for reading in readings) == 0


@names
@pytest.mark.parametrize("fault", [garbage(200), flipped_bits(1), cut_short(0.5)])
def test_a_damaged_sample_costs_itself_and_no_more_than_two_others(name: str, fault: Callable[[bytes], bytes]) -> None:
    for position in range(3, 12):
        parser = PROTOCOLS[name].parser()
        samples = spoken(ENCODERS[name](), 20)
        samples[position] = fault(samples[position]) or b""

        readings = fed(parser, opening(name) + b"".join(samples))

        assert len(readings) >= 20 - 3
        if name not in UNCHECKED:
            assert sum(parser.counts.values()) > 0


@names
def test_what_another_protocol_says_is_no_reading(name: str) -> None:
    for other in sorted(PROTOCOLS.keys() - {name}):
        parser = PROTOCOLS[name].parser()
        assert fed(parser, b"".join(spoken(ENCODERS[other](), 100))) == []
