"""The tables of IMUs tell what the registry of drivers has."""

import re
from collections.abc import Callable

import pytest

from drivers.imu import registry

Rows = Callable[[str, str], list[list[str]]]
Text = Callable[[str], str]
CHIPS = registry.chips()


@pytest.fixture
def chip_rows(rows: Rows) -> dict[str, list[str]]:
    return {row[0].strip("`"): row for row in rows("docs/imus.md", "## Chips on I2C")}


def test_every_chip_has_a_row(chip_rows: dict[str, list[str]]) -> None:
    assert list(chip_rows) == list(CHIPS)


@pytest.mark.parametrize("driver", CHIPS)
def test_a_row_tells_addresses_and_ranges_of_its_chip(text: Text, chip_rows: dict[str, list[str]], driver: str) -> None:
    chip = CHIPS[driver]
    _, models, addresses, own, *_ = chip_rows[driver]
    assert tuple(int(address, 16) for address in re.findall(r"0x[0-9a-f]+", addresses)) == chip.addresses
    (usual,) = re.findall(r"^Ranges are (.*?) where the table has none\.", text("docs/imus.md"), re.MULTILINE)
    for unit, ranges in (("°/s", chip.gyro_ranges), ("g", chip.accel_ranges)):
        (written, *_) = re.findall(rf"(\d[\d to]*) {unit}(?![\w/])", f"{own}, {usual}")
        numbers = list(map(int, written.split(" to ")))
        assert {min(numbers), max(numbers)} <= set(ranges)
        assert driver == "bno055" or (min(numbers), max(numbers)) == (min(ranges), max(ranges))
    assert chip.chip in models


def test_every_serial_protocol_has_a_row_with_its_baud_rates(rows: Rows) -> None:
    written = {row[0].strip("`"): row for row in rows("docs/serial-imu.md", "## Protocols")}
    protocols = registry.protocols()
    assert list(written) == list(protocols)
    for name, row in written.items():
        assert tuple(map(int, row[2].split(", "))) == protocols[name].bauds
