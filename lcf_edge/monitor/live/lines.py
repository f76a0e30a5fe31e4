"""A scene that came over Zenoh, under the names of the result lines."""

from typing import Any

from lcf_edge.messages import Scene
from lcf_edge.sinks.results import sent_fields


def scene_fields(scene: Scene) -> dict[str, Any]:
    """Return the fields of a result line that are sent, and the size of the image."""
    return {**sent_fields(scene), "image_width": scene.image_width, "image_height": scene.image_height}
