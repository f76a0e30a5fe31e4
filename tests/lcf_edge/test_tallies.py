"""What a gate has counted is what the daemon reads."""

import os
from collections.abc import Iterator

import pytest

from lcf_edge.tallies import PLACES, Tallies


@pytest.fixture
def both() -> Iterator[tuple[Tallies, Tallies]]:
    """Of the daemon, and of its gate."""
    daemon = Tallies()
    gate = Tallies(os.dup(daemon.descriptor))
    yield daemon, gate
    gate.close()
    daemon.close()


def test_bytes_are_counted_for_the_address_that_they_come_from(both: tuple[Tallies, Tallies]) -> None:
    daemon, gate = both
    first, second = gate.take(), gate.take()
    first.add(5)
    second.add(7)
    first.add(1)
    gate.refuse()
    assert [daemon.received(one.address.encode()) for one in (first, second)] == [6, 7]
    assert daemon.refused == 1


def test_a_place_that_is_taken_again_has_another_address_and_begins_at_nothing(both: tuple[Tallies, Tallies]) -> None:
    daemon, gate = both
    places = [gate.take() for _ in range(PLACES)]
    places[0].add(1)
    with pytest.raises(OSError, match="no place"):
        gate.take()
    places[0].leave()
    again = gate.take()
    assert again.address != places[0].address
    assert daemon.received(again.address) == 0


@pytest.mark.parametrize("address", ["", b"", "/run/a", b"\0other/1/2/3", b"\0lcf-edge/a/1/0", b"\0lcf-edge/a/1/999"])
def test_other_addresses_are_none_of_a_gates(both: tuple[Tallies, Tallies], address: str | bytes) -> None:
    assert both[0].received(address) is None
