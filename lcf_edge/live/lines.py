"""A scene that came over Zenoh as JSON, under the names of the result lines."""

from typing import Any

import msgspec

from lcf_edge.records import Scene
from lcf_edge.sinks.results import encode_line

_NOT_SENT = ("sizes", "timing_us", "notes")


def scene_fields(scene: Scene) -> dict[str, Any]:
    """What a result line has, without what is not sent, and with the size of the picture."""
    fields: dict[str, Any] = msgspec.json.decode(encode_line(scene))
    for name in _NOT_SENT:
        del fields[name]
    return {**fields, "image_width": scene.image_width, "image_height": scene.image_height}
