"""Opening a bus of Linux, and finding out who is on it."""

import errno
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.errors import DeviceForbiddenError, DeviceLostError, DeviceMissingError, UnsupportedSettingError
from drivers.imu.i2c_bus import I2cBus
from hil_mocks.i2c import SimulatedBus
from hil_mocks.i2c.mpu import Mpu6050
from hil_mocks.virtual_clock import VirtualClock

NOBODY = 65534


def test_a_missing_bus_is_reported_with_those_that_are_there(tmp_path: Path) -> None:
    for number in (0, 10):
        (tmp_path / f"i2c-{number}").touch()
    with pytest.raises(DeviceMissingError) as raised:
        I2cBus(1, dev=tmp_path)
    assert str(raised.value) == (
        f"{tmp_path}/i2c-1: no such bus; there is {tmp_path}/i2c-0, {tmp_path}/i2c-10; set imu.bus"
    )


def test_no_bus_at_all_is_reported(tmp_path: Path) -> None:
    with pytest.raises(DeviceMissingError, match="no such bus; this computer has none; enable I2C and load i2c-dev"):
        I2cBus(1, dev=tmp_path)


@pytest.fixture
def forbidden(tmp_path: Path) -> Iterator[Path]:
    """A folder with a bus that we may not open; root becomes nobody for as long."""
    (tmp_path / "i2c-1").touch(0o000)
    before = os.geteuid()
    if before == 0:
        os.seteuid(NOBODY)
    yield tmp_path
    os.seteuid(before)


def test_a_bus_without_permission_names_the_group(forbidden: Path) -> None:
    with pytest.raises(DeviceForbiddenError, match="no permission; add the user to the group i2c"):
        I2cBus(1, dev=forbidden)


def test_what_is_no_bus_is_reported_and_closed(tmp_path: Path) -> None:
    (tmp_path / "i2c-1").touch()
    before = set(os.listdir("/proc/self/fd"))  # noqa: PTH208 descriptors, not files
    with pytest.raises(DeviceLostError, match=r"i2c-1: cannot be opened .*; is it an I2C bus\?"):
        I2cBus(1, dev=tmp_path)
    assert set(os.listdir("/proc/self/fd")) <= before  # noqa: PTH208


def wire_with(*addresses: int) -> SimulatedBus:
    clock = VirtualClock()
    chip = Mpu6050(lambda _: ((0.0, 0.0, 0.0), (0.0, 0.0, 9.8)), clock)
    return SimulatedBus(clock, dict.fromkeys(addresses, chip))


def test_scan_finds_who_acknowledges_and_whom_the_kernel_owns() -> None:
    wire = wire_with(0x1C, 0x68)
    wire.owned_by_kernel.add(0x50)
    assert I2cBus(1, wire).scan() == [0x1C, 0x50, 0x68]


def test_scan_ends_when_the_bus_hangs() -> None:
    wire = wire_with(0x68)
    wire.hanging = True
    assert I2cBus(1, wire).scan() == []
    assert wire.transfers == 1


def test_a_bus_without_block_transfers_is_reported() -> None:
    wire = wire_with(0x68)
    wire.fail(errno.EOPNOTSUPP)
    with pytest.raises(UnsupportedSettingError, match="no I2C block transfers; use another bus"):
        I2cBus(1, wire).read(0x68, 0x75, 1)


def test_a_bus_that_went_away_is_not_tried_again() -> None:
    wire = wire_with(0x68)
    wire.fail(errno.ENODEV, times=9)
    with pytest.raises(DeviceLostError):
        I2cBus(1, wire).read(0x68, 0x75, 1)
    assert wire.transfers == 1
