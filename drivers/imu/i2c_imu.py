"""What I2C IMUs share: identity, settings with read-back, die temperature, recovery from resets.

A chip's file declares its registers; ``I2cImu`` sets them and checks them every ``CHECK_S``: if they changed, the chip
has reset itself and is set up again. ``fifo_imu`` and ``bno055`` build on it to read samples.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import ClassVar, Literal

from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.errors import (
    DeviceMissingError,
    DeviceStalledError,
    DriverError,
    UnsupportedSettingError,
    WrongDeviceError,
)
from drivers.imu import registry
from drivers.imu.i2c_bus import NO_ANSWER, TRIES, I2cBus, TransferError
from drivers.imu.settings import DEFAULT_SETTINGS, ImuSettings
from drivers.sample_clock import SampleClock
from drivers.samples import STANDARD_GRAVITY_MPS2, ImuSample

MAX_COUNT = 32767

CHECK_S = 0.5  # between checks of settings and temperature
PATIENCE = 8  # missing samples before the settings are checked
STALL_S = 0.5  # without a sample

Counts = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Range:
    """A measuring range of a chip."""

    code: int  # in its register
    lsb: float  # counts per °/s or g
    end: int = 0  # the count at full scale; 0: by range and word length

    def end_of(self, full_scale: int) -> int:
        """Return the count at which an axis saturates."""
        return self.end or min(int(full_scale * self.lsb), MAX_COUNT)


@dataclass(frozen=True, slots=True)
class Thermometer:
    """Register and scale of the die temperature: ``zero_c + counts / lsb_per_c``."""

    register: int
    byte_order: Literal["big", "little"]
    lsb_per_c: float
    zero_c: float  # at a count of 0
    size: int = 2
    invalid: int | None = None  # the count while there is none

    def celsius(self, data: bytes) -> float:
        """Convert to °C; NaN: none yet."""
        counts = int.from_bytes(data, self.byte_order, signed=True)
        return math.nan if counts == self.invalid else self.zero_c + counts / self.lsb_per_c


class Scale:
    """Converts counts to SI units; a count at the end of the set range is saturated."""

    def __init__(self, gyro: Range, gyro_range_dps: int, accel: Range, accel_range_g: int) -> None:
        self._gyro_radps = math.radians(1) / gyro.lsb
        self._accel_mps2 = STANDARD_GRAVITY_MPS2 / accel.lsb
        self._gyro_end = gyro.end_of(gyro_range_dps)
        self._accel_end = accel.end_of(accel_range_g)

    def sample(self, stamp_ns: int, gyro: Counts, accel: Counts) -> ImuSample:
        """Convert one sample."""
        p, q, r = gyro
        x, y, z = accel
        end, far = self._gyro_end, self._accel_end
        inside = -end < p < end and -end < q < end and -end < r < end
        inside = inside and -far < x < far and -far < y < far and -far < z < far
        g, a = self._gyro_radps, self._accel_mps2
        return ImuSample(stamp_ns, (p * g, q * g, r * g), (x * a, y * a, z * a), not inside)


class I2cImu(ABC):
    """An open IMU on an I2C bus. ``temperature_c``: of the die, NaN while unknown. ``rate_hz``: what was granted.

    Owns the bus. ``address`` 0 is the chip's usual one. Raises ``DeviceMissingError`` when no device answers there,
    ``WrongDeviceError`` when another chip does, ``UnsupportedSettingError`` for a range that it does not have or a
    setting that it does not keep, ``DeviceLostError`` when the bus fails.
    """

    chip: ClassVar[str]
    addresses: ClassVar[tuple[int, ...]]  # the usual one first
    identity_register: ClassVar[int]
    identities: ClassVar[Mapping[int, str]]  # value → model
    gyro_ranges: ClassVar[Mapping[int, Range]]  # by °/s
    accel_ranges: ClassVar[Mapping[int, Range]]  # by g
    thermometer: Thermometer

    def __init__(
        self, bus: I2cBus, address: int = 0, settings: ImuSettings = DEFAULT_SETTINGS, clock: Clock = SYSTEM_CLOCK
    ) -> None:
        self.address = address or self.addresses[0]
        self.name = f"{self.chip} at 0x{self.address:02x} on {bus.path}"
        self.counts = bus.counts
        self.temperature_c = math.nan
        self._bus = bus
        self._clock = clock
        self._silence_s = 0.0  # spent waiting since the last sample
        self._next_check_ns = 0
        try:
            self.rate_hz = self._granted_rate_hz(settings.rate_hz)
            gyro = self._range(self.gyro_ranges, "imu.gyro_range_dps", settings.gyro_range_dps)
            accel = self._range(self.accel_ranges, "imu.accel_range_g", settings.accel_range_g)
            self._scale = Scale(gyro, settings.gyro_range_dps, accel, settings.accel_range_g)
            self._settings = self._registers(gyro.code, accel.code)
            self._sample_clock = SampleClock(self.rate_hz)
            self.model = self._identify(settings.identity)
            self._start()
        except DriverError:
            self.close()
            raise

    @classmethod
    def recognised(cls, bus: I2cBus, address: int) -> str | None:
        """Return the model at an address by its identity alone; None: no such chip. Writes nothing."""
        return cls.identities.get(bus.read(address, cls.identity_register, 1, tries=2)[0])

    def read(self) -> Sequence[ImuSample]:
        """Return the samples since the last call, after waiting for some; none when they were lost and counted.

        Raises ``DeviceLostError`` when the bus fails, ``DeviceStalledError`` when no samples come.
        """
        begin_ns = self._clock.monotonic_ns()
        self._wait()
        samples = self._samples()
        now_ns = self._clock.monotonic_ns()
        # our own late wake-up does not count as the chip's silence
        self._silence_s = 0.0 if samples else self._silence_s + min((now_ns - begin_ns) / 1e9, STALL_S / 4)
        missing = self._silence_s * self.rate_hz
        if (now_ns >= self._next_check_ns or missing > PATIENCE) and not self._settings_hold():
            self.counts["chip_reset"] += 1
            self._start()
        elif missing > max(2 * PATIENCE, STALL_S * self.rate_hz):
            raise DeviceStalledError(f"{self.name}: answers, but has no samples; switch its supply off and on")
        return samples

    def close(self) -> None:
        """Close the bus."""
        self._bus.close()

    # What each chip defines.

    @abstractmethod
    def _granted_rate_hz(self, rate_hz: float) -> float:
        """Return the closest rate that the chip offers."""

    @abstractmethod
    def _registers(self, gyro_code: int, accel_code: int) -> Mapping[int, int]:
        """Return the registers to set for ``rate_hz`` and the ranges, in order; they read back as written."""

    @abstractmethod
    def _reset(self) -> None:
        """Bring the chip to its power-on state and wake it."""

    @abstractmethod
    def _begin(self) -> None:
        """Start sampling, after the settings."""

    @abstractmethod
    def _wait(self) -> None:
        """Wait until samples are due."""

    @abstractmethod
    def _samples(self) -> list[ImuSample]:
        """Return the samples available now, oldest first."""

    # What they share.

    def _read(self, register: int, length: int, tries: int = TRIES) -> bytes:
        return self._bus.read(self.address, register, length, tries)

    def _write(self, register: int, *values: int, tries: int = TRIES) -> None:
        self._bus.write(self.address, register, bytes(values), tries)

    def _command_reset(self, register: int, command: int) -> None:
        """Have the chip reset itself; it may do so before acknowledging, so the command is not retried."""
        with suppress(TransferError):
            self._write(register, command, tries=1)

    def _identify(self, copy: int | None) -> str:
        """Return the model by the chip's identity. ``copy``: the identity of a copy of the chip, to accept too."""
        try:
            found = self._read(self.identity_register, 1)[0]
        except TransferError as error:
            if error.number not in NO_ANSWER:
                raise
            there = self._bus.scan()
            if self.address in there:
                raise
            others = ", ".join(f"0x{address:02x}" for address in there)
            remedy = f"there is {others}; set imu.address" if there else "no device answers on this bus; check wiring"
            raise DeviceMissingError(
                f"{self._bus.path}: no such chip at 0x{self.address:02x} ({self.chip}); {remedy}"
            ) from error
        if found == copy and found not in self.identities:
            return f"{self.chip} (a copy)"
        if found not in self.identities:
            known = ", ".join(f"0x{value:02x}" for value in self.identities)
            driver = self._driver_of(found)
            remedy = (
                f"set imu.driver to {driver}"
                if driver
                else f"set imu.driver or imu.address, or imu.identity to 0x{found:02x} if it is a copy"
            )
            raise WrongDeviceError(
                f"{self._bus.path}: the chip at 0x{self.address:02x} says 0x{found:02x}, a {self.chip} says {known};"
                f" {remedy}"
            )
        return self.identities[found]

    def _driver_of(self, identity: int) -> str | None:
        """Return the driver of the chip with this identity at the same address and register."""
        for driver, kind in registry.chips().items():
            if not issubclass(kind, I2cImu) or self.address not in kind.addresses:
                continue
            if kind.identity_register == self.identity_register and identity in kind.identities:
                return driver
        return None

    def _start(self) -> None:
        self._reset()
        for register, value in self._settings.items():
            self._write(register, value)
        wrong = self._not_held()
        if wrong:
            registers = ", ".join(f"0x{register:02x}" for register in wrong)
            raise UnsupportedSettingError(
                f"{self.name}: does not keep what is written to {registers}; a counterfeit, or a bad supply?"
            )
        self._begin()
        self._sample_clock.restart()
        self._silence_s = 0.0
        self._next_check_ns = self._clock.monotonic_ns()

    def _not_held(self) -> Iterable[int]:
        return [register for register, value in self._settings.items() if self._read(register, 1)[0] != value]

    def _settings_hold(self) -> bool:
        """Whether the chip still has its settings; reads the temperature too."""
        self._next_check_ns = self._clock.monotonic_ns() + round(CHECK_S * 1e9)
        if self._not_held():
            return False
        self.temperature_c = self.thermometer.celsius(self._read(self.thermometer.register, self.thermometer.size))
        return True

    def _range(self, ranges: Mapping[int, Range], key: str, value: int) -> Range:
        if value not in ranges:
            offered = ", ".join(map(str, ranges))
            raise UnsupportedSettingError(f"{self.name}: has no range {value}; set {key} to one of {offered}")
        return ranges[value]
