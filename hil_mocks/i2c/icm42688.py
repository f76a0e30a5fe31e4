"""ICM-42688-P as registers (DS-000347 rev. 1.6), its bank 0."""

import math
import struct
from collections import deque
from collections.abc import Mapping

from hil_mocks.i2c.chip import G_MPS2, SimulatedChip, counts
from hil_mocks.i2c.motion import Vector

SIX = struct.Struct(">hhh")
PACKET_BYTES = 16
PACKETS = 2048 // PACKET_BYTES
POWER_ON = {0x13: 0x05, 0x4C: 0x30, 0x4D: 0x91, 0x4F: 0x06, 0x50: 0x06, 0x52: 0x11, 0x5F: 0x00, 0x75: 0x47}
ODR_HZ = {6: 1000.0, 7: 200.0, 8: 100.0, 9: 50.0, 10: 25.0, 11: 12.5, 15: 500.0}
START_UP_NS = 45_000_000  # of the gyro, in which its words say that there are no data
AFSR_RADPS = math.radians(100)
AFSR_S = 0.002  # for which the gyro repeats itself when it changes its range


class Icm42688(SimulatedChip):
    """ICM-42688-P. The FIFO's count reads 0 once after it was flushed; AFSR makes the gyro stall if not forbidden."""

    address = 0x68
    power_on = POWER_ON
    boot_ns = 1_000_000
    _gyro_from_ns = 0
    _fast = False  # the range that AFSR has chosen
    _stalls = 0  # samples that repeat the one before
    _gyro: Vector = (0.0, 0.0, 0.0)

    def read(self, register: int, length: int) -> bytes:
        """A burst; in another bank than 0, nothing but zeros."""
        return bytes(length) if self.registers[0x76] and register != 0x76 else super().read(register, length)

    def write(self, register: int, data: bytes) -> bytes:
        """A burst; not to another bank than 0."""
        return b"" if self.registers[0x76] and register != 0x76 else super().write(register, data)

    def rate_hz(self) -> float:
        """Sample rate; 0 switched off."""
        odr = self.registers[0x4F] & 15
        on = self.registers[0x4E] & 15 == 15 and odr == self.registers[0x50] & 15
        return ODR_HZ.get(odr, 0.0) if on else 0.0

    def pack(self, gyro: Vector, accel: Vector) -> Mapping[int, bytes]:
        """TEMP_DATA1 to GYRO_DATA_Z0."""
        turn_radps = math.radians(2000 / 2 ** (self.registers[0x4F] >> 5))
        force_mps2 = G_MPS2 * 16 / 2 ** (self.registers[0x50] >> 5)
        self._adapt(max(map(abs, gyro)) > AFSR_RADPS)
        if not self._stalls:
            self._gyro = gyro
        warmth = round((self.celsius - 25) * 132.48)
        return {
            0x1D: warmth.to_bytes(2, "big", signed=True),
            0x1F: SIX.pack(*counts(accel, force_mps2)),
            0x25: SIX.pack(*counts(self._gyro, turn_radps)),
        }

    def _adapt(self, fast: bool) -> None:
        """AFSR, as long as INTF_CONFIG1 does not forbid it."""
        changes = fast != self._fast and self.registers[0x4D] & 0xC0 != 0x40
        self._fast = fast
        self._stalls = round(AFSR_S * self.rate_hz()) if changes else max(self._stalls - 1, 0)

    def push(self, packed: Mapping[int, bytes]) -> None:
        """A packet with header, temperature and time, when FIFO_CONFIG1 asks for all; the oldest makes room."""
        if self.registers[0x16] & 0xC0 != 0x40 or self.registers[0x5F] & 0x07 != 0x07:
            return
        ready = self._clock.monotonic_ns() >= self._gyro_from_ns
        gyro = packed[0x25] if ready else b"\x80\0" * 3
        self._fifo.append(b"\x68" + packed[0x1F] + gyro + b"\0" + bytes(2))

    def clear_fifo(self) -> None:
        """Empty it."""
        self._fifo: deque[bytes] = deque(maxlen=PACKETS)
        self._count_reads_0 = True

    def _burst(self, register: int, length: int) -> bytes:
        if register == 0x2E:
            level = 0 if self._count_reads_0 else len(self._fifo) * PACKET_BYTES
            self._count_reads_0 = False
            self.registers[0x2E:0x30] = level.to_bytes(2, "big")
        if register != 0x30:
            return super()._burst(register, length)
        packets = [self._fifo.popleft() for _ in range(min(length // PACKET_BYTES, len(self._fifo)))]
        return b"".join(packets).ljust(length, b"\xff")

    def _set(self, register: int, value: int) -> None:
        if register == 0x11 and value & 0x01:
            self._reset()
        elif register == 0x4B:
            if value & 0x02:
                self.clear_fifo()
        elif register != 0x75:
            if register == 0x4E and value & ~self.registers[0x4E] & 0x0C:
                self._gyro_from_ns = self._clock.monotonic_ns() + START_UP_NS
            super()._set(register, value)
