"""Opening an I2C chip by the name that the configuration gives it."""

import argparse
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path

from drivers.by_hand import describe_imu, watch
from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.device import Device
from drivers.errors import UnsupportedSettingError
from drivers.imu.i2c_bus import I2cBus
from drivers.imu.i2c_imu import I2cImu
from drivers.imu.settings import USUAL, ImuSettings
from drivers.records import ImuSample

CHIPS = {
    "mpu6050": "Mpu6050",
    "mpu6500": "Mpu6500",
    "mpu9250": "Mpu9250",
    "icm20948": "Icm20948",
    "lsm6ds3": "Lsm6ds3",
    "lsm6dso": "Lsm6dso",
    "lsm6dso32": "Lsm6dso32",
    "bmi160": "Bmi160",
    "bmi270": "Bmi270",
    "bno055": "Bno055",
}
"""Module → class."""

FIRMWARE = Path("/lib/firmware/bmi270-init-data.fw")


def open_chip(
    driver: str,
    bus: int,
    address: int = 0,
    settings: ImuSettings = USUAL,
    firmware: Path = FIRMWARE,
    clock: Clock = SYSTEM_CLOCK,
) -> Device[ImuSample]:
    """The chip at an address (0: its usual one) of ``/dev/i2c-<bus>``; ``firmware`` is for a BMI270.

    Raises ``DriverError``, as ``I2cBus`` and ``I2cImu`` do.
    """
    return chip_on(I2cBus(bus, clock=clock), driver, address, settings, firmware, clock)


def chip_on(
    bus: I2cBus,
    driver: str,
    address: int = 0,
    settings: ImuSettings = USUAL,
    firmware: Path = FIRMWARE,
    clock: Clock = SYSTEM_CLOCK,
) -> I2cImu:
    """The same on a bus that is open already; the chip owns it from now on."""
    if driver not in CHIPS:
        bus.close()
        raise UnsupportedSettingError(f"{driver}: no such chip; set imu.driver to one of {', '.join(CHIPS)}")
    chip: Callable[..., I2cImu] = getattr(import_module(f"drivers.imu.{driver}"), CHIPS[driver])
    options = {"firmware": firmware} if driver == "bmi270" else {}
    return chip(bus, address, settings, clock, **options)


def run_by_hand(driver: str, argv: Sequence[str] | None) -> int:
    """The command line of one chip's driver."""
    parser = argparse.ArgumentParser(prog=f"python -m drivers.imu.{driver}")
    parser.add_argument("--bus", type=int, default=1, help="N of /dev/i2c-N (%(default)s)")
    parser.add_argument("--address", type=lambda text: int(text, 0), default=0, help="0: the chip's usual one")
    parser.add_argument("--rate", type=float, default=USUAL.rate_hz, help="Hz (%(default)s)")
    parser.add_argument("--gyro-range", type=int, default=USUAL.gyro_range_dps, help="°/s (%(default)s)")
    parser.add_argument("--accel-range", type=int, default=USUAL.accel_range_g, help="g (%(default)s)")
    parser.add_argument("--firmware", type=Path, default=FIRMWARE, help="of a BMI270 (%(default)s)")
    parser.add_argument("--seconds", type=float, default=10.0, help="how long (%(default)s)")
    asked = parser.parse_args(argv)
    settings = ImuSettings(asked.rate, asked.gyro_range, asked.accel_range)
    return watch(
        lambda: open_chip(driver, asked.bus, asked.address, settings, asked.firmware), asked.seconds, describe_imu
    )
