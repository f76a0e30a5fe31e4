"""``examples/mqtt_bridge.py`` brings objects and health to a client of a real broker."""

import json
import queue
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np
import paho.mqtt.client as mqtt
import pytest

from lcf_edge.cdr import DiagnosticArray, Header
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, Scene

PATIENCE_S = 30.0
BRIDGE = Path(__file__).parents[3] / "examples/mqtt_bridge.py"


@pytest.fixture
def bridge() -> Any:
    """The example as a module."""
    spec = spec_from_file_location("mqtt_bridge", BRIDGE)
    assert spec
    assert spec.loader
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_an_object_of_no_known_class_is_reported_as_unknown(bridge: Any) -> None:
    things = np.zeros(1, OBJECT)
    things["class_id"], things["state"] = 250, 77
    empty = np.zeros(0, CIRCLE), np.zeros(0, PSI_REGION)
    (told,) = json.loads(bridge.objects_message(Scene(1, 1, 64, 48, 1.0, *empty, things)))["objects"]
    assert (told["class"], told["state"]) == ("unknown", "coasting")


def test_whatever_a_part_is_called_it_makes_a_topic(bridge: Any) -> None:
    client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
    for name in ("a/b+c#", "nothing\0more\n\x1b[31m", "long" * 50_000):
        diagnostics = DiagnosticArray(Header(1, ""), "rover", (DeviceStatus(name, Level.OK, ""),))
        ((topic, payload),) = bridge.health_messages(diagnostics, "seven")
        assert topic.isprintable()
        client.publish(topic, payload)  # raises for one that is none


@pytest.fixture
def port(rover: Any) -> int:
    """Of the broker: the one after the rover's."""
    return int(rover.endpoint.rpartition(":")[2]) % 60000 + 1


@contextmanager
def broker_at(port: int) -> Iterator[None]:
    command = (sys.executable, str(Path(__file__).with_name("mqtt_broker.py")), str(port))
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout
        assert process.stdout.readline() == "listens\n"
        yield
        process.kill()


@contextmanager
def messages_at(port: int) -> Iterator[queue.Queue[tuple[str, Any]]]:
    """What a client receives that subscribes to all."""
    received: queue.Queue[tuple[str, Any]] = queue.Queue()
    client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
    client.on_connect = lambda *_: client.subscribe("lcf/#", qos=1)
    client.on_message = lambda _, __, message: received.put((message.topic, json.loads(message.payload)))
    client.connect("127.0.0.1", port)
    client.loop_start()
    yield received
    client.disconnect()
    client.loop_stop()


@pytest.fixture
def messages(port: int) -> Iterator[queue.Queue[tuple[str, Any]]]:
    with broker_at(port), messages_at(port) as received:
        yield received


def test_a_broker_that_comes_later_is_told_too(rover: Any, port: int) -> None:
    command = (sys.executable, str(BRIDGE), rover.endpoint, "127.0.0.1", "--port", str(port))
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as bridge:
        try:
            assert bridge.stderr
            assert bridge.stderr.readline() == f"127.0.0.1:{port}: no broker there; trying again\n"
            with broker_at(port), messages_at(port) as received:
                while received.get(timeout=PATIENCE_S) != ("lcf/rover/online", True):
                    pass
        finally:
            bridge.kill()


def test_objects_and_health_arrive_and_its_end_is_reported(
    rover: Any, port: int, messages: queue.Queue[tuple[str, Any]]
) -> None:
    command = (sys.executable, str(BRIDGE), rover.endpoint, "127.0.0.1", "--port", str(port), "--robot", "seven")
    found: dict[str, Any] = {}
    with subprocess.Popen(command) as bridge:
        wanted = {"lcf/seven/online", "lcf/seven/objects", "lcf/seven/health/camera", "lcf/seven/health/imu"}
        while not wanted <= set(found):
            topic, message = messages.get(timeout=PATIENCE_S)
            found[topic] = message
        bridge.kill()
    assert found["lcf/seven/online"] is True
    _, crossing, cutting_in = found["lcf/seven/objects"]["objects"]
    assert (crossing["class"], crossing["ttc"], crossing["probability"]) == ("crossing", 2.125, 0.97)
    assert (cutting_in["state"], cutting_in["ttc"], cutting_in["range"]) == ("hidden", None, None)
    assert found["lcf/seven/health/camera"]["values"]["rate_hz"] == "20.00"
    assert found["lcf/seven/health/imu"]["level"] == "error"
    while found["lcf/seven/online"]:
        topic, message = messages.get(timeout=PATIENCE_S)
        found[topic] = message
