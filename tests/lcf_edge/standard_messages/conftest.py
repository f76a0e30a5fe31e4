"""A scene with one object of each kind, and what another implementation of ROS 2 reads of its messages."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from rosbags.typesys.store import Typestore

from lcf_edge.lens import Lens
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, Cause, Kind, ObjectClass, ObjectState, Scene, Shape
from lcf_edge.standard_messages.positions import Setup

STAMP_NS = 1_700_000_000_123_456_789


@pytest.fixture(scope="session")
def setup() -> Setup:
    lens = Lens(640, 480, 500.0, 500.0, 319.5, 239.5)
    return Setup(lens, "front_optical", "base_link", 0.5, -0.25, 0.75, pitch_rad=0.1, yaw_rad=-0.2, horizon_s=4.0)


@pytest.fixture(scope="session")
def scene() -> Callable[..., Scene]:
    """Of objects given by their fields; what is not given is not known."""

    def make(*objects: dict[str, float], vehicle_speed: float = 2.0) -> Scene:
        circles = np.zeros(3, CIRCLE)
        circles["kind"], circles["cause"] = (Kind.NORMAL, Kind.REBEL, Kind.REBEL), (0, Cause.INCOMING, Cause.CROSSING)
        circles["x"], circles["y"], circles["radius"] = (100.0, 300.0, 50.0), (50.0, 200.0, 400.0), (10.0, 20.0, 30.0)
        circles["ttc"] = np.inf, 1.25, np.inf
        psi = np.zeros(2, PSI_REGION)
        psi["shape"] = Shape.CIRCLE, Shape.RECTANGLE
        psi["x"], psi["y"], psi["width"], psi["height"] = (500.0, 600.0), (300.0, 400.0), (80.0, 20.0), (80.0, 40.0)
        rows = np.full(len(objects), np.nan, np.float32)[:, None].repeat(len(OBJECT.names) - 4, axis=1)
        table = np.zeros(len(objects), OBJECT)
        for name, column in zip(OBJECT.names[4:], rows.T, strict=True):
            table[name] = column
        table["trust"], table["probability"] = 4.0, 0.0
        for row, fields in zip(table, objects, strict=True):
            for name, value in fields.items():
                row[name] = value
        return Scene(STAMP_NS, 7, 640, 480, vehicle_speed, circles, psi, objects=table)

    return make


@pytest.fixture(scope="session")
def walker() -> dict[str, float]:
    """2 m wide and 1 m high, 4 m ahead, 1 m to the right and 0.5 m below the optical axis; will be met."""
    right, down = 0.25, 0.125
    return {
        "id": 9,
        "class_id": ObjectClass.CROSSING,
        "state": ObjectState.SEEN,
        "x": 300.0,
        "y": 210.0,
        "width": 250.0,
        "height": 125.0,
        "ttc": 2.0,
        "ttc_sigma": 0.25,
        "range": 4.0,
        "range_sigma": 0.5,
        "bearing": float(np.arctan(right)),
        "bearing_sigma": 0.01,
        "elevation": float(-np.arctan(down / np.hypot(1.0, right))),
        "elevation_sigma": 0.01,
        "v_forward": 0.0,
        "v_right": -1.0,
        "probability": 0.9,
    }


@pytest.fixture(scope="session")
def read(ros: Typestore) -> Callable[[bytes, str], Any]:
    """By its definition, to the last byte."""

    def decode(payload: bytes, message: str) -> Any:
        decoded = ros.deserialize_cdr(payload, message)
        assert bytes(ros.serialize_cdr(decoded, message)) == payload
        return decoded

    return decode
