"""The line format for everybody's own microcontroller, as ``docs/serial-imu.md`` has it."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.imu.csv_line import MAX_LINE_BYTES, CsvParser
from drivers.imu.serial_frames import Reading

DOCUMENT = Path(__file__).parents[3] / "docs" / "serial-imu.md"

finite = st.floats(-60, 60, allow_nan=False)


def lines(text: str) -> tuple[list[Reading], CsvParser]:
    parser = CsvParser()
    return parser.feed(b"\n" + text.encode()), parser


def test_a_line_with_time() -> None:
    (reading,), parser = lines("123456,0.01,-0.02,0.5,0.1,-9.8,1e-1\r\n")

    assert reading == Reading((0.01, -0.02, 0.5), (0.1, -9.8, 0.1), ticks=123456)
    assert not parser.counts


def test_the_time_may_be_left_out() -> None:
    (reading,), _ = lines("0.01,-0.02,.5,0.1,-9.8,1.\n")

    assert reading == Reading((0.01, -0.02, 0.5), (0.1, -9.8, 1.0))


def test_an_axis_out_of_its_range_is_reported_after_the_last_number() -> None:
    clipped, _ = lines("1,0,0,0,0,0,9.8,1\n2,0,0,0,0,0,9.8,0\n")

    assert [reading.saturated for reading in clipped] == [True, False]


def test_blanks_remarks_and_empty_lines_are_welcome() -> None:
    readings, parser = lines("# time_us,gx,gy,gz,ax,ay,az\n\n  1, 0, 0, 0, 0, 0, 9.8 \r\n")

    assert len(readings) == 1
    assert not parser.counts


def test_the_examples_of_the_document_are_read() -> None:
    examples = re.findall(r"```text\n(.*?)```", DOCUMENT.read_text(), re.DOTALL)
    assert len(examples) >= 3

    for example in examples:
        readings, parser = lines(example)
        assert len(readings) == sum(not line.startswith("#") for line in example.splitlines())
        assert not parser.counts


@pytest.mark.parametrize(
    "line",
    [
        "0,0,0,0,0",  # too few
        "1,0,0,0,0,0,9.8,0,0",  # too many
        "0,0,0,0,0,nan",
        "0,0,0,0,0,inf",
        "0,0,0,0,0,0x10",
        "0,0,0,0,0,1_0",
        "0,0,0,0,0,٣",
        "-1,0,0,0,0,0,9.8",  # a time before the beginning
        "0,0,0,0,0,9.8;",
        "71,0,0,0,0,9.8",  # rad/s that no gyro measures
        "0,0,0,0,0,321",
        "0,0,0,0,0,9.8*",
        "0,0,0,0,0,9.8*00",
        "0,0,0,0,0,9.8*3",
        "0,0,0,0,0,1e999",
        "0" * (MAX_LINE_BYTES + 1),
    ],
)
def test_any_other_line_is_refused_and_counts_as_a_lost_sample(line: str) -> None:
    (good, after), parser = lines(f"0,0,0,0,0,9.8\n{line}\n0,0,0,0,0,9.8\n")

    assert (good.lost, after.lost) == (0, 1)
    assert parser.counts["bad_line"] == 1


def test_the_checksum_is_the_exclusive_or_of_what_stands_before_it() -> None:
    readings, parser = lines("1,0,0,0,0,0,9.8*2E\n2,0,0,0,0,0,9.8*2d\n3,0,0,0,0,0,9.9*2C\n")

    assert len(readings) == 2
    assert parser.counts["bad_checksum"] == 1


def test_a_stream_with_checksums_goes_on_having_them() -> None:
    readings, _ = lines("1,0,0,0,0,0,9.8*2E\n2,0,0,0,0,0,9.8\n3,0,0,0,0,0,9.8*2C\n")

    assert [reading.ticks for reading in readings] == [1, 3]


def test_a_line_of_another_form_than_the_one_before_is_refused() -> None:
    readings, _ = lines("1,0,0,0,0,0,9.8\n2,0,0,0,0,0,9.8\n0,0,0,0,0,9.8\n3,0,0,0,0,0,9.8\n4,0,0,0,0,0,9.8\n")

    assert [reading.ticks for reading in readings] == [1, 2, 4]


def test_what_comes_before_the_first_end_of_a_line_is_passed_over() -> None:
    readings = CsvParser().feed(b"4,0,0,0,0,0,9.8\n5,0,0,0,0,0,9.8\n")

    assert [reading.ticks for reading in readings] == [5]


@given(st.lists(st.tuples(*[finite] * 6), min_size=1, max_size=5))
def test_numbers_as_printed_come_back(samples: list[tuple[float, ...]]) -> None:
    readings, _ = lines("".join(",".join(f"{value:.9e}" for value in sample) + "\n" for sample in samples))

    for reading, sample in zip(readings, samples, strict=True):
        assert reading.gyro + reading.accel == pytest.approx(sample, rel=1e-9)
