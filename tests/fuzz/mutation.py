"""New inputs from good ones."""

import random
import struct
from collections.abc import Callable, Sequence

MAX_BYTES = 2**16
CORPUS_BYTES = 2**22

_NUMBERS = (0, 1, 2, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 2**24, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**64 - 1)
_FLOATS = (0.0, -0.0, 1e-320, 1e-45, 1e38, 1e300, float("inf"), float("-inf"), float("nan"))
_SIGNALLING = (bytes.fromhex("0100807f"), bytes.fromhex("010000000000f07f"))


class Mutator:
    """Draws inputs; ``tokens`` are parts that the format knows, and that chance would not find."""

    def __init__(self, corpus: Sequence[bytes], tokens: Sequence[bytes], seed: int) -> None:
        self._corpus = list(corpus)
        self._bytes = sum(map(len, corpus))
        self._tokens = tokens
        self._random = random.Random(seed)

    @property
    def size(self) -> int:
        """Inputs that others are made of."""
        return len(self._corpus)

    def keep(self, data: bytes) -> None:
        """Make others of this one too, while there is room."""
        if self._bytes + len(data) <= CORPUS_BYTES:
            self._corpus.append(data)
            self._bytes += len(data)

    def draw(self) -> bytes:
        """The next input."""
        data = bytearray(self._random.choice(self._corpus))
        for _ in range(self._random.choice((1, 1, 2, 3, 5, 10))):
            self._random.choice(_CHANGES)(self, data)
        return bytes(data[:MAX_BYTES])

    def _place(self, data: bytearray) -> int:
        return self._random.randint(0, len(data))

    def _span(self, data: bytearray) -> tuple[int, int]:
        begin = self._place(data)
        return begin, min(begin + self._random.choice((1, 2, 4, 8, 16, 64, 1000)), len(data))

    def _flip(self, data: bytearray) -> None:
        if data:
            data[self._random.randrange(len(data))] ^= 1 << self._random.randrange(8)

    def _number(self, data: bytearray) -> None:
        begin = self._place(data)
        order, kind = self._random.choice("<>"), self._random.choice("BHIQfd")
        if kind in "fd":
            number: float = self._random.choice(_FLOATS)
            if kind == "f" and abs(number) > 3e38:
                number = float("inf")
        else:
            number = self._random.choice(_NUMBERS) & (2 ** (8 * struct.calcsize(kind)) - 1)
        written = struct.pack(order + kind, number)
        data[begin : begin + len(written)] = written

    def _signalling(self, data: bytearray) -> None:
        begin, written = self._place(data) & ~3, self._random.choice(_SIGNALLING)
        data[begin : begin + len(written)] = written

    def _remove(self, data: bytearray) -> None:
        begin, end = self._span(data)
        del data[begin:end]

    def _repeat(self, data: bytearray) -> None:
        begin, end = self._span(data)
        data[begin:begin] = data[begin:end] * self._random.choice((1, 1, 2, 10, 1000))

    def _token(self, data: bytearray) -> None:
        begin = self._place(data)
        end = begin if self._random.random() < 0.5 else self._span(data)[1]
        data[begin:end] = self._random.choice(self._tokens or (b"\0",))

    def _digits(self, data: bytearray) -> None:
        begin, end = self._span(data)
        data[begin:end] = self._random.choice(
            (b"9" * 400, b"-1", b"0", b"1e308", b"1e-320", b"nan", b"-inf", b"9" * 19)
        )

    def _splice(self, data: bytearray) -> None:
        other = self._random.choice(self._corpus)
        begin = self._place(data)
        data[begin:] = other[self._random.randint(0, len(other)) :]

    def _cut(self, data: bytearray) -> None:
        del data[self._place(data) :]


_CHANGES: Sequence[Callable[[Mutator, bytearray], None]] = (
    Mutator._flip,
    Mutator._flip,
    Mutator._number,
    Mutator._number,
    Mutator._signalling,
    Mutator._remove,
    Mutator._repeat,
    Mutator._token,
    Mutator._digits,
    Mutator._splice,
    Mutator._cut,
)
