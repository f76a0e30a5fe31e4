"""Open an I2C chip by its name in the configuration."""

import argparse
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar, Protocol

from drivers.by_hand import describe_imu, positive, watch
from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.device import Device
from drivers.errors import UnsupportedSettingError
from drivers.imu import registry
from drivers.imu.i2c_bus import I2cBus
from drivers.imu.i2c_imu import Range
from drivers.imu.settings import DEFAULT_SETTINGS, ImuSettings
from drivers.samples import ImuSample


class I2cChip(Protocol):
    """An open chip, and what its class tells about it."""

    chip: ClassVar[str]
    addresses: ClassVar[tuple[int, ...]]  # the usual one first
    gyro_ranges: ClassVar[Mapping[int, Range]]  # by °/s
    accel_ranges: ClassVar[Mapping[int, Range]]  # by g
    name: str
    counts: Counter[str]

    def __init__(
        self, bus: I2cBus, address: int = 0, settings: ImuSettings = DEFAULT_SETTINGS, clock: Clock = SYSTEM_CLOCK
    ) -> None: ...

    @classmethod
    def recognised(cls, bus: I2cBus, address: int) -> str | None:
        """Return the model at an address, None: no such chip. Writes nothing."""
        ...

    @property
    def rate_hz(self) -> float:
        """The granted rate."""
        ...

    def read(self) -> Sequence[ImuSample]:
        """See ``Device``."""
        ...

    def close(self) -> None:
        """See ``Device``."""
        ...


def open_chip(
    driver: str, bus: int, address: int = 0, settings: ImuSettings = DEFAULT_SETTINGS, clock: Clock = SYSTEM_CLOCK
) -> Device[ImuSample]:
    """Open the chip at an address (0: its usual one) of ``/dev/i2c-<bus>``.

    Raises ``DriverError``, as ``I2cBus`` and ``I2cImu`` do.
    """
    return chip_on(I2cBus(bus, clock=clock), driver, address, settings, clock)


def chip_on(
    bus: I2cBus, driver: str, address: int = 0, settings: ImuSettings = DEFAULT_SETTINGS, clock: Clock = SYSTEM_CLOCK
) -> I2cChip:
    """The same on an open bus, which the chip then owns."""
    if not registry.has_interface(driver, "i2c"):
        bus.close()
        known = ", ".join(registry.names("i2c"))
        raise UnsupportedSettingError(f"{driver}: no such chip; set imu.driver to one of {known}")
    chip: type[I2cChip] = registry.DRIVERS[driver].load()
    return chip(bus, address, settings, clock)


def run_by_hand(driver: str, argv: Sequence[str] | None) -> int:
    """Run the command line of one chip's driver."""
    parser = argparse.ArgumentParser(prog=f"python -m drivers.imu.{driver}")
    parser.add_argument("--bus", type=int, default=1, help="N of /dev/i2c-N (%(default)s)")
    parser.add_argument("--address", type=_number, default=0, help="0: the chip's usual one")
    parser.add_argument("--rate", type=positive, default=DEFAULT_SETTINGS.rate_hz, help="Hz (%(default)s)")
    parser.add_argument("--gyro-range", type=int, default=DEFAULT_SETTINGS.gyro_range_dps, help="°/s (%(default)s)")
    parser.add_argument("--accel-range", type=int, default=DEFAULT_SETTINGS.accel_range_g, help="g (%(default)s)")
    parser.add_argument("--identity", type=_number, help="of a copy, taken for the chip all the same")
    parser.add_argument("--firmware", type=Path, default=DEFAULT_SETTINGS.firmware, help="of a BMI270 (%(default)s)")
    parser.add_argument("--seconds", type=positive, default=10.0, help="how long (%(default)s)")
    arguments = parser.parse_args(argv)
    settings = ImuSettings(
        arguments.rate, arguments.gyro_range, arguments.accel_range, arguments.identity, arguments.firmware
    )
    return watch(lambda: open_chip(driver, arguments.bus, arguments.address, settings), arguments.seconds, describe_imu)


def _number(text: str) -> int:
    """Decimal, or hexadecimal with 0x."""
    return int(text, 0)
