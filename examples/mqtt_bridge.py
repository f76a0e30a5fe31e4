"""Passes what a rover sees on to an MQTT broker: ``python mqtt_bridge.py tcp/127.0.0.1:7447 broker.local``.

Needs ``pip install lcf-edge paho-mqtt``. Objects go to ``lcf/<robot>/objects`` as JSON, at most ``RATE_HZ`` times a
second and with what is unknown as null; each part's health goes to ``lcf/<robot>/health/<part>``, retained, so that who
comes later learns it too. ``lcf/<robot>/online`` is ``true`` while this program runs: the broker itself changes it.
A broker that is away is tried again, from the start on.
"""

import argparse
import json
import math
import sys
import time
from collections.abc import Iterator
from contextlib import closing

import paho.mqtt.client as mqtt
import zenoh

from lcf_edge.cdr import CdrError, DiagnosticArray, decode_diagnostics
from lcf_edge.client import ObjectClass, ObjectState, Scene, scenes
from lcf_edge.zenoh_link.session import opened_session
from lcf_edge.zenoh_link.subscription import reading_from

RATE_HZ = 5.0
MAX_PART = 64  # letters of a topic
FIELDS = ("ttc", "ttc_sigma", "range", "bearing", "lateral", "v_forward", "v_right", "probability")


def objects_message(scene: Scene) -> bytes:
    """JSON of the objects of a scene: s, m, rad, m/s; right is positive."""
    things = [
        {
            "id": int(thing["id"]),
            "class": ObjectClass(thing["class_id"]).name.lower(),
            "state": ObjectState(thing["state"]).name.lower(),
            **{name: _number(thing[name]) for name in FIELDS},
        }
        for thing in scene.objects
    ]
    payload = {"stamp_ns": scene.stamp_ns, "speed_mps": _number(scene.vehicle_speed), "objects": things}
    return json.dumps(payload, allow_nan=False).encode()


def health_messages(diagnostics: DiagnosticArray, robot: str) -> Iterator[tuple[str, bytes]]:
    """Topic and JSON of each part."""
    for status in diagnostics.status:
        payload = {"level": status.level.name.lower(), "message": status.message, "values": dict(status.values)}
        sane = (sign if sign.isprintable() and sign not in "/+#" else "_" for sign in status.name)  # for a topic
        part = "".join(sane)[:MAX_PART]
        yield f"lcf/{robot}/health/{part}", json.dumps(payload).encode()


def _number(value: float) -> float | None:
    return round(float(value), 3) if math.isfinite(value) else None


def bridge(endpoint: str, broker: str, port: int, robot: str) -> None:
    """Pass on until interrupted."""
    client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2, client_id=f"lcf-edge-{robot}")
    online = f"lcf/{robot}/online"
    client.will_set(online, b"false", retain=True)
    client.on_connect = lambda *_: client.publish(online, b"true", retain=True)
    away = f"{broker}:{port}: no broker there; trying again\n"
    client.on_connect_fail = lambda *_: sys.stderr.write(away)
    client.connect_async(broker, port)
    client.loop_start()

    def pass_on_health(sample: zenoh.Sample) -> None:
        try:
            diagnostics = decode_diagnostics(sample.payload.to_bytes())
        except CdrError:
            return  # none of the rover's
        for topic, payload in health_messages(diagnostics, robot):
            client.publish(topic, payload, retain=True)

    next_s = 0.0
    with opened_session(reading_from(endpoint)) as session, closing(scenes(endpoint)) as arriving:
        subscriber = session.declare_subscriber("lcf/diagnostics", pass_on_health)
        for scene in arriving:
            if time.monotonic() >= next_s:
                next_s = time.monotonic() + 1 / RATE_HZ
                client.publish(f"lcf/{robot}/objects", objects_message(scene))
        subscriber.undeclare()
    client.loop_stop()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("endpoint", help="of the rover: tcp/127.0.0.1:7447")
    parser.add_argument("broker", help="host of the MQTT broker")
    parser.add_argument("--port", type=int, default=1883)
    parser.add_argument("--robot", default="rover")
    arguments = parser.parse_args()
    bridge(arguments.endpoint, arguments.broker, arguments.port, arguments.robot)
