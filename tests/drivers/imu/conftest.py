"""A chip model on a wire, and the shipped driver that talks to it."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import pytest

from drivers.imu.i2c_bus import I2cBus
from drivers.imu.i2c_chips import chip_on
from drivers.imu.i2c_imu import I2cImu
from drivers.imu.settings import ImuSettings
from drivers.samples import ImuSample
from hil_mocks.i2c import CHIPS, Motion, SimulatedBus, SimulatedChip
from hil_mocks.i2c.bmi import Bmi270
from hil_mocks.virtual_clock import VirtualClock

G = 9.80665


def still(_: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    return (0.0, 0.0, 0.0), (0.0, 0.0, G)


def moving(t: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """A smooth motion in which every channel is different and no value comes twice."""
    gyro = (0.8 * math.sin(1.3 * t), 0.5 * math.cos(0.9 * t), -0.6 * math.sin(0.7 * t + 1))
    return gyro, (2 * math.sin(1.1 * t), -1.5 * math.cos(0.8 * t), G + math.sin(2.1 * t))


@dataclass
class Rig:
    """``device`` is opened when it is first asked for."""

    driver: str
    firmware: Path
    motion: Motion = moving
    settings: ImuSettings = field(default_factory=ImuSettings)
    rate_error: float = 0.0
    address: int = 0

    def __post_init__(self) -> None:
        self.clock = VirtualClock()
        self.chip: SimulatedChip = CHIPS[self.driver](self.motion, self.clock, self.rate_error)
        self.wire = SimulatedBus(self.clock, self.chip.places)
        self.began_ns = self.clock.monotonic_ns()

    def open(self) -> I2cImu:
        bus = I2cBus(1, self.wire, self.clock)
        settings = replace(self.settings, firmware=self.firmware)
        return chip_on(bus, self.driver, self.address, settings, self.clock)

    @cached_property
    def device(self) -> I2cImu:
        return self.open()

    def read_for(self, seconds: float) -> list[ImuSample]:
        samples: list[ImuSample] = []
        self.device  # noqa: B018 opened now
        end_ns = self.clock.monotonic_ns() + seconds * 1e9
        while self.clock.monotonic_ns() < end_ns:
            samples += self.device.read()
        return samples

    def true(self, sample: ImuSample) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        return self.motion((sample.stamp_ns - self.began_ns) / 1e9)


@pytest.fixture(scope="session")
def firmware(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("firmware") / "bmi270-init-data.fw"
    path.write_bytes(Bmi270.firmware)
    return path


@pytest.fixture
def rig(firmware: Path) -> Callable[..., Rig]:
    def build(driver: str = "mpu6050", **values: object) -> Rig:
        return Rig(driver, firmware, **values)  # type: ignore[arg-type]

    return build


@pytest.fixture
def at_rest() -> Motion:
    return still
