"""A device that is kept open: opened again whenever it fails, with pauses, and what it counted is kept."""

from collections import Counter
from collections.abc import Sequence

import pytest

from drivers.device import FIRST_PAUSE_S, MAX_HOPELESS_PAUSE_S, MAX_PAUSE_S, SETTLING_TRIES, Device, KeptOpen
from drivers.errors import DeviceForbiddenError, DeviceLostError, DeviceMissingError, DriverError
from hil_mocks.virtual_clock import VirtualClock

Answer = Sequence[int] | Exception


class Scripted:
    """A device whose every reading is written down beforehand."""

    def __init__(self, answers: list[Answer]) -> None:
        self.name = "scripted"
        self.counts: Counter[str] = Counter()
        self.closed = 0
        self._answers = answers

    def read(self) -> Sequence[int]:
        answer = self._answers.pop(0)
        self.counts["read"] += 1
        if isinstance(answer, Exception):
            raise answer
        return answer

    def close(self) -> None:
        self.closed += 1


LOST, MISSING, FORBIDDEN = (kind("scripted: …") for kind in (DeviceLostError, DeviceMissingError, DeviceForbiddenError))


class Port:
    """Where devices are plugged in: each opening takes what comes next."""

    def __init__(self, *openings: Scripted | DriverError) -> None:
        self.attempts = 0
        self._openings = list(openings)

    def open(self) -> Device[int]:
        self.attempts += 1
        opening = self._openings[0] if len(self._openings) == 1 else self._openings.pop(0)
        if isinstance(opening, DriverError):
            raise opening
        return opening


def kept(port: Port, clock: VirtualClock) -> KeptOpen[int]:
    return KeptOpen("device", port.open, clock)


def test_it_opens_at_the_first_reading_and_stays_open() -> None:
    port, clock = Port(Scripted([[1], [], [2, 3]])), VirtualClock()
    device = kept(port, clock)
    assert port.attempts == 0
    assert [device.read() for _ in range(3)] == [[1], [], [2, 3]]
    assert port.attempts == 1
    assert device.error is None
    assert device.counts == {"opened": 1, "read": 3}


def test_what_fails_is_closed_and_opened_again() -> None:
    first, second = Scripted([[1], LOST]), Scripted([[2]])
    device = kept(Port(first, second), VirtualClock())
    assert [device.read(), device.read()] == [[1], []]
    assert device.error is LOST
    assert first.closed == 1
    assert device.read() == [2]
    assert device.error is None


def test_what_all_openings_counted_is_added_up() -> None:
    device = kept(Port(Scripted([[1], LOST]), MISSING, Scripted([[2], [3]])), VirtualClock())
    for _ in range(5):
        device.read()
    assert device.counts == {"read": 4, "opened": 2, "failed": 2}
    device.close()
    assert device.counts == {"read": 4, "opened": 2, "failed": 2}


def pauses_s(error: DriverError, attempts: int) -> list[float]:
    clock = VirtualClock()
    device = kept(Port(error), clock)
    pauses = []
    for _ in range(attempts):
        began_ns = clock.monotonic_ns()
        assert device.read() == []
        pauses.append((clock.monotonic_ns() - began_ns) / 1e9)
    return pauses


@pytest.mark.parametrize(
    ("error", "longest_s"), [(MISSING, MAX_PAUSE_S), (FORBIDDEN, MAX_HOPELESS_PAUSE_S)], ids=["hope", "none"]
)
def test_pauses_grow_to_a_limit(error: DriverError, longest_s: float) -> None:
    pauses = pauses_s(error, 12)
    assert pauses[0] == pytest.approx(FIRST_PAUSE_S)
    assert pauses == sorted(pauses)
    assert pauses[-1] == pytest.approx(longest_s)


def test_a_device_that_is_back_may_be_forbidden_until_udev_has_seen_to_it() -> None:
    port, clock = Port(Scripted([[1], LOST]), *[MISSING] * 8, FORBIDDEN, FORBIDDEN, Scripted([[2]])), VirtualClock()
    device = kept(port, clock)
    for _ in range(10):
        device.read()
    assert device.error is MISSING
    begun_ns = clock.monotonic_ns()
    for _ in range(2):
        assert device.read() == []
        assert device.error is MISSING  # and nobody is told to join a group
    assert device.read() == [2]
    assert clock.monotonic_ns() - begun_ns == round(2e9 * MAX_PAUSE_S)


def test_one_that_stays_forbidden_is() -> None:
    port, clock = Port(Scripted([[1], LOST]), FORBIDDEN), VirtualClock()
    device = kept(port, clock)
    for _ in range(2 + SETTLING_TRIES):
        device.read()
    assert device.error is LOST
    device.read()
    assert device.error is FORBIDDEN


def test_one_that_is_forbidden_from_the_start_is_at_once() -> None:
    device = kept(Port(FORBIDDEN), VirtualClock())
    device.read()
    assert device.error is FORBIDDEN


def test_a_record_makes_the_pauses_short_again() -> None:
    clock = VirtualClock()
    device = kept(Port(*[MISSING] * 8, Scripted([[1], LOST]), MISSING), clock)
    for _ in range(9):
        device.read()
    began_ns = clock.monotonic_ns()
    device.read()
    assert clock.monotonic_ns() - began_ns == pytest.approx(FIRST_PAUSE_S * 1e9)


def test_a_device_that_opens_but_never_delivers_is_not_hammered() -> None:
    clock = VirtualClock()
    port = Port(*[Scripted([LOST]) for _ in range(100)])
    device = kept(port, clock)
    while clock.monotonic_ns() < VirtualClock().monotonic_ns() + 60e9:
        device.read()
    assert port.attempts < 70


def test_closing_twice_is_once() -> None:
    scripted = Scripted([[1]])
    device = kept(Port(scripted), VirtualClock())
    device.close()
    device.read()
    device.close()
    device.close()
    assert scripted.closed == 1


def test_other_errors_are_not_swallowed() -> None:
    device = kept(Port(Scripted([ValueError("a mistake in the program")])), VirtualClock())
    with pytest.raises(ValueError, match="mistake"):
        device.read()
