"""Memory that peers make the daemon hold: reclaimed before anything of its own is given up.

Zenoh has no limit for what peers declare. So above the threshold, peers are dealt with first: free memory is returned
to the system; the connections that are charged with much growth are cut; and if that does not help, because something
remains when a peer disconnects, the session is reopened.
"""

import time
from collections.abc import Callable

from lcf_edge.daemon.heap import trim
from lcf_edge.daemon.link import Link
from lcf_edge.daemon.log import LOGGER
from lcf_edge.daemon.memory import SHED_AT

CHECK_S = 0.05
LOOK_S = 0.25  # between checks of the connections, which take longer than measuring memory
LOOK_AT_MIB = 1.0  # growth of memory after which they are checked at once
CUT_AT_MIB = 1.0  # charged to one connection
EFFECT_S = 0.5  # delay until a cut or a renewal takes effect
RENEW_AT_MIB = 4.0  # charged to all since the last renewal
RENEW_EACH_S = 10.0


class PeersMemory:
    """Watches the memory on behalf of ``link``."""

    def __init__(
        self,
        link: Link,
        measure_mib: Callable[[], float],
        now_s: Callable[[], float] = time.monotonic,
        trim: Callable[[], None] = trim,
    ) -> None:
        self._link = link
        self._measure_mib, self._now_s, self._trim = measure_mib, now_s, trim
        self._resident_mib = measure_mib()  # at the last look
        self._looked_s = now_s()
        self._acted_s = self._renewed_s = -RENEW_EACH_S
        self._within_s = now_s()  # when memory was last within the budget
        self._charged_before_mib = 0.0  # charged before the last renewal
        self._without_session = False

    @property
    def blamed(self) -> bool:
        """Whether peers are charged with much growth, or the effect of acting on them is still pending."""
        return self._acted or self._laid_to_peers_mib > RENEW_AT_MIB

    def check(self, budget_mib: float) -> None:
        """Measure, and act above ``SHED_AT`` of the budget; called each ``CHECK_S``."""
        resident_mib = self._measure_mib()
        if resident_mib < self._resident_mib + LOOK_AT_MIB and self._now_s() < self._looked_s + LOOK_S:
            return
        self._looked_s = self._now_s()
        if resident_mib > SHED_AT * budget_mib:
            self._trim()
            resident_mib = self._measure_mib()
        self._link.charge(max(resident_mib - self._resident_mib, 0.0))
        self._resident_mib = resident_mib
        if self._without_session:
            self._renew()
            return
        if self._resident_mib <= budget_mib:
            self._within_s = self._now_s()
        if self._resident_mib > SHED_AT * budget_mib:
            self._act()

    def _act(self) -> None:
        """Act on peers, if they are charged with much growth."""
        now_s = self._now_s()
        exceeded = now_s >= self._within_s + EFFECT_S  # in spite of cuts
        much = self._laid_to_peers_mib > RENEW_AT_MIB
        number = 0 if much and exceeded else self._link.cut(CUT_AT_MIB)
        if number:
            self._acted_s = now_s
            LOGGER.warning(
                "link: %.0f MiB are resident; cut the %d connections that filled it", self._resident_mib, number
            )
        elif much and (exceeded or not (self._acted or now_s < self._renewed_s + RENEW_EACH_S)):
            self._charged_before_mib = self._link.charged_mib
            LOGGER.warning("link: %.0f MiB are resident, filled by peers; reopened", self._resident_mib)
            self._renew()

    def _renew(self) -> None:
        if not self._without_session or not self._acted:  # while it fails, only now and then
            self._acted_s = self._renewed_s = self._now_s()
            self._without_session = not self._link.renew()
            self._trim()
            self._resident_mib = self._measure_mib()
            self._within_s = self._now_s()

    @property
    def _acted(self) -> bool:
        return self._now_s() < self._acted_s + EFFECT_S

    @property
    def _laid_to_peers_mib(self) -> float:
        """MiB charged to peers since the last renewal."""
        return self._link.charged_mib - self._charged_before_mib
