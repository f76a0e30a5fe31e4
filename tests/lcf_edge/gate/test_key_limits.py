"""Which keys of a party the gate lets through."""

import pytest

from lcf_edge.gate.key_limits import (
    MAX_BRANCHES,
    MAX_DECLARED_BYTES,
    MAX_KEY_BYTES,
    MAX_LEVELS,
    MAX_NEW_LEVELS,
    MAX_WILD,
    NEW_LEVELS_PER_S,
    KeyLimits,
    NameKeys,
    RefusedKeyError,
)
from lcf_edge.gate.zenoh_batches import NotUnderstoodError, keys

FRAME = b"\x25\x01"  # reliable, of number 1


def declared(number: int, suffix: str, scope: int = 0) -> bytes:
    """That a number stands for a key."""
    key = suffix.encode()
    return bytes([0x1E, 0x20 if key else 0, number, scope]) + (written(len(key)) + key if key else b"")


def subscribed(suffix: str, scope: int = 0) -> bytes:
    key = suffix.encode()
    return bytes([0x1E, 0x62, 1, scope]) + written(len(key)) + key


def asked(suffix: str) -> bytes:
    key = suffix.encode()
    return b"\x3c\x01\x00" + written(len(key)) + key + b"\x03"


def sent(suffix: str, payload: bytes) -> bytes:
    key = suffix.encode()
    return b"\x3d\x00" + written(len(key)) + key + b"\x01" + written(len(payload)) + payload


def written(number: int) -> bytes:
    return bytes([number]) if number < 0x80 else bytes([number & 0x7F | 0x80]) + written(number >> 7)


@pytest.fixture
def limits() -> KeyLimits:
    return KeyLimits(NameKeys())


def test_the_keys_of_a_planner_pass(limits: KeyLimits) -> None:
    for _ in range(1000):
        limits.check(FRAME + declared(1, "lcf/scene") + subscribed("", 1) + subscribed("**") + subscribed("lcf/**"))
        limits.check(FRAME + asked("lcf/query/*") + sent("lcf/speed", b"*" * 300) + b"\x04")


@pytest.mark.parametrize("say", [subscribed, asked, lambda key: sent(key, b""), lambda key: declared(1, key)])
@pytest.mark.parametrize(
    "key",
    [
        "/".join(["**", "a"] * (MAX_BRANCHES + 1)),
        "$*".join("a" * (MAX_BRANCHES + 2)),
        "/".join("a" * (MAX_LEVELS + 1)),
        "a" * (MAX_KEY_BYTES + 1),
    ],
    ids=["levels", "parts", "deep", "long"],
)
def test_a_key_that_takes_zenoh_long_is_refused_whatever_is_said_of_it(
    limits: KeyLimits, say: object, key: str
) -> None:
    assert callable(say)
    with pytest.raises(RefusedKeyError):
        limits.check(FRAME + say(key))


def test_a_key_is_judged_with_what_it_begins_with(limits: KeyLimits) -> None:
    limits.check(FRAME + declared(1, "**/a/**"))
    with pytest.raises(RefusedKeyError, match="too many wildcards"):
        limits.check(FRAME + subscribed("/b/**", 1))


def test_so_many_different_keys_with_wildcards_are_kept_of_one_name_and_no_more() -> None:
    wild = NameKeys()
    KeyLimits(wild).check(FRAME + declared(1, "**"))
    for number in range(MAX_WILD - 1):  # each of another connection
        KeyLimits(wild).check(FRAME + declared(1, "**") + subscribed(f"/{number}", 1))
    KeyLimits(wild).check(FRAME + subscribed("**/0") + asked("lcf/*") + sent("lcf/*", b""))
    with pytest.raises(RefusedKeyError, match="too many keys with wildcards"):
        KeyLimits(wild).check(FRAME + declared(1, "**") + subscribed("/one-more", 1))


def test_different_keys_of_one_name_are_few_at_first_and_fewer_later() -> None:
    now_s = 0.0
    name = NameKeys([b"lcf/scene"], lambda: now_s)
    for number in range(MAX_NEW_LEVELS // 2):  # each of another connection
        KeyLimits(name).check(FRAME + subscribed(f"a/{number}"))
    with pytest.raises(RefusedKeyError, match="too many new keys"):
        KeyLimits(name).check(FRAME + subscribed("a/b"))
    KeyLimits(name).check(FRAME + subscribed("a/0") + subscribed("lcf/scene"))  # nothing new
    now_s += 2 / NEW_LEVELS_PER_S
    KeyLimits(name).check(FRAME + subscribed("a/b"))
    with pytest.raises(RefusedKeyError, match="too many new keys"):
        KeyLimits(name).check(FRAME + subscribed("a/c"))


def test_a_number_stands_for_one_key_even_if_it_was_taken_back(limits: KeyLimits) -> None:
    taken_back = b"\x1e\x01\x01"
    limits.check(FRAME + declared(1, "lcf/**") + taken_back + declared(1, "lcf/**"))
    with pytest.raises(RefusedKeyError, match="number"):
        limits.check(FRAME + declared(1, "lcf"))


def test_what_one_connection_declares_is_bounded(limits: KeyLimits) -> None:
    most = MAX_DECLARED_BYTES // MAX_KEY_BYTES
    few = [subscribed(f"{number:0{MAX_KEY_BYTES}}") for number in range(most // 2)]
    for _ in range(9):
        limits.check(FRAME + b"".join(few))  # the same again: no more than once
    more = [subscribed(f"{number:0{MAX_KEY_BYTES}}") for number in range(most // 2, most)]
    assert sum(_passes(limits, FRAME + one) for one in more) < len(more)


def test_so_many_numbers_of_one_key_are_bounded_too(limits: KeyLimits) -> None:
    numbers = range(1, 2**16)
    said = [b"\x1e\x20" + written(number) + b"\x00\x09lcf/scene" for number in numbers]
    assert sum(_passes(limits, FRAME + one) for one in said) < 2000


def _passes(limits: KeyLimits, batch: bytes) -> bool:
    try:
        limits.check(batch)
    except RefusedKeyError:
        return False
    return True


@pytest.mark.parametrize(
    "batch",
    [
        b"\x01",  # a greeting, later than greetings come
        b"\x26\x01whole",  # part of a large message
        FRAME + b"\x1b\x01\x00",  # an answer, to a daemon that asks nothing
        FRAME + subscribed("lcf/scene")[:-1],
        FRAME + sent("lcf/speed", b"abc")[:-1],
        FRAME + b"\x3d\x00\x01a\x81\x52\x00",  # in shared memory
        FRAME + b"\x3d\x00\x01a\x81\x41\x20\x00" + bytes(0x20),  # a source that is shorter than it says
        FRAME + b"\x1e\x20\x80\x80\x04\x00\x01a",  # a number that Zenoh would cut to 0
        b"\x25" + b"\xff" * 20,
    ],
)
def test_what_is_not_understood_is_refused(batch: bytes) -> None:
    with pytest.raises(NotUnderstoodError):
        keys(batch)
