"""A result line is the JSON object that planners rely on."""

import json
from pathlib import Path

import numpy as np
import pytest

from lcf_edge.records import CIRCLE, PSI_REGION, Cause, Kind, Scene, Shape, Sizes, Timing
from lcf_edge.sinks import SinkError
from lcf_edge.sinks.results import ResultsSink, encode_line


def scene(circles: int = 1, psi: int = 2) -> Scene:
    rows = np.zeros(circles, CIRCLE)
    rows["id"], rows["kind"], rows["cause"], rows["support"] = 5, Kind.REBEL, Cause.CROSSING, 11
    rows["x"], rows["y"], rows["radius"], rows["direction"], rows["speed"] = 312.5, 201, 24.1, 1.57, 63
    rows["trust"], rows["ttc"], rows["bearing"], rows["elevation"] = 4, 2.1, 0.01, -0.08
    rows["range"], rows["lateral"] = 3.2, 0.1
    regions = np.zeros(psi, PSI_REGION)
    regions["id"], regions["x"], regions["y"] = 2, 90, 240
    regions["width"], regions["height"] = 120, 80
    regions["shape"] = ([Shape.CIRCLE, Shape.RECTANGLE] * psi)[:psi]
    return Scene(
        stamp_ns=1700000000000000000,
        seq=17,
        image_width=640,
        image_height=480,
        vehicle_speed=1.49,
        circles=rows,
        psi=regions,
        sizes=Sizes(812, 240, 610, 31, 44, 12, 2, 13, 4, 0),
        timing=Timing(310, 890, 1260),
    )


def test_a_line_has_the_published_fields() -> None:
    line = encode_line(scene())
    assert line.endswith(b"}\n")
    assert line.count(b"\n") == 1
    assert json.loads(line) == {
        "stamp_ns": 1700000000000000000,
        "seq": 17,
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


def test_an_unknown_speed_is_null_and_notes_tell_why() -> None:
    known = scene()
    parts = {
        name: getattr(known, name) for name in ("stamp_ns", "seq", "image_width", "image_height", "circles", "psi")
    }
    line = json.loads(encode_line(Scene(**parts, vehicle_speed=np.nan, notes=("no imu", "no speed"))))
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
            sink.write(scene(circles=200))
            lines = path.read_bytes().splitlines()
            assert [len(json.loads(line)["circles"]) for line in lines] == [200] * count


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(SinkError, match=r"nowhere/results\.jsonl: cannot be written \(No such file"):
        ResultsSink(str(tmp_path / "nowhere" / "results.jsonl"))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_one_error() -> None:
    with pytest.raises(SinkError, match="/dev/full: cannot be written"), ResultsSink("/dev/full") as sink:
        sink.write(scene())
