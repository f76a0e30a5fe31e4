"""What peers make the daemon keep is given back before anything of its own is given up."""

import pytest

from lcf_edge.daemon.memory import SHED_AT
from lcf_edge.daemon.peers import (
    CHECK_S,
    CUT_AT_MIB,
    EFFECT_S,
    LOOK_AT_MIB,
    LOOK_S,
    RENEW_AT_MIB,
    RENEW_EACH_S,
    PeersMemory,
    trim,
)

BUDGET_MIB = 100.0
MARK_MIB = SHED_AT * BUDGET_MIB


class Filled:
    """A link whose peers fill the memory, all of it the guilty ones' unless ``stays_mib``."""

    def __init__(self) -> None:
        self.resident_mib = 50.0
        self.charged_mib = 0.0
        self.of_the_guilty_mib = 0.0
        self.opens = True
        self.looks: list[float] = []
        self.cuts: list[float] = []
        self.renewals: list[float] = []
        self.free_mib = 0.0
        self.now_s = 1000.0

    def charge(self, grown_mib: float) -> None:
        self.looks.append(self.now_s)
        self.charged_mib += grown_mib

    def cut(self, charge_mib: float) -> int:
        if self.of_the_guilty_mib < charge_mib:
            return 0
        self.cuts.append(self.now_s)
        self.resident_mib -= self.of_the_guilty_mib
        self.of_the_guilty_mib = 0.0
        return 1

    def renew(self) -> bool:
        self.renewals.append(self.now_s)
        return self.opens

    def trim(self) -> None:
        self.resident_mib -= self.free_mib
        self.free_mib = 0.0


@pytest.fixture
def link() -> Filled:
    return Filled()


@pytest.fixture
def peers(link: Filled) -> PeersMemory:
    return PeersMemory(link, lambda: link.resident_mib, lambda: link.now_s, link.trim)  # type: ignore[arg-type]


def test_below_the_mark_nothing_is_done(link: Filled, peers: PeersMemory) -> None:
    link.resident_mib = MARK_MIB
    link.of_the_guilty_mib = 40.0
    peers.check(BUDGET_MIB)
    assert (link.cuts, link.renewals) == ([], [])
    assert link.charged_mib == MARK_MIB - 50.0


def test_connections_are_looked_at_now_and_then_but_a_burst_is_not_waited_for(link: Filled, peers: PeersMemory) -> None:
    steps = int(LOOK_S / CHECK_S) + 2
    for _ in range(steps):
        peers.check(BUDGET_MIB)
        link.now_s += CHECK_S
    assert len(link.looks) == 1
    link.resident_mib += LOOK_AT_MIB
    peers.check(BUDGET_MIB)
    assert len(link.looks) == 2
    assert link.charged_mib == LOOK_AT_MIB


def test_a_burst_is_cut_before_the_next_look_is_due(link: Filled, peers: PeersMemory) -> None:
    link.resident_mib = link.of_the_guilty_mib = MARK_MIB
    peers.check(BUDGET_MIB)
    link.now_s += CHECK_S
    link.resident_mib = link.of_the_guilty_mib = MARK_MIB + LOOK_AT_MIB
    peers.check(BUDGET_MIB)
    assert link.cuts == [link.now_s]


def test_what_is_given_back_at_once_is_laid_to_nobody(link: Filled, peers: PeersMemory) -> None:
    link.resident_mib, link.free_mib = MARK_MIB + 5, MARK_MIB - 40
    peers.check(BUDGET_MIB)
    assert link.charged_mib == 0.0


def test_what_is_free_goes_back_first(link: Filled, peers: PeersMemory) -> None:
    link.resident_mib, link.free_mib, link.of_the_guilty_mib = MARK_MIB + 1, 5.0, 40.0
    peers.check(BUDGET_MIB)
    assert (link.cuts, link.renewals) == ([], [])
    assert link.resident_mib == MARK_MIB - 4


def test_then_connections_that_filled_it_are_cut_and_the_effect_is_waited_for(link: Filled, peers: PeersMemory) -> None:
    link.resident_mib = link.of_the_guilty_mib = MARK_MIB + 1
    peers.check(BUDGET_MIB)
    assert link.cuts == [link.now_s]
    assert peers.blamed
    link.resident_mib = MARK_MIB + 1
    peers.check(BUDGET_MIB)
    assert link.renewals == []
    link.now_s += EFFECT_S
    peers.check(BUDGET_MIB)
    assert link.renewals == [link.now_s]
    link.now_s += EFFECT_S
    assert not peers.blamed


def test_where_nobody_is_left_to_cut_the_session_is_opened_anew(link: Filled, peers: PeersMemory) -> None:
    link.resident_mib = MARK_MIB + 1
    peers.check(BUDGET_MIB)
    assert link.renewals == [link.now_s]
    assert peers.blamed


def test_what_peers_have_not_filled_is_not_laid_to_them(link: Filled) -> None:
    link.resident_mib = MARK_MIB + 1
    peers = PeersMemory(link, lambda: link.resident_mib, lambda: link.now_s, link.trim)  # type: ignore[arg-type]
    link.resident_mib += RENEW_AT_MIB
    peers.check(BUDGET_MIB)
    assert (link.cuts, link.renewals, peers.blamed) == ([], [], False)


def test_it_is_opened_anew_seldom_unless_the_budget_itself_is_exceeded(link: Filled, peers: PeersMemory) -> None:
    link.resident_mib = MARK_MIB + 1
    for _ in range(int(4 * RENEW_EACH_S)):
        peers.check(BUDGET_MIB)
        link.now_s += 0.25
        link.charged_mib += RENEW_AT_MIB
    assert len(link.renewals) == 1
    link.resident_mib = BUDGET_MIB + 1
    for _ in range(8):
        peers.check(BUDGET_MIB)
        link.now_s += 0.25
        link.charged_mib += RENEW_AT_MIB
    assert len(link.renewals) >= 2


def test_over_the_budget_cutting_is_not_relied_upon(link: Filled, peers: PeersMemory) -> None:
    link.resident_mib = BUDGET_MIB + 30
    link.of_the_guilty_mib = CUT_AT_MIB
    peers.check(BUDGET_MIB)
    assert (len(link.cuts), link.renewals) == (1, [])
    link.now_s += EFFECT_S
    link.of_the_guilty_mib = CUT_AT_MIB
    peers.check(BUDGET_MIB)
    assert (len(link.cuts), link.renewals) == (1, [link.now_s])


def test_a_session_that_cannot_be_opened_is_tried_again(link: Filled, peers: PeersMemory) -> None:
    link.resident_mib, link.opens = MARK_MIB + 1, False
    peers.check(BUDGET_MIB)
    peers.check(BUDGET_MIB)
    assert len(link.renewals) == 1
    link.now_s += EFFECT_S
    peers.check(BUDGET_MIB)
    assert len(link.renewals) == 2
    link.now_s += EFFECT_S
    link.resident_mib, link.opens = 50.0, True
    peers.check(BUDGET_MIB)
    link.now_s += EFFECT_S
    peers.check(BUDGET_MIB)
    assert len(link.renewals) == 3


def test_memory_can_be_given_back_here() -> None:
    trim()
    assert CUT_AT_MIB < RENEW_AT_MIB
