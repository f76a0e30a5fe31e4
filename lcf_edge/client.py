"""For planners: what a running lcf-edge sees, as NumPy records.

``for scene in lcf_edge.client.scenes("tcp/rover:7447"): …`` needs NumPy, msgspec and Zenoh, neither OpenCV nor a
driver. ``scene.objects``, ``scene.circles`` and ``scene.psi`` are read-only views of the payload.
"""

from lcf_edge.errors import PublishError
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, Cause, Kind, ObjectClass, ObjectState, Scene, Shape
from lcf_edge.zenoh_link.subscription import Scenes, scenes

__all__ = [
    "CIRCLE",
    "OBJECT",
    "PSI_REGION",
    "Cause",
    "Kind",
    "ObjectClass",
    "ObjectState",
    "PublishError",
    "Scene",
    "Scenes",
    "Shape",
    "scenes",
]
