"""The records that leave the program: one NumPy type each, which is also the wire layout.

The types follow ``lcf_msgs/msg/Circle`` and ``lcf_msgs/msg/PsiRegion`` in little-endian CDR: every field is
aligned to its size, so a sequence of records is one block of memory.
"""

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
import numpy.typing as npt


class Kind(IntEnum):
    """What a circle summarises."""

    NORMAL = 0  # C_n: follows the flow
    REBEL = 1  # C_r: breaks it


class Cause(IntEnum):
    """Why a circle is a rebel."""

    NONE = 0
    CROSSING = 1  # drifts off its flow line
    INCOMING = 2  # on a collision bearing
    LEADING = 3  # moves towards the focus of expansion or keeps station


class ObjectClass(IntEnum):
    """An object's motion over ground. Other numbers, of newer or faulty senders, are ``UNKNOWN``."""

    UNKNOWN = 0
    STANDING = 1
    CROSSING = 2  # moves sideways
    ONCOMING = 3  # comes towards the vehicle
    LEADING = 4  # moves ahead of it
    CUTTING_IN = 5  # moves ahead of it, and sideways into its path

    @classmethod
    def _missing_(cls, value: object) -> "ObjectClass":  # noqa: ARG003
        return cls.UNKNOWN


class ObjectState(IntEnum):
    """Whether an object is seen in this frame. Other numbers are ``COASTING``, the least certain."""

    SEEN = 0
    HIDDEN = 1  # behind a nearer one
    COASTING = 2  # predicted, not seen

    @classmethod
    def _missing_(cls, value: object) -> "ObjectState":  # noqa: ARG003
        return cls.COASTING


class Shape(IntEnum):
    """Type of a ψ region (the paper's Ty; 0, none, is not published)."""

    CIRCLE = 1
    RECTANGLE = 2


CIRCLE = np.dtype(
    [
        ("id", "<u4"),
        ("kind", "u1"),  # Kind
        ("cause", "u1"),  # Cause
        ("support", "<u2"),  # edges behind it
        ("x", "<f4"),  # px of the input frame
        ("y", "<f4"),
        ("radius", "<f4"),  # px
        ("direction", "<f4"),  # rad, of the image motion
        ("speed", "<f4"),  # px/s
        ("trust", "<f4"),
        ("ttc", "<f4"),  # s, inf: none
        ("bearing", "<f4"),  # rad, right positive, NaN: unknown
        ("elevation", "<f4"),  # rad, up positive
        ("range", "<f4"),  # m, NaN: unknown
        ("lateral", "<f4"),  # m, miss to the side of the path, right positive, NaN: unknown
    ]
)
"""``lcf_msgs/msg/Circle``: 52 bytes."""

PSI_REGION = np.dtype(
    {
        "names": ["id", "shape", "x", "y", "width", "height", "trust"],
        "formats": ["<u4", "u1", "<f4", "<f4", "<f4", "<f4", "<f4"],
        "offsets": [0, 4, 8, 12, 16, 20, 24],
        "itemsize": 28,
    }
)
"""``lcf_msgs/msg/PsiRegion``: 28 bytes, 3 of them padding; x, y is the centre, a circle's width is 2r."""


OBJECT = np.dtype(
    [
        ("id", "<u4"),
        ("class_id", "u1"),  # ObjectClass
        ("state", "u1"),  # ObjectState
        ("support", "<u2"),  # edges behind it
        ("x", "<f4"),  # px of the input frame, the middle of its box
        ("y", "<f4"),
        ("width", "<f4"),  # px
        ("height", "<f4"),
        ("ttc", "<f4"),  # s to contact, inf: none; each number is followed by its sigma, NaN: unknown
        ("ttc_sigma", "<f4"),
        ("bearing", "<f4"),  # rad, right positive
        ("bearing_sigma", "<f4"),
        ("elevation", "<f4"),  # rad, up positive
        ("elevation_sigma", "<f4"),
        ("range", "<f4"),  # m
        ("range_sigma", "<f4"),
        ("lateral", "<f4"),  # m, miss to the side of the path, right positive
        ("lateral_sigma", "<f4"),
        ("v_forward", "<f4"),  # m/s over ground, in the vehicle's axes of this frame
        ("v_forward_sigma", "<f4"),
        ("v_right", "<f4"),  # m/s
        ("v_right_sigma", "<f4"),
        ("closest", "<f4"),  # s until it is passed, NaN: never
        ("closest_sigma", "<f4"),
        ("probability", "<f4"),  # that it is met within the horizon
        ("trust", "<f4"),
        ("age", "<f4"),  # s since it was first seen
        ("unseen", "<f4"),  # s since it was last seen
    ]
)
"""``lcf_msgs/msg/Object``: 104 bytes. A square S of the third layer (Line-Circle-Square)."""


@dataclass(frozen=True, slots=True)
class Sizes:
    """Rows in use of each table after one step, and rows evicted in it because a table was full."""

    corners: int = 0
    omitted: int = 0
    edges_normal: int = 0
    edges_rebel: int = 0
    chains: int = 0
    circles_normal: int = 0
    circles_rebel: int = 0
    groups: int = 0
    psi: int = 0
    evicted: int = 0
    objects: int = 0


@dataclass(frozen=True, slots=True)
class Timing:
    """Processing times of one frame, µs."""

    detect: int = 0
    filter: int = 0
    total: int = 0


@dataclass(frozen=True, slots=True)
class Scene:
    """Objects, circles and ψ regions of one frame together, as they are sent."""

    stamp_ns: int
    seq: int
    image_width: int
    image_height: int
    vehicle_speed: float  # m/s, NaN: unknown
    circles: npt.NDArray[np.void]  # CIRCLE
    psi: npt.NDArray[np.void]  # PSI_REGION
    objects: npt.NDArray[np.void] = field(default_factory=lambda: np.empty(0, OBJECT))


@dataclass(frozen=True, slots=True)
class PipelineScene(Scene):
    """A scene with what only the pipeline knows.

    ``circle_objects``: uint32 (circles,), the id of the object that a circle belongs to, 0: none.
    """

    sizes: Sizes = field(default_factory=Sizes)
    timing: Timing = field(default_factory=Timing)
    notes: tuple[str, ...] = ()  # what degrades the result: "no imu", "no speed", "no corners", …
    circle_objects: npt.NDArray[np.uint32] = field(default_factory=lambda: np.empty(0, np.uint32))


@dataclass(frozen=True, slots=True)
class View:
    """What an overlay draws of one step; positions in px of the input frame, float32."""

    corners: npt.NDArray[np.float32]  # (n, 2) all corners of the frame
    omitted: npt.NDArray[np.bool_]  # (n,) inside ψ
    edges: npt.NDArray[np.float32]  # (m, 2) estimated normal edges, E_n
    rebels: npt.NDArray[np.float32]  # (k, 2) estimated rebel edges, E_r
    groups: npt.NDArray[np.float32]  # (g, 3) λ: x, y, BS
    edge_group: npt.NDArray[np.intp]  # (m,) row of `groups` that an edge belongs to, -1: none
    focus: npt.NDArray[np.float32]  # (2,) focus of expansion, O
    own_parts: tuple[npt.NDArray[np.float32], ...] = ()  # polygons (n, 2): ignored
