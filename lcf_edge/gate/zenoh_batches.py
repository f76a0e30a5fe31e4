"""What a party says to the daemon, read as far as needed to find the keys in it.

Zenoh's protocol (version 9, of Zenoh 1.x) comes as batches, each after its length in two bytes. A batch holds messages
of the transport; after the header of a frame follow those of the network. Numbers are of variable length, seven bits a
byte. Extensions say how long they are. What is not understood is refused: then Zenoh cannot read it otherwise either.
"""

from collections.abc import Callable
from dataclasses import dataclass

LENGTH_BYTES = 2  # before each batch, little endian
GREETINGS = 2  # batches of one message each, in which Zenoh looks for nothing else

MAX_NUMBER_BYTES = 9  # of 7 bits

_KIND = 0x1F  # of a message's first byte; the rest are flags
_Z = 0x80  # extensions follow
_NAMED = 0x20  # a key has a suffix

_INIT, _CLOSE, _KEEP_ALIVE, _FRAME = 0x01, 0x03, 0x04, 0x05
_INTEREST, _RESPONSE_FINAL, _REQUEST, _PUSH, _DECLARE, _OAM = 0x19, 0x1A, 0x1C, 0x1D, 0x1E, 0x1F
_PUT, _DELETE, _QUERY = 0x01, 0x02, 0x03
_DECLARE_KEY, _DECLARE_SUBSCRIBER, _DECLARE_QUERYABLE, _DECLARE_TOKEN, _DECLARE_FINAL = 0x00, 0x02, 0x04, 0x06, 0x1A
_UNDECLARED = {0x01, 0x03, 0x05, 0x07}

_NUMBER, _BYTES, _LENGTHS = 0x20, 0x40, 0x60  # what an extension holds
_SOURCE, _TIMESTAMP = 0x41, 0x42  # extensions that Zenoh reads by their contents, not by their length
_MANDATORY = 0x10


class NotUnderstoodError(Exception):
    """Something else than a party of Zenoh 1.x has to say."""


@dataclass(frozen=True, slots=True)
class Key:
    """A key in a message. ``scope``: the number of a declared key that it begins with, 0: none."""

    scope: int
    suffix: bytes
    declared_as: int = 0  # the number that it gets
    is_kept: bool = True  # Zenoh keeps it, and compares it with all others


def is_greeting(batch: bytes) -> bool:
    """Whether a batch, with its length, may be the first that is said."""
    return len(batch) > LENGTH_BYTES and batch[LENGTH_BYTES] & _KIND == _INIT


def keys(batch: bytes) -> tuple[list[Key], int]:
    """Return the keys in a batch, in their order, and the number of its messages. Raises ``NotUnderstoodError``."""
    reading = _Reading(batch)
    messages = 0
    try:
        while reading.left:
            reading.transport_message()
            messages += 1
    except IndexError as error:
        raise NotUnderstoodError from error
    return reading.keys, messages


class _Reading:
    """Of one batch. Raises ``IndexError`` at its end."""

    def __init__(self, batch: bytes) -> None:
        self._batch, self._at = batch, 0
        self._in_frame = False
        self.keys: list[Key] = []

    @property
    def left(self) -> int:
        return len(self._batch) - self._at

    def _byte(self) -> int:
        self._at += 1
        return self._batch[self._at - 1]

    def _number(self, most: int = 2**63 - 1) -> int:
        value = 0
        for shift in range(0, 7 * MAX_NUMBER_BYTES, 7):
            byte = self._byte()
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                break
        else:
            raise NotUnderstoodError
        if value > most:
            raise NotUnderstoodError
        return value

    def _bytes(self) -> bytes:
        return self._take(self._number())

    def _take(self, length: int) -> bytes:
        if length > self.left:
            raise IndexError
        self._at += length
        return self._batch[self._at - length : self._at]

    def transport_message(self) -> None:
        """Or, in a frame, one of the network."""
        head = self._byte()
        kind = head & _KIND
        if self._in_frame and kind in _OF_THE_NETWORK:
            _OF_THE_NETWORK[kind](self, head)
            return
        if kind == _CLOSE:
            self._byte()
        elif kind == _FRAME:
            self._number()
            self._in_frame = True
        elif kind != _KEEP_ALIVE:  # also fragments: of messages larger than the daemon takes
            raise NotUnderstoodError
        self._extensions(head)

    def _extensions(self, head: int) -> None:
        more = head & _Z
        while more:
            extension = self._byte()
            more = extension & _Z
            holds = extension & _LENGTHS
            if holds == _NUMBER:
                self._long_number()
            elif holds == _BYTES:
                end = self._number() + self._at
                if extension & ~_Z & ~_MANDATORY in {_SOURCE, _TIMESTAMP}:
                    self._contents(extension & ~_Z & ~_MANDATORY)
                    if self._at != end:
                        raise NotUnderstoodError
                self._take(end - self._at)
            elif holds or extension & _MANDATORY:  # unknown, or shared memory
                raise NotUnderstoodError

    def _long_number(self) -> None:
        """Of up to ten bytes: 64 bits."""
        for _ in range(MAX_NUMBER_BYTES + 1):
            if self._byte() < 0x80:
                return
        raise NotUnderstoodError

    def _contents(self, extension: int) -> None:
        if extension == _TIMESTAMP:
            self._timestamp()
        else:
            self._take((self._byte() >> 4) + 1)
            self._number()
            self._number()

    def _timestamp(self) -> None:
        self._long_number()
        self._bytes()

    def _key(self, is_named: int, declared_as: int = 0, *, is_kept: bool = True) -> None:
        scope = self._number(0xFFFF)
        self.keys.append(Key(scope, self._bytes() if is_named else b"", declared_as, is_kept))

    def _push(self, head: int) -> None:
        self._key(head & _NAMED, is_kept=False)
        self._extensions(head)
        body = self._byte()
        if body & _KIND not in {_PUT, _DELETE}:
            raise NotUnderstoodError
        if body & 0x20:
            self._timestamp()
        if body & _KIND == _PUT and body & 0x40 and self._number() & 1:  # the encoding, with a schema
            self._bytes()
        self._extensions(body)
        if body & _KIND == _PUT:
            self._bytes()

    def _request(self, head: int) -> None:
        self._number()
        self._key(head & _NAMED, is_kept=False)
        self._extensions(head)
        body = self._byte()
        if body & _KIND != _QUERY:
            raise NotUnderstoodError
        if body & 0x20:  # consolidation
            self._number()
        if body & 0x40:  # parameters
            self._bytes()
        self._extensions(body)

    def _response_final(self, head: int) -> None:
        self._number()
        self._extensions(head)

    def _oam(self, head: int) -> None:
        self._number()
        self._extensions(head)
        if head & _LENGTHS == _NUMBER:
            self._long_number()
        elif head & _LENGTHS == _BYTES:
            self._bytes()
        elif head & _LENGTHS:
            raise NotUnderstoodError

    def _interest(self, head: int) -> None:
        self._number()
        if head & 0x60:  # not its end
            options = self._byte()
            if options & 0x10:  # of one key
                self._key(options & 0x20)
        self._extensions(head)

    def _declare(self, head: int) -> None:
        if head & 0x20:  # in answer to an interest
            self._number()
        self._extensions(head)
        body = self._byte()
        kind = body & _KIND
        if kind == _DECLARE_KEY:
            number = self._number(0xFFFF)
            self._key(body & _NAMED, declared_as=number)
        elif kind in {_DECLARE_SUBSCRIBER, _DECLARE_QUERYABLE, _DECLARE_TOKEN}:
            self._number()
            self._key(body & _NAMED)
        elif kind in _UNDECLARED:
            self._number()
        elif kind != _DECLARE_FINAL:
            raise NotUnderstoodError
        self._extensions(body)


_OF_THE_NETWORK: dict[int, Callable[[_Reading, int], None]] = {
    _PUSH: _Reading._push,
    _REQUEST: _Reading._request,
    _RESPONSE_FINAL: _Reading._response_final,
    _OAM: _Reading._oam,
    _INTEREST: _Reading._interest,
    _DECLARE: _Reading._declare,
}
