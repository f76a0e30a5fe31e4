"""For planners: what a running lcf-edge sees, as NumPy records.

``for scene in lcf_edge.client.scenes("tcp/rover:7447"): …`` needs NumPy, msgspec and Zenoh, neither OpenCV nor a
driver. ``scene.circles`` and ``scene.psi`` look into the payload, without a copy; they are read-only.
"""

from lcf_edge.errors import PublishError
from lcf_edge.records import CIRCLE, PSI_REGION, Cause, Kind, Scene, Shape
from lcf_edge.zenoh_link.subscription import Scenes, scenes

__all__ = ["CIRCLE", "PSI_REGION", "Cause", "Kind", "PublishError", "Scene", "Scenes", "Shape", "scenes"]
