"""The layout for Foxglove shows topics that there are, and fields that they have."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lcf_edge.recording.write.messages import SCENE, TOPICS
from lcf_edge.recording.write.schemas import schema
from lcf_edge.zenoh_link.preview import PREVIEW

LAYOUT = json.loads((Path(__file__).parents[2] / "examples/foxglove_layout.json").read_text(encoding="utf-8"))
PANELS: dict[str, dict[str, Any]] = LAYOUT["configById"]
KNOWN = {topic.path("lcf"): topic.message for topic in TOPICS} | {f"/{PREVIEW.key('lcf')}": PREVIEW.message}


def leaves(tree: Any) -> list[str]:
    """Panels of a layout."""
    return [tree] if isinstance(tree, str) else [*leaves(tree["first"]), *leaves(tree["second"])]


def test_every_panel_has_a_place_and_every_place_a_panel() -> None:
    shown = leaves(LAYOUT["layout"])
    for panel in list(shown):
        shown += [name for tab in PANELS[panel].get("tabs", []) for name in leaves(tab["layout"])]
    assert sorted(shown) == sorted(PANELS)


def test_every_topic_is_one_that_is_recorded_or_published() -> None:
    named = set(re.findall(r'"(/lcf/[a-z0-9_/]+)', json.dumps(LAYOUT)))
    assert named <= set(KNOWN)
    assert {"/lcf/annotations", "/lcf/markers", "/lcf/diagnostics", "/lcf/scene"} <= named


def test_a_picture_waits_for_nothing_else() -> None:
    """A lens may be unknown, and programs that pair by the stamps of annotations have none where nothing is found."""
    images = [panel["imageMode"] for name, panel in PANELS.items() if name.startswith("Image!")]
    assert [(each["imageTopic"], each["synchronize"], "calibrationTopic" in each) for each in images] == [
        ("/lcf/camera/image_raw/compressed", False, False),
        ("/lcf/preview/compressed", False, False),
    ]


@pytest.mark.parametrize("path", [one["value"] for panel in PANELS.values() for one in panel.get("paths", [])])
def test_every_plot_shows_a_field_that_there_is(path: str) -> None:
    ros = get_typestore(Stores.EMPTY)
    ros.register(get_types_from_msg(schema(SCENE.message).decode(), SCENE.message))
    topic, *names = path.split(".")
    kind = KNOWN[topic]
    for name in names:
        fields = dict(ros.get_msgdef(kind).fields)
        _, value = fields[name.removesuffix("[:]")]
        kind = value[0][1] if isinstance(value, tuple) and isinstance(value[0], tuple) else value
    assert kind
