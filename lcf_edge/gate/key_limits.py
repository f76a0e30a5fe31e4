"""Which keys a party may use. Zenoh has no limits for them.

Zenoh compares a key with wildcards with all others that it keeps: a few thousand take half a minute and hundreds of
MiB, which come back neither when the party leaves nor when the session ends. A single one with ten ``**`` beside one of
forty levels takes GiB.
"""

import time
from collections.abc import Callable, Collection

from lcf_edge.gate.zenoh_batches import Key, keys

MAX_LEVELS = 20
MAX_BRANCHES = 2  # ``**`` and ``$*`` in one key
MAX_WILD = 16  # different keys with wildcards that Zenoh keeps of one name, ever
MAX_KEY_BYTES = 512
MAX_DECLARED_BYTES = 2**17  # of all keys and numbers of one connection
MAX_NEW_LEVELS = 2000  # of different keys of one name, at first
NEW_LEVELS_PER_S = 20  # later: Zenoh keeps some of each, about 1 kB, after its session has ended
MAX_KNOWN = 2048  # keys of one name
_DECLARATION_BYTES = 64


class RefusedKeyError(Exception):
    """``str``: why, in a few words."""


class NameKeys:
    """What all connections of one name have said. ``own``: keys that everybody may use, always."""

    def __init__(self, own: Collection[bytes] = (), now_s: Callable[[], float] = time.monotonic) -> None:
        self._own = frozenset(own)
        self._now_s = now_s
        self._wild: set[bytes] = set()
        self._known: dict[bytes, None] = {}  # the oldest first
        self._levels, self._since_s = float(MAX_NEW_LEVELS), now_s()

    def keep(self, whole: bytes) -> None:
        """Zenoh will keep a key. Raises ``RefusedKeyError`` if it is one too many."""
        if whole in self._own or whole in self._known:
            return
        if b"*" in whole and whole not in self._wild:
            if len(self._wild) >= MAX_WILD:
                raise RefusedKeyError("too many keys with wildcards")
            self._wild.add(whole)
        now_s = self._now_s()
        self._levels = min(self._levels + (now_s - self._since_s) * NEW_LEVELS_PER_S, MAX_NEW_LEVELS)
        self._since_s = now_s
        levels = whole.count(b"/") + 1
        if levels > self._levels:
            raise RefusedKeyError("too many new keys")
        self._levels -= levels
        if len(self._known) >= MAX_KNOWN:
            del self._known[next(iter(self._known))]
        self._known[whole] = None


class KeyLimits:
    """Of one connection, whose name has said ``of_name``."""

    def __init__(self, of_name: NameKeys) -> None:
        self._of_name = of_name
        self._declared: dict[int, bytes] = {}
        self._kept: set[bytes] = set()
        self._declared_bytes = 0

    def check(self, batch: bytes) -> int:
        """Return the number of messages in a batch.

        Raises ``RefusedKeyError`` for a key beyond the limits, ``NotUnderstoodError`` for no batch of Zenoh's.
        """
        found, messages = keys(batch)
        for key in found:
            self._check(key)
        return messages

    def _check(self, key: Key) -> None:
        whole = self._declared.get(key.scope, b"") + key.suffix
        if len(whole) > MAX_KEY_BYTES or whole.count(b"/") >= MAX_LEVELS:
            raise RefusedKeyError("a key too long")
        if whole.count(b"**") + whole.count(b"$*") > MAX_BRANCHES:
            raise RefusedKeyError("a key with too many wildcards")
        if key.declared_as and key.declared_as not in self._declared:
            self._declared[key.declared_as] = whole
            self._count(whole)
        elif key.declared_as and self._declared[key.declared_as] != whole:
            raise RefusedKeyError("a number of two keys")  # Zenoh may know it as either, whatever was taken back since
        if key.is_kept and whole not in self._kept:
            self._of_name.keep(whole)
            self._kept.add(whole)
            self._count(whole)

    def _count(self, whole: bytes) -> None:
        self._declared_bytes += len(whole) + _DECLARATION_BYTES
        if self._declared_bytes > MAX_DECLARED_BYTES:
            raise RefusedKeyError("too many keys")
