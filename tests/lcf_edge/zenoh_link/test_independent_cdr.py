"""Another CDR library reads a scene, and writes it with the same bytes."""

import sys
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from lcf_edge.cdr import encode_scene
from lcf_edge.messages import CIRCLE, Cause, Kind, Shape
from tests.lcf_edge.zenoh_link.test_independent_ros import STAMP_NS, a_scene

if sys.version_info >= (3, 14):
    pytest.skip("pycdr2 does not find the annotations of Python 3.14", allow_module_level=True)

from pycdr2 import IdlStruct
from pycdr2.types import array, float32, int32, sequence, uint8, uint16, uint32, uint64


@dataclass
class Time(IdlStruct, typename="builtin_interfaces/msg/Time"):
    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class Header(IdlStruct, typename="std_msgs/msg/Header"):
    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass
class Circle(IdlStruct, typename="lcf_msgs/msg/Circle"):
    id: uint32 = 0
    kind: uint8 = 0
    cause: uint8 = 0
    support: uint16 = 0
    numbers: array[float32, 11] = field(default_factory=list)  # x to lateral


@dataclass
class PsiRegion(IdlStruct, typename="lcf_msgs/msg/PsiRegion"):
    id: uint32 = 0
    shape: uint8 = 0
    numbers: array[float32, 5] = field(default_factory=list)  # x to trust


@dataclass
class Thing(IdlStruct, typename="lcf_msgs/msg/Object"):
    id: uint32 = 0
    class_id: uint8 = 0
    state: uint8 = 0
    support: uint16 = 0
    numbers: array[float32, 24] = field(default_factory=list)  # x to unseen


@dataclass
class SceneMessage(IdlStruct, typename="lcf_msgs/msg/Scene"):
    header: Header = field(default_factory=Header)
    frame_seq: uint64 = 0
    image_width: uint32 = 0
    image_height: uint32 = 0
    vehicle_speed: float32 = 0.0
    circles: sequence[Circle] = field(default_factory=list)
    psi: sequence[PsiRegion] = field(default_factory=list)
    objects: sequence[Thing] = field(default_factory=list)


def test_another_cdr_library_reads_a_scene() -> None:
    scene = a_scene()
    message: Any = SceneMessage.deserialize(encode_scene(scene, "camera"))
    assert (message.header.stamp.sec, message.header.frame_id) == (STAMP_NS // 10**9, "camera")
    assert (message.frame_seq, message.image_width, message.image_height) == (17, 640, 480)
    (circle,) = message.circles
    assert (circle.id, circle.kind, circle.cause, circle.support) == (5, Kind.REBEL, Cause.CROSSING, 11)
    np.testing.assert_array_equal(circle.numbers, [scene.circles[0][name] for name in CIRCLE.names[4:]])
    (region,) = message.psi
    assert (region.id, region.shape) == (2, Shape.CIRCLE)
    np.testing.assert_array_equal(region.numbers, [90.0, 240.0, 120.0, 120.0, 5.0])
    (thing,) = message.objects
    assert (thing.id, thing.class_id, thing.state, thing.support) == (9, 5, 1, 21)
    np.testing.assert_array_equal(thing.numbers, scene.objects[0].tolist()[4:])


def test_it_writes_the_same_bytes() -> None:
    written = encode_scene(a_scene(), "camera")
    assert SceneMessage.deserialize(written).serialize() == written
