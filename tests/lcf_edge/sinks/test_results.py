"""A result line is the JSON object that planners rely on."""

import json
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from drivers.samples import Frame
from lcf_edge.cdr import decode_scene, encode_scene
from lcf_edge.messages import (
    CIRCLE,
    OBJECT,
    PSI_REGION,
    Cause,
    Kind,
    ObjectClass,
    ObjectState,
    PipelineScene,
    Shape,
    Sizes,
    Timing,
)
from lcf_edge.monitor.live.lines import scene_fields
from lcf_edge.sinks import SinkError
from lcf_edge.sinks.results import ResultsSink, encode_line


def put(sink: ResultsSink, scene: PipelineScene) -> None:
    """Without an image, which result lines do not need."""
    sink.put(Frame(scene.stamp_ns, scene.seq, np.empty((0, 0), np.uint8)), scene, lambda: pytest.fail("not looked at"))


def scene(circles: int = 1, psi: int = 2) -> PipelineScene:
    rows = np.zeros(circles, CIRCLE)
    rows["id"], rows["kind"], rows["cause"], rows["support"] = 5, Kind.REBEL, Cause.CROSSING, 11
    rows["x"], rows["y"], rows["radius"], rows["direction"], rows["speed"] = 312.5, 201, 24.1, 1.57, 63
    rows["trust"], rows["ttc"], rows["bearing"], rows["elevation"] = 4, 2.1, 0.01, -0.08
    rows["range"], rows["lateral"] = 3.2, 0.1
    regions = np.zeros(psi, PSI_REGION)
    regions["id"], regions["x"], regions["y"] = 2, 90, 240
    regions["width"], regions["height"] = 120, 80
    regions["shape"] = ([Shape.CIRCLE, Shape.RECTANGLE] * psi)[:psi]
    thing = np.zeros(1, OBJECT)
    thing["id"], thing["class_id"], thing["state"], thing["support"] = 3, ObjectClass.CROSSING, ObjectState.SEEN, 21
    for number, name in enumerate(OBJECT.names[4:]):
        thing[name] = number + 0.5
    return PipelineScene(
        stamp_ns=1700000000000000000,
        seq=17,
        image_width=640,
        image_height=480,
        vehicle_speed=1.49,
        circles=rows,
        psi=regions,
        sizes=Sizes(812, 240, 610, 31, 44, 12, 2, 13, 4, 0, 1),
        timing=Timing(310, 890, 1260),
        objects=thing,
        circle_objects=np.full(circles, 3, np.uint32),
    )


def test_a_line_has_the_published_fields() -> None:
    line = encode_line(scene())
    assert line.endswith(b"}\n")
    assert line.count(b"\n") == 1
    assert json.loads(line) == {
        "stamp_ns": 1700000000000000000,
        "seq": 17,
        "objects": [
            {
                "id": 3,
                "class": "crossing",
                "state": "seen",
                "support": 21,
                "x": 0.5,
                "y": 1.5,
                "w": 2.5,
                "h": 3.5,
                "ttc_s": 4.5,
                "ttc_sigma_s": 5.5,
                "bearing": 6.5,
                "bearing_sigma": 7.5,
                "elevation": 8.5,
                "elevation_sigma": 9.5,
                "range_m": 10.5,
                "range_sigma_m": 11.5,
                "lateral_m": 12.5,
                "lateral_sigma_m": 13.5,
                "v_forward_mps": 14.5,
                "v_forward_sigma_mps": 15.5,
                "v_right_mps": 16.5,
                "v_right_sigma_mps": 17.5,
                "closest_s": 18.5,
                "closest_sigma_s": 19.5,
                "probability": 20.5,
                "trust": 21.5,
                "age_s": 22.5,
                "unseen_s": 23.5,
                "circles": [5],
            }
        ],
        "circles": [
            {
                "id": 5,
                "kind": "rebel",
                "cause": "crossing",
                "x": 312.5,
                "y": 201.0,
                "r": 24.1,
                "direction": 1.57,
                "speed": 63.0,
                "trust": 4.0,
                "support": 11,
                "ttc_s": 2.1,
                "bearing": 0.01,
                "elevation": -0.08,
                "range_m": 3.2,
                "lateral_m": 0.1,
            }
        ],
        "psi": [
            {"id": 2, "shape": "circle", "x": 90.0, "y": 240.0, "r": 60.0},
            {"id": 2, "shape": "rect", "x": 90.0, "y": 240.0, "w": 120.0, "h": 80.0},
        ],
        "sizes": {
            "corners": 812,
            "omitted": 240,
            "edges_normal": 610,
            "edges_rebel": 31,
            "chains": 44,
            "circles_normal": 12,
            "circles_rebel": 2,
            "groups": 13,
            "psi": 4,
            "evicted": 0,
            "objects": 1,
        },
        "timing_us": {"detect": 310, "filter": 890, "total": 1260},
        "speed": 1.49,
        "notes": [],
    }


@pytest.mark.parametrize("unknown", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(
    ("field", "key"),
    [("ttc", "ttc_s"), ("bearing", "bearing"), ("range", "range_m"), ("lateral", "lateral_m")],
)
def test_an_unknown_number_is_null(unknown: float, field: str, key: str) -> None:
    with_unknown = scene()
    with_unknown.circles[field] = unknown
    assert json.loads(encode_line(with_unknown))["circles"][0][key] is None


@pytest.mark.parametrize("field", OBJECT.names[8:])
def test_an_unknown_number_of_an_object_is_null(field: str) -> None:
    with_unknown = scene()
    with_unknown.objects[field] = np.nan
    written = json.loads(encode_line(with_unknown))["objects"][0]
    assert [key for key, value in written.items() if value is None] == [
        key for key in written if key.removesuffix("_mps").removesuffix("_s").removesuffix("_m") == field
    ]


def test_every_class_and_state_has_its_name() -> None:
    for kind, name in enumerate(("unknown", "standing", "crossing", "oncoming", "leading", "cutting_in")):
        for state, condition in enumerate(("seen", "hidden", "coasting")):
            known = scene()
            known.objects["class_id"], known.objects["state"] = kind, state
            (written,) = json.loads(encode_line(known))["objects"]
            assert (written["class"], written["state"]) == (name, condition)


def test_an_object_names_its_circles_and_no_others() -> None:
    many = scene(circles=4)
    many.circles["id"] = 7, 8, 9, 10
    objects = np.concatenate([many.objects] * 3)
    objects["id"] = 3, 4, 5
    of_circles = np.array([4, 0, 3, 4], np.uint32)
    written = json.loads(encode_line(replace(many, objects=objects, circle_objects=of_circles)))["objects"]
    assert [thing["circles"] for thing in written] == [[9], [7, 10], []]


def test_the_circles_of_an_object_that_came_over_the_wire_are_not_reported() -> None:
    received = decode_scene(encode_scene(scene(), "camera"))
    (written,) = json.loads(msgspec.json.encode(scene_fields(received)))["objects"]
    (whole,) = json.loads(encode_line(scene()))["objects"]
    assert written == {key: value for key, value in whole.items() if key != "circles"}


def test_an_unknown_speed_is_null_and_notes_say_why() -> None:
    known = scene()
    parts = {
        name: getattr(known, name) for name in ("stamp_ns", "seq", "image_width", "image_height", "circles", "psi")
    }
    line = json.loads(encode_line(PipelineScene(**parts, vehicle_speed=np.nan, notes=("no imu", "no speed"))))
    assert line["speed"] is None
    assert line["notes"] == ["no imu", "no speed"]


def test_a_frame_without_a_circle_is_a_line_too() -> None:
    line = json.loads(encode_line(scene(circles=0, psi=0)))
    assert line["circles"] == []
    assert line["psi"] == []


def test_a_line_can_be_read_before_the_next_comes(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    with ResultsSink(str(path)) as sink:
        for count in (1, 2, 3):
            put(sink, scene(circles=200))
            lines = path.read_bytes().splitlines()
            assert [len(json.loads(line)["circles"]) for line in lines] == [200] * count


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(SinkError, match=r"nowhere/results\.jsonl: cannot be written \(No such file"):
        ResultsSink(str(tmp_path / "nowhere" / "results.jsonl"))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_one_error() -> None:
    with pytest.raises(SinkError, match="/dev/full: cannot be written"), ResultsSink("/dev/full") as sink:
        put(sink, scene())
