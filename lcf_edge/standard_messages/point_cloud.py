"""``sensor_msgs/msg/PointCloud2``: objects with probable contact, as a source for Nav2's obstacle layer.

The points of an object lie across its box, so close that no cell of a costmap between them stays empty. Behind them,
``CLEAR_M`` ahead, is a row of points over the whole width of the image, level with the camera: an obstacle layer marks
nothing that far, but clears the space up to them, so that objects that are gone leave the map.
"""

import numpy as np
import numpy.typing as npt

from lcf_edge.cdr import Writer
from lcf_edge.messages import Scene
from lcf_edge.standard_messages.labels import PROBABLY
from lcf_edge.standard_messages.positions import Setup, placed, positions, sizes

MESSAGE = "sensor_msgs/msg/PointCloud2"

SPACING_M = 0.05  # cells of Nav2's costmaps
MAX_COLUMNS = 64  # of points, on one object
CLEAR_M = 30.0
CLEARING_RAYS = 121

POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("probability", "<f4")])
"""m in the optical frame; probability that the object is met, 0: a point that only clears."""

_ROWS = np.array((-0.5, 0.0, 0.5))  # heights within the box, in its height
_FLOAT32 = 7


def encode_point_cloud(scene: Scene, setup: Setup) -> bytes:
    """Encode the points in the camera's optical frame. Raises ``CdrError``."""
    points = cloud(scene, setup)
    writer = Writer()
    writer.header(scene.stamp_ns, setup.frame_id)
    writer.scalars("II", 1, len(points))  # not organised: one row
    names = POINT.names or ()
    writer.scalars("I", len(names))
    for number, name in enumerate(names):
        writer.string(name)
        writer.scalars("I", 4 * number)
        writer.scalars("B", _FLOAT32)
        writer.scalars("I", 1)
    writer.scalars("?", False)  # big-endian
    writer.scalars("II", POINT.itemsize, points.nbytes)
    writer.octets(points.tobytes())
    writer.scalars("?", True)  # dense: no point is NaN
    return writer.payload()


def cloud(scene: Scene, setup: Setup) -> npt.NDArray[np.void]:
    """Return the points, as ``POINT``."""
    met = placed(scene.objects[scene.objects["probability"] >= PROBABLY])
    parts = [_clearing(setup)]
    for thing, middle, size in zip(met, positions(met), sizes(met, setup.lens), strict=True):
        columns = int(np.clip(np.ceil(size[0] / SPACING_M) + 1, 2, MAX_COLUMNS))
        across, down = np.meshgrid(np.linspace(-0.5, 0.5, columns) * size[0], _ROWS * size[1])
        points = np.empty(across.size, POINT)
        points["x"], points["y"] = middle[0] + across.ravel(), middle[1] + down.ravel()
        points["z"], points["probability"] = middle[2], thing["probability"]
        parts.append(points)
    points = np.concatenate(parts)
    return np.asarray(points[np.isfinite(points["x"]) & np.isfinite(points["y"])])


def _clearing(setup: Setup) -> npt.NDArray[np.void]:
    """A level row of points at ``CLEAR_M``."""
    lens = setup.lens
    points = np.zeros(CLEARING_RAYS, POINT)
    points["x"] = CLEAR_M * (np.linspace(0, lens.width - 1, CLEARING_RAYS) - lens.cx) / lens.fx
    points["y"] = CLEAR_M * np.tan(setup.pitch_rad)  # the camera looks up by that: level is below its axis
    points["z"] = CLEAR_M
    return points
