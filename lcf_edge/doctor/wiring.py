"""Which IMU answers: chips on an I2C bus by their identity, protocols at a serial port by their frames. Only reads."""

from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import dataclass

from drivers.clock import Clock
from drivers.errors import DriverError
from drivers.imu import registry
from drivers.imu.i2c_bus import I2cBus
from drivers.imu.serial_port import SerialPort

LISTENED_S = 0.6
MIN_READINGS = 3  # fewer can be chance, or end with a slow one


@dataclass(frozen=True, slots=True)
class Chip:
    """A chip that was recognised."""

    driver: str
    model: str
    address: int

    def __str__(self) -> str:
        return f"{self.model} at 0x{self.address:02x}"

    @property
    def settings(self) -> tuple[str, str]:
        """Return the settings that configure it."""
        return f"imu.driver={self.driver}", f"imu.address=0x{self.address:02x}"


def chips(bus: I2cBus) -> Iterator[Chip]:
    """Return the chips recognised at the addresses of IMUs."""
    kinds = registry.chips()
    for address in bus.scan(_addresses()):
        for driver, kind in kinds.items():
            if address in kind.addresses:
                with suppress(DriverError):
                    model = kind.recognised(bus, address)
                    if model is not None:
                        yield Chip(driver, model, address)
                        break


def strangers(bus: I2cBus) -> list[int]:
    """Return addresses of IMUs with a device that no driver recognises and that no kernel driver owns."""
    known = {chip.address for chip in chips(bus)}
    found = []
    for address in bus.scan(_addresses()):
        if address not in known:
            with suppress(DriverError):
                bus.read(address, 0, 1, tries=2)
                found.append(address)
    return found


def _addresses() -> list[int]:
    """Return all addresses that IMUs can have."""
    return sorted({address for kind in registry.chips().values() for address in kind.addresses})


@dataclass(frozen=True, slots=True)
class Spoken:
    """A protocol that was understood at a baud rate."""

    driver: str
    baud: int
    readings: int

    @property
    def settings(self) -> tuple[str, str]:
        """Return the settings that configure it."""
        return f"imu.driver={self.driver}", f"imu.baud={self.baud}"


def spoken(port: str, clock: Clock) -> Spoken | None:
    """Return the protocol found at a port, trying all baud rates in use; None: no known one."""
    bauds = dict.fromkeys(baud for protocol in registry.protocols().values() for baud in protocol.bauds)
    understood = [found for baud in bauds for found in _understood(_heard(port, baud, clock), baud)]
    best = max(understood, key=lambda found: found.readings, default=None)
    return best if best is not None and best.readings >= MIN_READINGS else None


def _understood(data: bytes, baud: int) -> Iterator[Spoken]:
    for name, protocol in registry.protocols().items():
        yield Spoken(name, baud, len(protocol.parser().feed(data)))


def _heard(port: str, baud: int, clock: Clock) -> bytes:
    """Return the bytes that come within ``LISTENED_S``; empty if the port does not have that rate."""
    heard = bytearray()
    with suppress(DriverError), closing(SerialPort(port, baud)) as line:
        end_ns = clock.monotonic_ns() + round(LISTENED_S * 1e9)
        while clock.monotonic_ns() < end_ns:
            heard += line.read()
    return bytes(heard)
