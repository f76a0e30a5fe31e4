"""The filter's tables as the records of a scene: the trusted rows, as far as the lens can place them.

Something about to be met may have its middle beside the image: it is shown at the border.
"""

import math
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from lcf_edge.filter.columns import CircleColumns, ObjectColumns, PsiColumns
from lcf_edge.filter.image_plane import ImagePlane, project
from lcf_edge.filter.memory import memory_of

Fields: TypeAlias = Any  # of records, [row, number of four bytes]: typed memory when compiled, else a memoryview

NAN = float("nan")
INF = float("inf")
REBEL = 1  # `messages.Kind`
MAX_SUPPORT = 65535
BEARING_SHARE = 0.25  # 1 sigma of an object's middle, as a share of its extent
X, Y = 2, 3  # fields of every record, after its id and its small numbers


class Records:
    """Room for records of one type of ``messages``, of which ``count`` are in use.

    ``words`` and ``floats`` are views of their four-byte fields as integers and as floats. ``owner``: the id of the
    object that each belongs to, 0: none.
    """

    def __init__(self, capacity: int, record: np.dtype[np.void]) -> None:
        self.count = 0
        self.record = record
        self.array = np.zeros((capacity, record.itemsize // 4), np.uint32)
        self.owners = np.zeros(capacity, np.uint32)
        self.words, self.floats = memory_of(self.array), memory_of(self.array.view(np.float32))
        self.owner = memory_of(self.owners)

    def written(self) -> npt.NDArray[np.void]:
        """Return the records in use."""
        return self.array[: self.count].copy().view(self.record)[:, 0]

    def written_owners(self) -> npt.NDArray[np.uint32]:
        """Return the owners of the records in use."""
        return self.owners[: self.count].copy()


def place(records: Records, plane: ImagePlane, x: float, y: float) -> bool:
    """Write where the next record is seen, px of the input frame. False: the lens cannot place it."""
    project(plane, x, y)
    if math.isnan(plane.u):
        return False
    records.floats[records.count, X] = min(max(plane.u, 0.0), plane.width - 1.0)
    records.floats[records.count, Y] = min(max(plane.v, 0.0), plane.height - 1.0)
    return True


def right_of_axis(plane: ImagePlane, x: float) -> float:
    """x/z of a place of the ideal pinhole."""
    return (x - plane.cx) / plane.fx


def elevation(plane: ImagePlane, right: float, y: float) -> float:
    """Angle over the plane of the camera's x and z, rad, up positive."""
    return math.atan2(-(y - plane.cy) / plane.fy, math.sqrt(1 + right * right))


def add_circles(
    records: Records, table: CircleColumns, objects: ObjectColumns, kind: int, plane: ImagePlane, min_trust: float
) -> None:
    """Add circles with at least that trust, as ``messages.CIRCLE``."""
    for i in range(table.capacity):
        if not table.active[i] or table.trust[i] < min_trust or not place(records, plane, table.x[i], table.y[i]):
            continue
        n, floats = records.count, records.floats
        right = right_of_axis(plane, table.x[i])
        support = min(table.support[i], MAX_SUPPORT)
        records.words[n, 0] = table.id[i]
        records.words[n, 1] = kind | table.cause[i] << 8 | support << 16
        floats[n, 4], floats[n, 5], floats[n, 6] = table.radius[i], table.beta[i], table.speed[i]
        floats[n, 7] = table.trust[i]
        floats[n, 9], floats[n, 10] = math.atan(right), elevation(plane, right, table.y[i])
        if kind == REBEL:
            floats[n, 8], floats[n, 11], floats[n, 12] = table.ttc[i], table.range[i], table.lateral[i]
        else:
            floats[n, 8], floats[n, 11], floats[n, 12] = INF, NAN, NAN
        square = table.square[i]
        owned = kind == REBEL and square >= 0 and objects.active[square] and objects.trust[square] >= min_trust
        records.owner[n] = objects.id[square] if owned else 0
        records.count += 1


def add_objects(records: Records, table: ObjectColumns, plane: ImagePlane, min_trust: float) -> None:
    """Add objects with at least that trust, as ``messages.OBJECT``."""
    for i in range(table.capacity):
        if not table.active[i] or table.trust[i] < min_trust or not place(records, plane, table.x[i], table.y[i]):
            continue
        n, floats = records.count, records.floats
        right = right_of_axis(plane, table.x[i])
        support = min(table.support[i], MAX_SUPPORT)
        records.words[n, 0] = table.id[i]
        records.words[n, 1] = table.class_id[i] | table.state[i] << 8 | support << 16
        floats[n, 4], floats[n, 5] = table.width[i], table.height[i]
        floats[n, 6], floats[n, 7] = table.ttc[i], table.ttc_sigma[i]
        # the same extent is a smaller angle the farther from the axis
        slant, down = 1 + right * right, (table.y[i] - plane.cy) / plane.fy
        floats[n, 8], floats[n, 9] = math.atan(right), BEARING_SHARE * table.width[i] / plane.fx / slant
        floats[n, 10] = elevation(plane, right, table.y[i])
        floats[n, 11] = BEARING_SHARE * table.height[i] / plane.fy * math.sqrt(slant) / (slant + down * down)
        floats[n, 12], floats[n, 13] = table.range[i], table.range_sigma[i]
        floats[n, 14], floats[n, 15] = table.lateral[i], table.lateral_sigma[i]
        floats[n, 16], floats[n, 17] = table.forward[i], table.forward_sigma[i]
        floats[n, 18], floats[n, 19] = table.right[i], table.right_sigma[i]
        floats[n, 20], floats[n, 21] = table.closest[i], table.closest_sigma[i]
        floats[n, 22], floats[n, 23] = table.probability[i], table.trust[i]
        floats[n, 24], floats[n, 25] = table.age_s[i], table.unseen_s[i]
        records.count += 1


def add_psi(records: Records, table: PsiColumns, plane: ImagePlane) -> None:
    """Add ψ regions, as ``messages.PSI_REGION``."""
    for i in range(table.capacity):
        if not table.active[i] or not place(records, plane, table.x[i], table.y[i]):
            continue
        n, floats = records.count, records.floats
        records.words[n, 0], records.words[n, 1] = table.id[i], table.shape[i]
        floats[n, 4], floats[n, 5], floats[n, 6] = table.width[i], table.height[i], table.trust[i]
        records.count += 1
