"""BMI088 as registers (BST-BMI088-DS001 rev. 1.9): two chips in one housing."""

import math
import struct
from collections import deque
from collections.abc import Mapping
from typing import ClassVar

from drivers.clock import Clock
from hil_mocks.i2c.chip import G_MPS2, SimulatedChip, counts
from hil_mocks.i2c.motion import Motion, Vector

SIX = struct.Struct("<hhh")
GYRO_HZ = (2000.0, 2000.0, 1000.0, 400.0, 200.0, 100.0, 200.0, 100.0)  # by the bandwidth's code
ACCEL_RATE_ERROR = 0.011  # its clock is not the gyro's
FRAME_BYTES = 7
SETTINGS_CHANGED = b"\x48\x01"  # a frame that the chip inserts by itself


class Accelerometer(SimulatedChip):
    """The BMI088's accelerometer: suspended at power-on; then only its power registers can be written."""

    address = 0x18
    power_on: ClassVar[Mapping[int, int]] = {0x00: 0x1E, 0x40: 0xA8, 0x41: 0x01, 0x48: 0x02, 0x49: 0x10, 0x7C: 0x03}
    boot_ns = 1_000_000

    def rate_hz(self) -> float:
        """Sample rate; 0 asleep."""
        awake = self.registers[0x7C] == 0 and self.registers[0x7D] == 4
        return 12.5 * 2.0 ** ((self.registers[0x40] & 15) - 5) if awake else 0.0

    def pack(self, gyro: Vector, accel: Vector) -> Mapping[int, bytes]:  # noqa: ARG002
        """ACC_X_LSB on, TEMP_MSB and TEMP_LSB."""
        force_mps2 = G_MPS2 * (3 << (self.registers[0x41] & 3))
        eighths = round((self.celsius - 23) * 8)
        return {
            0x12: SIX.pack(*counts(accel, force_mps2)),
            0x22: (eighths << 5).to_bytes(2, "big", signed=True),
        }

    def push(self, packed: Mapping[int, bytes]) -> None:
        """A frame with a header; the oldest makes room."""
        if self.registers[0x49] & 0x40:
            self._fifo.append(b"\x84" + packed[0x12])

    def clear_fifo(self) -> None:
        """Empty it."""
        self._fifo: deque[bytes] = deque(maxlen=1024 // FRAME_BYTES)

    def _burst(self, register: int, length: int) -> bytes:
        self.registers[0x24:0x26] = sum(map(len, self._fifo)).to_bytes(2, "little")
        if register != 0x26:
            return super()._burst(register, length)
        data = b"".join(self._fifo)[:length]
        left = len(data)
        while self._fifo and len(self._fifo[0]) <= left:  # a frame that was cut short stays
            left -= len(self._fifo.popleft())
        return data.ljust(length, b"\x80")

    def _set(self, register: int, value: int) -> None:
        if register == 0x7E:
            if value == 0xB6:
                self._reset()
            elif value == 0xB0:
                self.clear_fifo()
                self._fifo.append(SETTINGS_CHANGED)
        elif register >= 0x7C or self.registers[0x7C] == 0:
            super()._set(register, value)


class Bmi088(SimulatedChip):
    """The BMI088's gyro, with its accelerometer beside it."""

    address = 0x68
    power_on: ClassVar[Mapping[int, int]] = {0x00: 0x0F, 0x10: 0x80}
    boot_ns = 30_000_000

    def __init__(self, motion: Motion, clock: Clock, rate_error: float = 0.0, celsius: float = 31.5) -> None:
        self.accelerometer = Accelerometer(motion, clock, rate_error + ACCEL_RATE_ERROR, celsius)
        super().__init__(motion, clock, rate_error, celsius)

    @property
    def places(self) -> Mapping[int, SimulatedChip]:
        """Both, by address."""
        return {self.address: self, Accelerometer.address: self.accelerometer}

    def rate_hz(self) -> float:
        """Sample rate; it wakes by itself."""
        return GYRO_HZ[self.registers[0x10] & 7]

    def pack(self, gyro: Vector, accel: Vector) -> Mapping[int, bytes]:  # noqa: ARG002
        """RATE_X_LSB on."""
        turn_radps = math.radians(2000 >> (self.registers[0x0F] & 7))
        self.accelerometer.celsius = self.celsius
        return {0x02: SIX.pack(*counts(gyro, turn_radps))}

    def push(self, packed: Mapping[int, bytes]) -> None:
        """A frame without header, in the mode STREAM; the oldest makes room."""
        if self.registers[0x3E] & 0xC0 == 0x80:
            self._overrun |= len(self._fifo) == self._fifo.maxlen
            self._fifo.append(packed[0x02])

    def clear_fifo(self) -> None:
        """Empty it."""
        self._fifo: deque[bytes] = deque(maxlen=100)
        self._overrun = False

    def _burst(self, register: int, length: int) -> bytes:
        self.registers[0x0E] = self._overrun << 7 | len(self._fifo)
        if register != 0x3F:
            return super()._burst(register, length)
        frames = [self._fifo.popleft() for _ in range(min(length // 6, len(self._fifo)))]
        return b"".join(frames).ljust(length, b"\0")

    def _set(self, register: int, value: int) -> None:
        if register == 0x14:
            if value == 0xB6:
                self._reset()
        elif register != 0x00:
            super()._set(register, value | 0x80 if register == 0x10 else value)
            if register == 0x3E:
                self.clear_fifo()
