"""The tables that the filter keeps: preallocated, structure of arrays, a fixed capacity each.

Edges stand packed in the first ``count`` rows. Circles and ψ keep their row for life (``active`` tells which are in
use), because edges refer to a circle by its row.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from lcf_edge.filter.inputs import APPEARANCE_SAMPLES

Rows = npt.NDArray[np.signedinteger[Any]]
Mask = npt.NDArray[np.bool_]
Floats = npt.NDArray[np.floating[Any]]

KEYS = 16  # key frames that an edge remembers
NO_CIRCLE = -1

_EDGE_FIELDS = ("x", "y", "beta", "speed", "bl", "trust", "deviation", "origin_x", "origin_y")


class EdgeTable:
    """Normal and rebel edges (E_n, E_r) and the chains of α, in one table.

    One table, because an edge changes sides and one matching must serve both. ``rebel`` tells E_r from E_n, ``links``
    > 0 marks an edge in α (ℓ, key frames for which it has broken the flow).

    float32 columns: ``x``, ``y`` (L, px), ``beta`` (β, rad, of rebels and chains; others have their flow line),
    ``speed`` (V, px/s along β), ``bl`` (BL, px), ``trust`` (Tr), ``deviation`` (DL, rad), ``origin_x``, ``origin_y``
    (O of a rebel, px), and ``key_x``, ``key_y`` (KEYS, capacity): L at the last key frames, in their own axes.
    """

    def __init__(self, normal_capacity: int, rebel_capacity: int, chain_capacity: int) -> None:
        self.normal_capacity = normal_capacity
        self.rebel_capacity = rebel_capacity
        self.chain_capacity = chain_capacity
        capacity = normal_capacity + rebel_capacity
        self.capacity = capacity
        self.count = 0
        self._floats = np.zeros((len(_EDGE_FIELDS) + 2 * KEYS, capacity), np.float32)
        (
            self.x,
            self.y,
            self.beta,
            self.speed,
            self.bl,
            self.trust,
            self.deviation,
            self.origin_x,
            self.origin_y,
        ) = self._floats[: len(_EDGE_FIELDS)]
        self.key_x = self._floats[len(_EDGE_FIELDS) : len(_EDGE_FIELDS) + KEYS]
        self.key_y = self._floats[len(_EDGE_FIELDS) + KEYS :]
        self._shorts = np.zeros((4, capacity), np.int32)
        self.born_key, self.circle, self.links, self.cause = self._shorts  # born_key: first key frame it has seen
        self._flags = np.zeros((3, capacity), np.bool_)
        self.rebel, self.held, self.matched = self._flags  # held: inside ψ, predicted without being looked at
        self.appearance = np.zeros((capacity, APPEARANCE_SAMPLES), np.uint8)

    @property
    def nbytes(self) -> int:
        """Bytes that the table occupies, for good."""
        return self._floats.nbytes + self._shorts.nbytes + self._flags.nbytes + self.appearance.nbytes

    def own_way(self) -> Mask:
        """Edges that follow no flow line: rebels and chains; bool (count,)."""
        return self.rebel[: self.count] | (self.links[: self.count] > 0)

    def remove(self, dead: Mask) -> None:
        """Delete rows; ``dead``: bool (count,). The last rows move into the gaps."""
        count = self.count
        alive = count - int(np.count_nonzero(dead))
        if alive == count:
            return
        gaps = dead[:alive].nonzero()[0]
        movers = alive + (~dead[alive:]).nonzero()[0]
        self._copy(movers, gaps)
        self.count = alive

    def append(self, number: int) -> slice:
        """Claim ``number`` rows behind the last one; the caller sees to it that they fit, and fills them."""
        rows = slice(self.count, self.count + number)
        self._floats[:, rows] = 0
        self._shorts[:, rows] = 0
        self.circle[rows] = NO_CIRCLE
        self._flags[:, rows] = False
        self.count += number
        return rows

    def duplicate(self, rows: Rows) -> slice:
        """Append copies of ``rows``, with their history."""
        copies = slice(self.count, self.count + len(rows))
        self._copy(rows, copies)
        self.count += len(rows)
        return copies

    def _copy(self, source: Rows, target: Rows | slice) -> None:
        self._floats[:, target] = self._floats[:, source]
        self._shorts[:, target] = self._shorts[:, source]
        self._flags[:, target] = self._flags[:, source]
        self.appearance[target] = self.appearance[source]

    def normal_room(self) -> int:
        """Rows that E_n may still take."""
        return self.normal_capacity - (self.count - int(np.count_nonzero(self.rebel[: self.count])))

    def trim(self) -> int:
        """Hold E_n and α to their capacities: the least trusted edges leave, and chains are freed; how many."""
        n = self.count
        chains = (self.links[:n] > 0) & ~self.rebel[:n]
        excess_chains = max(0, int(np.count_nonzero(chains)) - self.chain_capacity)
        self.links[self.least_trusted(chains, excess_chains)] = 0
        excess = max(0, -self.normal_room())
        if excess:
            dead = np.zeros(n, np.bool_)
            dead[self.least_trusted(~self.rebel[:n], excess)] = True
            self.remove(dead)
        return excess + excess_chains

    def least_trusted(self, candidates: Mask, number: int) -> Rows:
        """The ``number`` rows of ``candidates`` (bool (count,)) with the least trust, the youngest of equals first."""
        rows = np.flatnonzero(candidates)
        order = np.lexsort((-self.born_key[rows], self.trust[rows]))
        return rows[order[:number]]


class CircleTable:
    """Normal or rebel circles (C_n, C_r); rows keep their place.

    float32 columns: ``x``, ``y``, ``radius`` (px), ``beta`` (β, rad), ``speed`` (V, px/s), ``expansion`` (V/r, 1/s:
    the inverse of the time to contact of what stands still), ``trust``, ``ttc`` (s), ``lateral`` (m), ``range`` (m),
    ``corr`` (coherence of the group, (0, 1]), ``width``, ``height`` (px, extent of the members).
    """

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self._floats = np.zeros((13, capacity), np.float32)
        (
            self.x,
            self.y,
            self.radius,
            self.beta,
            self.speed,
            self.expansion,
            self.trust,
            self.ttc,
            self.lateral,
            self.range,
            self.corr,
            self.width,
            self.height,
        ) = self._floats
        self.active = np.zeros(capacity, np.bool_)
        self.id = np.zeros(capacity, np.uint32)
        self.support = np.zeros(capacity, np.int32)
        self.cause = np.zeros(capacity, np.uint8)

    @property
    def nbytes(self) -> int:
        """Bytes that the table occupies, for good."""
        return sum(a.nbytes for a in (self._floats, self.active, self.id, self.support, self.cause))

    def park(self) -> None:
        """Zero the rows that are not in use, so that predictions of nothing stay nothing."""
        self._floats[:, ~self.active] = 0

    @property
    def count(self) -> int:
        """Rows in use."""
        return int(np.count_nonzero(self.active))


class PsiTable:
    """Regions that are ignored (ψ). ``shape``: Ty, 1 circle, 2 rectangle; sizes are full widths in px."""

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self._floats = np.zeros((7, capacity), np.float32)
        self.x, self.y, self.width, self.height, self.trust, self.life_s, self.expansion = self._floats
        self.active = np.zeros(capacity, np.bool_)
        self.id = np.zeros(capacity, np.uint32)
        self.shape = np.zeros(capacity, np.uint8)
        self.circle = np.full(capacity, NO_CIRCLE, np.int32)  # the normal circle that wrote it

    @property
    def nbytes(self) -> int:
        """Bytes that the table occupies, for good."""
        return sum(a.nbytes for a in (self._floats, self.active, self.id, self.shape, self.circle))

    def park(self) -> None:
        """Zero the rows that are not in use, so that predictions of nothing stay nothing."""
        self._floats[:, ~self.active] = 0

    @property
    def count(self) -> int:
        """Rows in use."""
        return int(np.count_nonzero(self.active))
