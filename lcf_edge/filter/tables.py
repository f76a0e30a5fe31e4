"""The filter's tables: preallocated, structure of arrays, with a fixed capacity each.

Each table is a list of columns, with meaning, unit, and the modules that write it. Edges are packed in the first
``count`` rows. Circles and ψ keep their row for life (``active`` marks rows in use), because edges refer to a circle by
its row.

A column is a NumPy array here, for readers of a table, and typed memory in ``columns``, for the loops.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lcf_edge.filter import edge_rows
from lcf_edge.filter.columns import CircleColumns, CornerColumns, EdgeColumns, GroupColumns, ObjectColumns, PsiColumns
from lcf_edge.filter.inputs import APPEARANCE_SAMPLES, KEYS, LOOK_SIDE
from lcf_edge.filter.line_expert import group_at
from lcf_edge.filter.memory import memory_of

Rows = npt.NDArray[np.signedinteger[Any]]
Mask = npt.NDArray[np.bool_]
Floats = npt.NDArray[np.floating[Any]]

NO_CIRCLE = -1
NO_OBJECT = -1


@dataclass(frozen=True, slots=True)
class Column:
    """One column. ``writers``: the modules of the filter that change it, besides moving whole rows (``edge_rows``)."""

    name: str
    meaning: str
    unit: str
    writers: tuple[str, ...]
    dtype: type[np.generic] = np.float64
    shape: tuple[int, ...] = ()
    empty: int = 0  # initial value


EDGE_COLUMNS = (
    Column("x", "L, to the right", "px", ("derotation", "edge_expert")),
    Column("y", "L, down", "px", ("derotation", "edge_expert")),
    Column(
        "beta",
        "β: of rebels and chains; the others go along their flow line",
        "rad",
        ("derotation", "edge_expert", "alpha", "rebel_detection"),
    ),
    Column("speed", "V along β", "px/s", ("edge_expert", "alpha", "rebel_detection")),
    Column("bl", "BL, radius of the gate around the prediction", "px", ("edge_expert", "rebel_detection")),
    Column("trust", "Tr", "1", ("edge_expert", "line_expert", "alpha", "rebel_detection")),
    Column("deviation", "DL: turn of β per frame, of rebels and chains", "rad", ("edge_expert", "rebel_detection")),
    Column(
        "origin_x",
        "O of a rebel or chain: where it was first seen within the window of key frames",
        "px",
        ("derotation", "edge_expert", "alpha", "rebel_detection"),
    ),
    Column("origin_y", "as origin_x", "px", ("derotation", "edge_expert", "alpha", "rebel_detection")),
    Column("key_x", "L at the last key frames, by slot, in their own axes", "px", ("alpha",), shape=(KEYS,)),
    Column("key_y", "as key_x", "px", ("alpha",), shape=(KEYS,)),
    Column(
        "born_key",
        "number of the first key frame that it has seen",
        "1",
        ("edge_expert", "line_expert", "alpha"),
        np.int32,
    ),
    Column(
        "circle",
        "row of its circle, -1: none; of C_r where `rebel` is set, else of C_n",
        "row",
        ("edge_expert", "alpha", "rebel_detection", "circles", "normal_circles", "rebel_circles"),
        np.int32,
        empty=NO_CIRCLE,
    ),
    Column(
        "square",
        "row of the object that it belongs to, also while it breaks no flow, -1: none",
        "row",
        ("square_expert",),
        np.int32,
        empty=NO_OBJECT,
    ),
    Column(
        "suspect_keys",
        "ℓ: key frames for which it has broken the flow; above 0 it is in α",
        "1",
        ("edge_expert", "alpha", "rebel_detection"),
        np.int32,
    ),
    Column("rebel", "E_r, else E_n", "", ("alpha", "rebel_detection"), np.bool_),
    Column("held", "inside ψ: predicted without being matched", "", ("line_expert",), np.bool_),
    Column("matched", "its corner was found in this frame, or it is new", "", ("edge_expert",), np.bool_),
    Column("appearance", "grey samples around its corner", "grey", ("edge_expert",), np.uint8, (APPEARANCE_SAMPLES,)),
    Column(
        "fixed_x",
        "pixel of the input frame that its corner has not left",
        "px",
        ("edge_expert",),
        np.int32,
    ),
    Column("fixed_y", "as fixed_x", "px", ("edge_expert",), np.int32),
    Column("fixed_s", "for how long it has not", "s", ("edge_expert",)),
    Column("variance_along", "of L along its direction", "px²", ("error_matrix",)),
    Column("variance_across", "of L across its direction", "px²", ("error_matrix",)),
    Column("covariance_speed", "of L along its direction with V", "px²/s", ("error_matrix",)),
    Column("variance_speed", "of V", "(px/s)²", ("error_matrix",)),
    Column("predicted_x", "L', in this frame", "px", ("edge_expert", "derotation")),
    Column("predicted_y", "L', in this frame", "px", ("edge_expert", "derotation")),
    Column("predicted_speed", "V', in this frame", "px/s", ("edge_expert",)),
    Column("cos", "cos of the direction of the prediction", "1", ("edge_expert",)),
    Column("sin", "sin of the direction of the prediction", "1", ("edge_expert",)),
    Column("corner", "row of its corner in this frame, -1: none", "row", ("matching", "leaps"), np.int32),
    Column("best", "row of the corner that it would choose, -1: none", "row", ("matching",), np.int32),
    Column("cost", "of that choice", "grey", ("matching",)),
    Column("psi", "row of the ψ region that contains L', -1: none", "row", ("line_expert",), np.int32),
)
"""E_n, E_r and the chains of α, in one table, because an edge changes sides and one matching must serve both."""

CONTACT_WRITERS = ("circles", "rebel_circles", "coarse_circles", "object_circles")
PLACE_WRITERS = (*CONTACT_WRITERS, "turmoil")
CENTRE_WRITERS = ("derotation", "circles", "normal_circles", "rebel_circles", "object_circles")
SPEED_WRITERS = ("circles", "normal_circles", "rebel_circles", "coarse_circles", "object_circles", "turmoil")
CIRCLE_COLUMNS = (
    Column("active", "row in use", "", ("normal_circles", "rebel_circles", "circles", "object_circles"), np.bool_),
    Column("id", "identity, never 0", "1", ("circles",), np.uint32),
    Column("x", "centre, to the right", "px", CENTRE_WRITERS),
    Column("y", "centre, down", "px", CENTRE_WRITERS),
    Column("radius", "R", "px", ("circles", "normal_circles", "rebel_circles", "object_circles")),
    Column("beta", "β of its motion in the image", "rad", ("derotation", *SPEED_WRITERS)),
    Column("speed", "V along β", "px/s", SPEED_WRITERS),
    Column("expansion", "V/r of C_n: inverse time to contact, if stationary", "1/s", ("normal_circles",)),
    Column(
        "trust",
        "Tr",
        "1",
        ("circles", "normal_circles", "rebel_circles", "object_circles", "turmoil", "feedback"),
    ),
    Column("corr", "coherence of the directions of its edges, (0, 1]", "1", ("circles", "normal_circles")),
    Column("support", "edges behind it", "1", ("circles", "object_circles"), np.int32),
    Column("width", "extent of its edges", "px", ("circles", "rebel_circles", "object_circles")),
    Column("height", "extent of its edges", "px", ("circles", "rebel_circles", "object_circles")),
    Column("cause", "`messages.Cause` of C_r", "", PLACE_WRITERS, np.uint8),
    Column("ttc", "time to contact of C_r, inf: none", "s", CONTACT_WRITERS),
    Column("range", "of C_r, NaN: unknown", "m", PLACE_WRITERS),
    Column(
        "lateral",
        "miss to the side of the path, right positive, NaN: unknown",
        "m",
        CONTACT_WRITERS,
    ),
    Column("unseen_s", "of C_r: since edges last showed it", "s", ("circles", "rebel_circles")),
    Column(
        "square",
        "row of the object that a C_r belongs to, -1: none",
        "row",
        ("circles", "square_expert", "object_circles"),
        np.int32,
        empty=NO_OBJECT,
    ),
)
"""C_n and C_r, a table each."""

OBJECT_COLUMNS = (
    Column("active", "row in use", "", ("square_expert", "object_prediction"), np.bool_),
    Column("id", "identity, never 0", "1", ("square_expert", "object_prediction"), np.uint32),
    Column("x", "middle of its box, to the right", "px", ("square_expert", "object_prediction")),
    Column("y", "middle of its box, down", "px", ("square_expert", "object_prediction")),
    Column("width", "of its box", "px", ("square_expert", "object_prediction")),
    Column("height", "of its box", "px", ("square_expert", "object_prediction")),
    Column("looming", "m = (V - w_z)/Z, at the V of ``reference``", "1/s", ("square_expert", "object_prediction")),
    Column(
        "reference",
        "V of the vehicle at which m was measured, in the mean",
        "m/s",
        ("square_expert", "object_prediction"),
    ),
    Column("sideways", "q = w_x/Z", "1/s", ("square_expert", "object_prediction")),
    Column("mm", "variance of m", "1/s²", ("square_expert", "object_prediction")),
    Column("qq", "variance of q", "1/s²", ("square_expert", "object_prediction")),
    Column("mq", "covariance of both", "1/s²", ("square_expert", "object_prediction")),
    Column("inverse", "1/Z by the change of m with V, 0: unknown", "1/m", ("speed_change",)),
    Column("inverse_var", "its variance", "1/m²", ("speed_change",)),
    Column("steady", "m as long as its velocity is steady", "1/s", ("speed_change",)),
    Column("steady_speed", "V at which that was measured", "m/s", ("speed_change",)),
    Column("steady_var", "its variance", "1/s²", ("speed_change",)),
    Column("steady_inverse", "covariance of it and ``inverse``", "1/(m·s)", ("speed_change",)),
    Column(
        "foot",
        "1/Z of the ground where its lowest edge is or was seen",
        "1/m",
        ("square_expert", "object_prediction", "object_belief"),
    ),
    Column("log_odds", "logarithmic odds that it stands", "1", ("square_expert", "object_belief")),
    Column("class_id", "`messages.ObjectClass`", "", ("square_expert", "object_belief"), np.uint8),
    Column("state", "`messages.ObjectState`", "", ("square_expert", "object_prediction"), np.uint8),
    Column("support", "edges behind it", "1", ("square_expert",), np.int32),
    Column("recent_edges", "edges that lately showed it", "1", ("square_expert",)),
    Column(
        "watched",
        "since the vehicle rests: whether its place is compared with `looks`",
        "",
        ("square_expert", "object_prediction"),
        np.uint8,
    ),
    Column("looks", "grey samples of its place", "grey", ("object_prediction",), np.uint8, (LOOK_SIDE * LOOK_SIDE,)),
    Column("trust", "Tr", "1", ("square_expert", "object_prediction")),
    Column("age_s", "since it was founded", "s", ("square_expert", "object_prediction")),
    Column("unseen_s", "since edges last showed it", "s", ("square_expert", "object_prediction")),
    Column(
        "left",
        "it left the image at the side, and was not seen since",
        "",
        ("square_expert", "object_prediction"),
        np.bool_,
    ),
    Column("ttc", "time to contact, inf: none", "s", ("square_expert", "object_belief")),
    Column("ttc_sigma", "1 sigma of it, NaN: unknown", "s", ("object_belief",)),
    Column(
        "middle",
        "Z of the middle of its edges, NaN: unknown",
        "m",
        ("square_expert", "object_prediction", "object_belief"),
    ),
    Column("middle_sigma", "1 sigma of its logarithm", "1", ("square_expert", "object_belief")),
    Column("range", "Z of its front", "m", ("square_expert", "object_prediction", "object_belief")),
    Column("range_sigma", "1 sigma of it, NaN: unknown", "m", ("object_belief",)),
    Column("lateral", "miss to the side of the path, right positive", "m", ("object_belief",)),
    Column("lateral_sigma", "1 sigma of it, NaN: unknown", "m", ("object_belief",)),
    Column("forward", "w_z, velocity over ground", "m/s", ("object_belief",)),
    Column("forward_sigma", "1 sigma of it, NaN: unknown", "m/s", ("object_belief",)),
    Column("right", "w_x, velocity over ground", "m/s", ("object_belief",)),
    Column("right_sigma", "1 sigma of it, NaN: unknown", "m/s", ("object_belief",)),
    Column("closest", "until its front is passed, NaN: never", "s", ("object_belief",)),
    Column("closest_sigma", "1 sigma of it, NaN: unknown", "s", ("object_belief",)),
    Column("probability", "that it is met within the horizon", "1", ("square_expert", "object_belief")),
)
"""S, objects."""

PSI_COLUMNS = (
    Column("active", "row in use", "", ("feedback", "line_expert"), np.bool_),
    Column("id", "identity, never 0", "1", ("feedback",), np.uint32),
    Column("shape", "Ty: `messages.Shape`", "", ("feedback",), np.uint8),
    Column("x", "centre, to the right", "px", ("derotation", "feedback")),
    Column("y", "centre, down", "px", ("derotation", "feedback")),
    Column("width", "full width", "px", ("feedback",)),
    Column("height", "full height", "px", ("feedback",)),
    Column("trust", "Tr of its circle when it was written", "1", ("feedback",)),
    Column("expansion", "V/r of its circle then", "1/s", ("feedback",)),
    Column("life_s", "time left", "s", ("feedback",)),
    Column("circle", "row of C_n that wrote it", "row", ("feedback",), np.int32, empty=NO_CIRCLE),
    Column("edges", "edges under it, in this frame", "1", ("line_expert",), np.int32),
    Column("missing", "those without a corner", "1", ("line_expert",), np.int32),
    Column("new", "corners without an edge", "1", ("line_expert",), np.int32),
    Column(
        "live",
        "a list: the rows in use before corners are omitted, the last first",
        "row",
        ("line_expert",),
        np.int32,
    ),
)
"""ψ, regions that are ignored."""

GROUP_COLUMNS = (
    Column("x", "centre, to the right", "px", ("line_expert",)),
    Column("y", "centre, down", "px", ("line_expert",)),
    Column("bs", "BS_λ, radius", "px", ("line_expert",)),
    Column("trust", "Tr of its circle", "1", ("line_expert",)),
    Column("row", "row of C_n behind it, -1: it is a rebel circle's", "row", ("line_expert",), np.int32),
)
"""λ, the circles above Tr_cr, the least trusted first; packed in the first ``count`` rows."""

CORNER_COLUMNS = (
    Column("x", "position in the ideal pinhole, to the right", "px", ("matching",)),
    Column("y", "position in the ideal pinhole, down", "px", ("matching",)),
    Column("pixel_x", "position in the input frame, to the right", "px", ("matching",), np.int32),
    Column("pixel_y", "position in the input frame, down", "px", ("matching",), np.int32),
    Column("appearance", "grey samples around it", "grey", ("matching",), np.uint8, (APPEARANCE_SAMPLES,)),
    Column("omitted", "inside ψ", "", ("line_expert",), np.bool_),
    Column("free", "may still be found by an edge", "", ("line_expert", "matching", "leaps"), np.bool_),
    Column("taken", "claimed by an edge", "", ("matching", "edge_expert"), np.bool_),
    Column("expected", "under ψ, and an edge is predicted there", "", ("line_expert",), np.bool_),
    Column("edge", "row of the edge that would choose it at the least cost, -1: none", "row", ("matching",), np.int32),
    Column("cost", "of that choice", "grey", ("matching",)),
    Column("psi", "row of the ψ region that contains it, -1: none", "row", ("line_expert",), np.int32),
)
"""The corners of this frame."""


class Table:
    """Arrays of one length by the name of their column, also available as attributes."""

    def __init__(self, columns: tuple[Column, ...], capacity: int) -> None:
        self.capacity = capacity
        self.arrays = {
            column.name: np.full((capacity, *column.shape), column.empty, column.dtype) for column in columns
        }
        self._empty = {column.name: column.empty for column in columns}

    def __getattr__(self, name: str) -> npt.NDArray[Any]:
        try:
            return self.__dict__["arrays"][name]
        except KeyError:
            raise AttributeError(f"{type(self).__name__} has no column {name}") from None

    def memory(self) -> dict[str, Any]:
        """The columns as memory for the loops."""
        memory = {name: memory_of(array) for name, array in self.arrays.items()}
        if "appearance" in self.arrays:  # the same samples, eight at a time
            memory["words"] = memory_of(self.arrays["appearance"].view(np.uint64))
        return memory

    @property
    def nbytes(self) -> int:
        """Size of the table in bytes."""
        return sum(array.nbytes for array in self.arrays.values())


class EdgeTable(Table):
    """``EDGE_COLUMNS``, with a capacity for each of E_n, E_r and α."""

    def __init__(self, normal_capacity: int, rebel_capacity: int, chain_capacity: int) -> None:
        super().__init__(EDGE_COLUMNS, normal_capacity + rebel_capacity)
        self.normal_capacity = normal_capacity
        self.rebel_capacity = rebel_capacity
        self.chain_capacity = chain_capacity
        self.columns = EdgeColumns(self.memory())

    @property
    def count(self) -> int:
        """Rows in use."""
        return int(self.columns.count)

    @property
    def rebels(self) -> int:
        """Rows of E_r."""
        return int(self.columns.rebels())

    @property
    def chains(self) -> int:
        """Rows of α."""
        return int(self.columns.chains())

    def own_way(self) -> Mask:
        """Edges not bound to a flow line: rebels and chains; bool (count,)."""
        return np.asarray(self.rebel[: self.count] | (self.suspect_keys[: self.count] > 0))

    def append(self, number: int) -> slice:
        """Append ``number`` empty rows; the caller ensures that they fit."""
        rows = slice(self.count, self.count + number)
        for name, array in self.arrays.items():
            array[rows] = self._empty[name]
        self.columns.count += number
        return rows

    def remove(self, dead: Mask) -> None:
        """Delete the rows in ``dead``, bool (count,); the last rows move into the gaps."""
        edge_rows.remove(self.columns, memory_of(dead))

    def normal_room(self) -> int:
        """Rows that E_n may still take."""
        return self.normal_capacity - (self.count - self.rebels)

    def trim(self) -> int:
        """Trim E_n and α to capacity: the least trusted edges leave, and chains are released; return how many."""
        n = self.count
        excess_chains = max(0, self.chains - self.chain_capacity)
        if excess_chains:
            chains = (self.suspect_keys[:n] > 0) & ~self.rebel[:n]
            self.suspect_keys[self.least_trusted(chains, excess_chains)] = 0
        excess = max(0, -self.normal_room())
        if excess:
            dead = np.zeros(n, np.bool_)
            dead[self.least_trusted(~self.rebel[:n], excess)] = True
            self.remove(dead)
        return excess + excess_chains

    def least_trusted(self, candidates: Mask, number: int) -> Rows:
        """The ``number`` least trusted rows of ``candidates`` (bool (count,)), of equals the youngest first."""
        rows = np.flatnonzero(candidates)
        order = np.lexsort((-self.born_key[rows], self.trust[rows]))
        return rows[order[:number]]


class PlacedTable(Table):
    """Rows keep their place; ``active`` marks those in use."""

    @property
    def count(self) -> int:
        """Rows in use."""
        return int(np.count_nonzero(self.active))


class CircleTable(PlacedTable):
    """``CIRCLE_COLUMNS``: C_n or C_r."""

    def __init__(self, capacity: int) -> None:
        super().__init__(CIRCLE_COLUMNS, capacity)
        self.columns = CircleColumns(self.memory())


class ObjectTable(PlacedTable):
    """``OBJECT_COLUMNS``."""

    def __init__(self, capacity: int) -> None:
        super().__init__(OBJECT_COLUMNS, capacity)
        self.columns = ObjectColumns(self.memory())


class PsiTable(PlacedTable):
    """``PSI_COLUMNS``."""

    def __init__(self, capacity: int) -> None:
        super().__init__(PSI_COLUMNS, capacity)
        self.columns = PsiColumns(self.memory())


class GroupTable(Table):
    """``GROUP_COLUMNS``."""

    def __init__(self, capacity: int) -> None:
        super().__init__(GROUP_COLUMNS, capacity)
        self.columns = GroupColumns(self.memory())

    @property
    def count(self) -> int:
        """Rows in use."""
        return int(self.columns.count)

    def assign(self, x: Floats, y: Floats) -> npt.NDArray[np.int32]:
        """Group that contains each point (eq. 1), -1: none; for drawing. ``x``, ``y``: (n,) px."""
        places = zip(x.tolist(), y.tolist(), strict=True)
        return np.array([group_at(self.columns, *place) for place in places], np.int32)


class CornerTable(Table):
    """``CORNER_COLUMNS``."""

    def __init__(self, capacity: int) -> None:
        super().__init__(CORNER_COLUMNS, capacity)
        self.columns = CornerColumns(self.memory())
