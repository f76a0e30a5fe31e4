"""α: chains of three key positions become rebel edges; rebels that obey the flow again go home."""

import numpy as np

from lcf_edge.config import Filter
from lcf_edge.filter.circles import newborn_trust
from lcf_edge.filter.flow import KeyFrames, wrap
from lcf_edge.filter.rebel_detection import (
    Baselines,
    Links,
    Rebels,
    Verdict,
    agree,
    find_incoming,
    give_birth,
    judge,
)
from lcf_edge.filter.situation import Situation
from lcf_edge.filter.tables import KEYS, NO_CIRCLE, EdgeTable, Floats, Mask, Rows

BASELINE_LEAST_S = 0.08  # shorter links say nothing
BASELINE_SURE_S = 0.2  # a history this long tells what moves from what stands
PENDING = 2  # links of a chain that waits for its third key frame
OBEDIENCE = 2  # trust that a rebel loses in a frame in which it follows the flow


class Alpha:
    """Marks key frames and judges the edges' histories against the flow."""

    def __init__(self, settings: Filter, edges: EdgeTable, keys: KeyFrames) -> None:
        self._settings = settings
        self._edges = edges
        self._keys = keys
        self._tr_new = newborn_trust(settings)

    def mark_key(self, dt_s: float) -> bool:
        """Make this frame a key frame when there is motion enough to be told from corner noise, or time is up."""
        settings, edges, keys = self._settings, self._edges, self._keys
        n, waited_s = edges.count, keys.since_s + 0.5 * dt_s
        if keys.number and waited_s < settings.key_interval_s:
            return False
        if keys.number and waited_s < 2 * settings.key_interval_s and n:
            middle = n // 2
            moved_px = float(np.partition(np.abs(edges.speed[:n]), middle)[middle]) * keys.since_s
            if moved_px < settings.key_motion_px:
                return False
        slot = keys.mark()
        edges.born_key[:n][edges.held[:n]] = keys.number  # where ψ had it predicted is no key position
        edges.key_x[slot, :n] = edges.x[:n]
        edges.key_y[slot, :n] = edges.y[:n]
        return True

    def detect(self, around: Situation, key: bool) -> tuple[Rebels | None, int]:
        """Judge every edge that was seen and has a history; answers the rebels among them and the evictions."""
        edges, keys, n = self._edges, self._keys, self._edges.count
        oldest = np.maximum(edges.born_key[:n], keys.number - KEYS)
        old_enough = (keys.elapsed_s >= BASELINE_LEAST_S).take(oldest % KEYS)
        rows = (edges.matched[:n] & (oldest < keys.number) & old_enough).nonzero()[0]
        if not len(rows):
            return None, 0
        x, y, oldest, rebel = edges.x.take(rows), edges.y.take(rows), oldest.take(rows), edges.rebel.take(rows)
        baselines = Baselines(keys, around)
        first = baselines.links(edges, rows, oldest)
        whole = judge(first, x, y, around)
        find_incoming(whole, first, x, y, rebel, around)
        breaks = whole.mover | whole.incoming
        obeys = ~breaks
        self._pardon(rows[rebel & obeys], rows[obeys & ~rebel & (edges.links.take(rows) > 0)], around)

        suspects = (breaks & ~rebel).nonzero()[0]
        evicted = 0
        if len(suspects):
            middle = (oldest.take(suspects) + keys.number - key) // 2
            has_three = middle > oldest.take(suspects)
            self._wait(rows.take(suspects)[~has_three], key, around)
            suspects, middle = suspects[has_three], middle[has_three]
            if len(suspects):
                evicted = self._decide(
                    rows.take(suspects), first.take(suspects), whole.take(suspects), middle, baselines, around
                )

        at = (edges.rebel.take(rows) & breaks).nonzero()[0]
        if not len(at):
            return None, evicted
        rows, links, x, y = rows.take(at), first.take(at), x.take(at), y.take(at)
        edges.origin_x[rows], edges.origin_y[rows] = links.x, links.y  # O slides with the window of key frames
        vx, vy = (x - links.x) / links.elapsed_s, (y - links.y) / links.elapsed_s
        return Rebels(rows, x, y, vx, vy, links, whole.take(at)), evicted

    def _wait(self, rows: Rows, key: bool, around: Situation) -> None:
        """Edges that break the flow, and are too young to be judged, are chains that wait for their third key frame."""
        edges = self._edges
        fresh = rows[edges.links[rows] == 0]
        dx, dy = edges.x[fresh] - np.float32(around.focus[0]), edges.y[fresh] - np.float32(around.focus[1])
        edges.beta[fresh] = np.arctan2(dy, dx)  # until now they followed their flow lines
        edges.links[rows] = np.clip(edges.links[rows] + key, 1, PENDING)

    def _decide(
        self, rows: Rows, first: Links, whole: Verdict, middle: Rows, baselines: Baselines, around: Situation
    ) -> int:
        """Success or failure, both free the chain: three links that agree make a rebel. Answers evictions."""
        edges, settings = self._edges, self._settings
        second = baselines.links(edges, rows, middle)
        recent = judge(second, edges.x[rows], edges.y[rows], around)
        ok = agree(whole, first.elapsed_s, recent, second.elapsed_s, settings.edge_noise_px)
        edges.links[rows[~ok]] = 0
        torn = rows[~ok & whole.mover]  # not one landmark: its history is worth nothing
        edges.born_key[torn] = self._keys.number
        born = np.flatnonzero(ok)
        room = edges.rebel_capacity - int(np.count_nonzero(edges.rebel[: edges.count]))
        weak: Rows = np.empty(0, np.intp)
        if len(born) > room:
            n = edges.count
            weak = edges.least_trusted(edges.rebel[:n] & (edges.trust[:n] < self._tr_new), len(born) - room)
            self._send_home(weak, around)
        evicted = max(0, len(born) - room)
        born = born[: max(0, room) + len(weak)]
        give_birth(edges, rows[born], first.take(born), second.take(born))
        edges.circle[rows[born]] = NO_CIRCLE
        edges.trust[rows[born]] = self._tr_new
        edges.bl[rows[born]] = np.maximum(edges.bl[rows[born]], np.float32(2 * settings.bl_min_px))
        return evicted

    def _pardon(self, rebels: Rows, chains: Rows, around: Situation) -> None:
        """What follows the flow again: rebels lose trust and go home to E_n when it runs out, chains are freed."""
        edges = self._edges
        if len(rebels):
            edges.trust[rebels] -= OBEDIENCE
            self._send_home(rebels[edges.trust[rebels] < self._settings.tr_cr], around)
        if len(chains):
            edges.links[chains] = 0
            edges.speed[chains] = self._outward_speed(chains, around)

    def _send_home(self, rows: Rows, around: Situation) -> None:
        edges = self._edges
        edges.rebel[rows] = False
        edges.trust[rows] = self._tr_new
        edges.circle[rows] = NO_CIRCLE
        edges.speed[rows] = self._outward_speed(rows, around)

    def _outward_speed(self, rows: Rows, around: Situation) -> Floats:
        """V along the flow line of edges that went their own way until now, px/s."""
        edges = self._edges
        dx, dy = edges.x[rows] - np.float32(around.focus[0]), edges.y[rows] - np.float32(around.focus[1])
        return np.asarray(edges.speed[rows] * np.cos(wrap(edges.beta[rows] - np.arctan2(dy, dx))))

    def looked_at(self, circles: int) -> Mask:
        """Normal circles most of whose edges have a history that tells what moves; bool (circles,)."""
        edges, n, keys = self._edges, self._edges.count, self._keys
        rows = ((edges.circle[:n] >= 0) & ~edges.rebel[:n]).nonzero()[0]
        circle = edges.circle.take(rows)
        oldest = np.maximum(edges.born_key.take(rows), keys.number - KEYS)
        judged = (oldest < keys.number) & (keys.elapsed_s >= BASELINE_SURE_S).take(oldest % KEYS)
        members = np.bincount(circle, minlength=circles)
        return np.asarray(2 * np.bincount(circle[judged], minlength=circles) > members)
