"""Which keys a party may use. Zenoh has no limits for them.

Zenoh compares a key with wildcards with all others that it keeps: a few thousand take half a minute and hundreds of
MiB, which come back neither when the party leaves nor when the session ends. A single one with ten ``**`` beside one of
forty levels takes GiB.
"""

from lcf_edge.gate.zenoh_batches import Key, keys

MOST_LEVELS = 20
MOST_BRANCHES = 2  # ``**`` and ``$*`` in one key
MOST_WILD = 16  # different keys with wildcards that Zenoh keeps of one name, ever
MOST_KEY_BYTES = 512
MOST_DECLARED_BYTES = 2**17  # of all keys and numbers of one connection
_DECLARATION_BYTES = 64


class RefusedKeyError(Exception):
    """``str``: why, in a few words."""


class KeyLimits:
    """Of one connection. ``wild``: the keys with wildcards of all connections of that name so far, but for ``own``."""

    def __init__(self, wild: set[bytes], own: frozenset[bytes] = frozenset()) -> None:
        self._wild, self._own = wild, own
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
        if len(whole) > MOST_KEY_BYTES or whole.count(b"/") >= MOST_LEVELS:
            raise RefusedKeyError("a key too long")
        if whole.count(b"**") + whole.count(b"$*") > MOST_BRANCHES:
            raise RefusedKeyError("a key with too many wildcards")
        if key.declared_as and key.declared_as not in self._declared:
            self._declared[key.declared_as] = whole
            self._count(whole)
        elif key.declared_as and self._declared[key.declared_as] != whole:
            raise RefusedKeyError("a number of two keys")  # Zenoh may know it as either, whatever was taken back since
        if key.is_kept and whole not in self._kept:
            self._kept.add(whole)
            self._count(whole)
        if key.is_kept and b"*" in whole and whole not in self._own and whole not in self._wild:
            if len(self._wild) >= MOST_WILD:
                raise RefusedKeyError("too many keys with wildcards")
            self._wild.add(whole)

    def _count(self, whole: bytes) -> None:
        self._declared_bytes += len(whole) + _DECLARATION_BYTES
        if self._declared_bytes > MOST_DECLARED_BYTES:
            raise RefusedKeyError("too many keys")
