"""The configurations for Nav2 and RViz name what the daemon publishes, and fit what is in it."""

from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from lcf_edge.standard_messages.point_cloud import CLEAR_M, POINT
from lcf_edge.zenoh_link.preview import PREVIEW
from lcf_edge.zenoh_link.topics import MARKERS, NAV2_SPEED_LIMIT, POINTS

FOLDER = Path(__file__).parents[2] / "ros2"


def read(name: str) -> Any:
    return YAML(typ="safe").load(FOLDER / name)


@pytest.fixture(scope="module")
def nav2() -> Any:
    return read("nav2/lcf_edge.yaml")


def test_the_obstacle_layer_takes_the_points(nav2: Any) -> None:
    costmap = nav2["local_costmap"]["local_costmap"]["ros__parameters"]
    assert costmap["plugins"].index("lcf_layer") < costmap["plugins"].index("inflation_layer")
    layer = costmap["lcf_layer"]
    source = layer[layer["observation_sources"]]
    assert (source["topic"], source["data_type"]) == (f"/{POINTS.key('lcf')}", POINTS.message.rpartition("/")[2])


def test_the_far_points_clear_and_mark_nothing(nav2: Any) -> None:
    source = nav2["local_costmap"]["local_costmap"]["ros__parameters"]["lcf_layer"]["lcf"]
    assert source["marking"]
    assert source["clearing"]
    assert source["obstacle_max_range"] <= source["raytrace_max_range"] < CLEAR_M
    assert source["observation_persistence"] == 0.0


def test_the_controller_obeys_the_speed_limit(nav2: Any) -> None:
    assert nav2["controller_server"]["ros__parameters"]["speed_limit_topic"] == f"/{NAV2_SPEED_LIMIT.key('lcf')}"


def test_rviz_shows_what_is_published() -> None:
    displays = read("rviz/lcf_edge.rviz")["Visualization Manager"]["Displays"]
    shown = {display["Class"].rpartition("/")[2]: display for display in displays}
    assert shown["MarkerArray"]["Topic"]["Value"] == f"/{MARKERS.key('lcf')}"
    cloud = shown["PointCloud2"]
    assert cloud["Topic"]["Value"] == f"/{POINTS.key('lcf')}"
    assert cloud["Channel Name"] in POINT.names
    # the last part of the name tells RViz that the images are compressed; without it, it waits for raw ones
    assert shown["Image"]["Topic"]["Value"] == f"/{PREVIEW.key('lcf')}"
    assert all(one["Topic"]["Reliability Policy"] == "Best Effort" for one in displays if "Topic" in one)
