"""The interface of every driver, and how a device is kept open while a vehicle runs."""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Generic, Protocol, TypeVar

from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.errors import DeviceForbiddenError, DriverError

Record = TypeVar("Record")
Delivered_co = TypeVar("Delivered_co", covariant=True)

FIRST_PAUSE_S = 0.1
MAX_PAUSE_S = 1.0  # so that a device, with the time to open it, is in use within 2 s of coming back
MAX_HOPELESS_PAUSE_S = 10.0  # after errors that only the user can fix
SETTLING_TRIES = 4  # of a device that is back: it is nobody's until udev has given it to its group
EXCESS = ("excess_bytes", "excess_samples")  # counts of what exceeded the rate of any real device


class Device(Protocol[Delivered_co]):
    """An open camera (which delivers ``Frame``) or IMU (``ImuSample``).

    ``name``: as the user calls it. ``counts``: what was lost, late or refused, by reason; only grows.
    """

    name: str
    counts: Counter[str]

    def read(self) -> Sequence[Delivered_co]:
        """Wait for new records and return them, oldest first; the wait is bounded by the device's rate.

        Return nothing if all were refused and counted. Raises ``DriverError`` when the device must be reopened.
        """
        ...

    def close(self) -> None:
        """Close the device; never raises, may be called twice."""
        ...


class KeptOpen(Generic[Record]):
    """A device that is reopened whenever it fails, with pauses that grow to ``MAX_PAUSE_S``.

    ``error``: why it is not open, None while it is. ``counts``: the device's own, over all its openings, and
    ``opened``, ``failed``.
    """

    def __init__(self, name: str, open_device: Callable[[], Device[Record]], clock: Clock = SYSTEM_CLOCK) -> None:
        self.name = name
        self.error: DriverError | None = None
        self._open = open_device
        self._clock = clock
        self._device: Device[Record] | None = None
        self._past: Counter[str] = Counter()
        self._pause_s = FIRST_PAUSE_S
        self._forbidden = 0  # tries in succession

    @property
    def counts(self) -> Counter[str]:
        """Counts so far."""
        return self._past if self._device is None else self._past + self._device.counts

    def read(self) -> Sequence[Record]:
        """Return new records; none, after a pause, while the device is absent. Never raises ``DriverError``."""
        try:
            if self._device is None:
                self._device = self._open()
                self._past["opened"] += 1
                self.error = None
            records = self._device.read()
        except DriverError as error:
            self._fail(error)
            return []
        if records:
            self._pause_s = FIRST_PAUSE_S
        return records

    def _fail(self, error: DriverError) -> None:
        self._past["failed"] += 1
        self.close()
        self._forbidden = self._forbidden + 1 if isinstance(error, DeviceForbiddenError) else 0
        settling = self.error is not None and 0 < self._forbidden <= SETTLING_TRIES
        if not settling:
            self.error = error
        self._clock.sleep_s(self._pause_s)
        longest_s = MAX_PAUSE_S if error.retry or settling else MAX_HOPELESS_PAUSE_S
        self._pause_s = min(2 * self._pause_s, longest_s)

    def close(self) -> None:
        """Close the device."""
        if self._device is not None:
            self._device.close()
            self._past += self._device.counts
            self._device = None
