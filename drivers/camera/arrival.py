"""Arriving frames of any kind of camera: sequence numbers, plausible stamps, stalls."""

from collections import Counter

from drivers.errors import DeviceStalledError

LATE_INTERVALS = 2
STALL_INTERVALS = 10
MIN_STALL_S = 1.0
_MAX_GAP = 1000  # images; a larger step means that the device's counter restarted


class Arrivals:
    """Arrivals of a stream that has just started, at ``fps``; the first image may take ``starting_s`` longer.

    ``seq``: number of the last image. ``counts``: those of the driver, to which are added ``dropped`` (counted by the
    camera but never delivered), ``late`` (older than two intervals) and ``stamped at arrival`` (the stamp was
    impossible, or of another clock).
    """

    def __init__(self, name: str, fps: float, counts: Counter[str], starting_s: float = 0.0) -> None:
        self.seq = -1
        self.counts = counts
        self._name = name
        self._interval_ns = round(1e9 / fps)
        self._stall_ns = max(STALL_INTERVALS * self._interval_ns, round(MIN_STALL_S * 1e9))
        self._waited_ns = -round(starting_s * 1e9)  # since the last usable image
        self._stamp_ns = -1
        self._sequence: int | None = None  # the device's, modulo 2^32

    def number(self, sequence: int) -> None:
        """Count the image with the device's number ``sequence``."""
        step = 1 if self._sequence is None else (sequence - self._sequence) % 2**32
        if not 0 < step <= _MAX_GAP:
            step = 1  # no counter, or it restarted
        self._sequence = sequence
        self.seq += step
        self.counts["dropped"] += step - 1

    def stamp(self, claimed_ns: int | None, queued_ns: int, now_ns: int) -> int:
        """Return the device's stamp if it is plausible, else now. ``claimed_ns`` None: it is of another clock.

        It must be after the last one, not long before the camera got the buffer at ``queued_ns``, and not in the
        future, to within an interval (some drivers predict the end of the frame).
        """
        earliest_ns = max(queued_ns - LATE_INTERVALS * self._interval_ns, self._stamp_ns + 1)
        if claimed_ns is not None and earliest_ns <= claimed_ns <= now_ns + self._interval_ns:
            return claimed_ns
        self.counts["stamped at arrival"] += 1
        return now_ns

    def is_late(self, stamp_ns: int, now_ns: int) -> bool:
        """Whether an image is older than ``LATE_INTERVALS``."""
        return now_ns - stamp_ns > LATE_INTERVALS * self._interval_ns

    def deliver(self, stamp_ns: int, now_ns: int) -> None:
        """Record that an image goes to the reader."""
        self.counts["late"] += self.is_late(stamp_ns, now_ns)
        self._stamp_ns = stamp_ns
        self._waited_ns = 0

    def wait(self, waited_ns: int) -> None:
        """Record a wait without a usable image. Raises ``DeviceStalledError`` when the total is too long."""
        self._waited_ns += waited_ns
        if self._waited_ns > self._stall_ns:
            raise DeviceStalledError(
                f"{self._name}: no usable image for {self._stall_ns / 1e9:.1f} s; check cable, power and light"
            )
