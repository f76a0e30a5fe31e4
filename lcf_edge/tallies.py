"""What a gate counts, in memory that it shares with the daemon behind it.

A Unix socket does not say how much it has received, and to Zenoh all connections of a gate look alike. So each comes
from an address with a number, under which the gate counts what it has brought.
"""

import mmap
import os
import secrets

PLACES = 128
_ALL = 1 + PLACES  # the first is of those who were refused
_NUMBER_BYTES = 8


class Tallies:
    """``descriptor``: of the daemon's, for the gate; None: new ones."""

    def __init__(self, descriptor: int | None = None) -> None:
        self.descriptor = os.memfd_create("lcf-edge tallies") if descriptor is None else descriptor
        if descriptor is None:
            os.truncate(self.descriptor, _ALL * _NUMBER_BYTES)
        self._map = mmap.mmap(self.descriptor, _ALL * _NUMBER_BYTES)
        self._numbers = memoryview(self._map).cast("Q")
        self._free = list(range(1, _ALL))
        self._secret = secrets.token_hex(8)
        self._taken = 0

    @property
    def refused(self) -> int:
        """Connections that were not let in, or cut."""
        return self._numbers[0]

    def refuse(self) -> None:
        """Count one."""
        self._numbers[0] += 1

    def take(self) -> "Place":
        """Return a place that nobody has. Raises ``OSError`` when there is none."""
        if not self._free:
            raise OSError("no place is free")
        number = self._free.pop(0)
        self._numbers[number] = 0
        self._taken += 1
        return Place(self, number, f"\0lcf-edge/{self._secret}/{self._taken}/{number}")

    def received(self, address: str | bytes) -> int | None:
        """Return how many bytes came from an address; None: it is none of a gate's."""
        name = address if isinstance(address, bytes) else address.encode(errors="replace")
        number = name.rpartition(b"/")[2]
        if not name.startswith(b"\0lcf-edge/") or not number.isdigit() or not 0 < int(number) < _ALL:
            return None
        return self._numbers[int(number)]

    def add(self, number: int, count: int) -> None:
        """Count bytes of a place."""
        self._numbers[number] += count

    def leave(self, number: int) -> None:
        """Free a place."""
        self._free.append(number)

    def close(self) -> None:
        """Close the descriptor; the numbers stay."""
        os.close(self.descriptor)


class Place:
    """Of one connection. ``address``: where it comes from, in the abstract namespace of Unix sockets."""

    def __init__(self, tallies: Tallies, number: int, address: str) -> None:
        self.address = address
        self._tallies, self._number = tallies, number

    def add(self, count: int) -> None:
        """Count what it has brought."""
        self._tallies.add(self._number, count)

    def leave(self) -> None:
        """Once."""
        self._tallies.leave(self._number)
