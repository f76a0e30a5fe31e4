"""BMI160 and BMI270 as registers (BST-BMI160-DS000-07 rev. 0.8, BST-BMI270-DS000-05 rev. 1.3)."""

import math
import struct
from abc import abstractmethod
from collections import deque
from collections.abc import Mapping
from hashlib import sha256
from typing import ClassVar

from hil_mocks.i2c.chip import G_MPS2, SimulatedChip, counts
from hil_mocks.i2c.motion import Vector

SIX = struct.Struct("<hhh")
FRAME_BYTES = 12
WAKES = {0x11: (0x10, 3_800_000), 0x15: (0x04, 80_000_000)}  # CMD of a BMI160: bit of PMU_STATUS, time
INIT_NS = 20_000_000  # time in which a BMI270 loads its firmware


class Bmi(SimulatedChip):
    """Common parts: a FIFO of whole frames, here without headers; a partially read frame is repeated."""

    address = 0x68
    fifo_bytes: int
    fifo_length: int  # registers
    fifo_data: int
    fifo_config_1: int
    temperature: int
    accel_first: int
    gyro_first: int

    @abstractmethod
    def awake(self) -> bool:
        """Whether both sensors run."""

    @abstractmethod
    def force_g(self) -> float:
        """Full scale of the accelerometer."""

    def rate_hz(self) -> float:
        """Sample rate; 0 while a sensor sleeps."""
        odr = self.registers[0x42] & 15
        same = odr == self.registers[0x40] & 15
        return 100 * 2.0 ** (odr - 8) if self.awake() and same else 0.0

    def pack(self, gyro: Vector, accel: Vector) -> Mapping[int, bytes]:
        """Data and temperature registers."""
        turn_radps = math.radians(2000 >> (self.registers[0x43] & 7))
        warmth = round((self.celsius - 23) * 512)
        return {
            self.gyro_first: SIX.pack(*counts(self._leaning(gyro), turn_radps)),
            self.accel_first: SIX.pack(*counts(accel, G_MPS2 * self.force_g())),
            self.temperature: warmth.to_bytes(2, "little", signed=True),
        }

    def _leaning(self, gyro: Vector) -> Vector:
        return gyro

    def push(self, packed: Mapping[int, bytes]) -> None:
        """Gyro and accelerometer, without a header."""
        if self.registers[self.fifo_config_1] & 0xD0 != 0xC0:
            return
        self._fifo.append(packed[self.gyro_first] + packed[self.accel_first])
        if len(self._fifo) > self.fifo_bytes // FRAME_BYTES:
            self._fifo.popleft()

    def clear_fifo(self) -> None:
        """Empty it."""
        self._fifo: deque[bytes] = deque()

    def _burst(self, register: int, length: int) -> bytes:
        filled = len(self._fifo) * FRAME_BYTES
        self.registers[self.fifo_length : self.fifo_length + 2] = filled.to_bytes(2, "little")
        if register != self.fifo_data:
            return super()._burst(register, length)
        data = b"".join(self._fifo)[:length]
        for _ in range(len(data) // FRAME_BYTES):
            self._fifo.popleft()
        return data.ljust(length, b"\x80")

    def _set(self, register: int, value: int) -> None:
        if register == 0x7E:
            self._command(value)
        elif register != 0x00:
            super()._set(register, value)

    def _command(self, command: int) -> None:
        if command == 0xB6:
            self._reset()
        elif command == 0xB0:
            self.clear_fifo()


class Bmi160(Bmi):
    """BMI160; its sensors take time to wake."""

    power_on: ClassVar[Mapping[int, int]] = {
        0x00: 0xD1, 0x20: 0x00, 0x21: 0x80, 0x40: 0x28, 0x41: 0x03, 0x42: 0x28, 0x45: 0x88, 0x46: 0x80, 0x47: 0x10
    }  # fmt: skip
    fifo_bytes = 1024
    fifo_length, fifo_data, fifo_config_1, temperature = 0x22, 0x24, 0x47, 0x20
    gyro_first, accel_first = 0x0C, 0x12
    boot_ns = 1_000_000

    def power_up(self) -> None:
        """Both sensors sleep."""
        self._awake_at_ns: dict[int, int] = {}  # by bit of PMU_STATUS
        super().power_up()

    def awake(self) -> bool:
        """PMU_STATUS."""
        now_ns = self._clock.monotonic_ns()
        self.registers[0x03] = sum(bit for bit, at_ns in self._awake_at_ns.items() if at_ns <= now_ns)
        return self.registers[0x03] & 0x3C == 0x14

    def force_g(self) -> float:
        """ACC_RANGE."""
        return {3: 2.0, 5: 4.0, 8: 8.0, 12: 16.0}[self.registers[0x41] & 15]

    def _command(self, command: int) -> None:
        super()._command(command)
        if command in WAKES:
            bit, takes_ns = WAKES[command]
            self._awake_at_ns[bit] = self._clock.monotonic_ns() + takes_ns


class Bmi270(Bmi):
    """BMI270: sleeps until ``firmware`` was written to it. ``lean``: its GYR_CAS, 1/512 of z in x."""

    power_on: ClassVar[Mapping[int, int]] = {
        0x00: 0x24, 0x22: 0x00, 0x23: 0x80, 0x40: 0xA8, 0x41: 0x02, 0x42: 0xA9, 0x45: 0x88, 0x47: 0x02, 0x48: 0x02,
        0x49: 0x10, 0x7C: 0x03,
    }  # fmt: skip
    fifo_bytes = 2048
    fifo_length, fifo_data, fifo_config_1, temperature = 0x24, 0x26, 0x49, 0x22
    gyro_first, accel_first = 0x12, 0x0C
    boot_ns = 2_000_000
    firmware = b"".join(sha256(bytes([block])).digest() for block in range(256))
    lean = -20

    def power_up(self) -> None:
        """Also clears the firmware."""
        self._loaded = bytearray(8192)
        self._initialised_at_ns = 0
        super().power_up()

    def awake(self) -> bool:
        """INTERNAL_STATUS and PWR_CTRL."""
        if self._initialised_at_ns and self._clock.monotonic_ns() >= self._initialised_at_ns:
            self.registers[0x21] = 1 if self._loaded == self.firmware else 2
        return self.registers[0x21] & 15 == 1 and self.registers[0x7D] & 6 == 6

    def force_g(self) -> float:
        """ACC_RANGE."""
        return float(2 << (self.registers[0x41] & 3))

    def write(self, register: int, data: bytes) -> bytes:
        """A burst to INIT_DATA goes into the chip's memory."""
        if register != 0x5E:
            return super().write(register, data)
        place = 2 * (self.registers[0x5B] & 15 | self.registers[0x5C] << 4)
        self._loaded[place : place + len(data)] = data
        return b""

    def _leaning(self, gyro: Vector) -> Vector:
        return gyro[0] + self.lean / 512 * gyro[2], gyro[1], gyro[2]

    def _set(self, register: int, value: int) -> None:
        super()._set(register, value)
        if register == 0x59 and value & 1:
            self._initialised_at_ns = self._clock.monotonic_ns() + INIT_NS
        elif register == 0x2F:
            self.registers[0x3C] = self.lean & 0x7F if value == 0 else 0
