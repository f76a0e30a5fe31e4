"""Where the vehicle's own parts hide the world: `camera.mask`, polygons in px of the configured image size."""

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.config import Camera

MARGIN_PX = 4  # FAST looks 3 px around, and an edge is a pixel wide

Polygon = npt.NDArray[np.float32]
"""(n, 2) px."""


def polygons(camera: Camera, width: int, height: int) -> tuple[Polygon, ...]:
    """Return the polygons of ``camera.mask`` in a ``width`` × ``height`` px image; pixel centres at whole numbers."""
    scale = np.array((width / camera.width, height / camera.height))
    return tuple(((np.array(each) + 0.5) * scale - 0.5).astype(np.float32) for each in camera.mask)


def in_sight(camera: Camera, width: int, height: int) -> npt.NDArray[np.uint8] | None:
    """Return uint8 (height, width): 255 where the world is seen, 0 on and near own parts. None: no own parts."""
    if not camera.mask:
        return None
    visible = np.full((height, width), 255, np.uint8)
    outlines = [np.rint(each).astype(np.int32) for each in polygons(camera, width, height)]
    for outline in outlines:
        cv2.fillPoly(visible, [outline], (0,))  # one by one, so that overlaps are hidden too
    cv2.polylines(visible, outlines, True, (0,), 2 * MARGIN_PX + 1)
    return visible
