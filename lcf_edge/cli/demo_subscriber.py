"""The demo's second process: subscribes to scenes and counts them.

``python -m lcf_edge.cli.demo_subscriber ENDPOINT KEY``; a line on standard input says how many scenes
were sent, then one JSON line with a ``Received`` goes to standard output.
"""

import os
import sys
import threading
from contextlib import suppress

import msgspec
import zenoh

from lcf_edge.cdr import CdrError, decode_scene
from lcf_edge.config import Zenoh
from lcf_edge.zenoh_link import SCENE_ENCODING, opened_session

_LAST_ON_THE_WAY_S = 3.0


class Received(msgspec.Struct):
    """What a subscriber received."""

    scenes: int = 0
    bytes: int = 0
    broken: int = 0  # not decodable, or not encoded as a scene
    objects: int = 0
    circles: int = 0


def receive(endpoint: str, key: str) -> Received:
    """Subscribe, read from standard input how many scenes were sent, wait a little for the last of them."""
    received = Received()
    arrived = threading.Condition()

    def take(sample: zenoh.Sample) -> None:
        payload = sample.payload.to_bytes()
        try:
            scene = decode_scene(payload)
            objects, circles = len(scene.objects), len(scene.circles)
            broken = str(sample.encoding) != SCENE_ENCODING
        except CdrError:
            objects, circles, broken = 0, 0, True
        with arrived:
            received.scenes += 1
            received.bytes += len(payload)
            received.broken += broken
            received.objects += objects
            received.circles += circles
            arrived.notify()

    with opened_session(Zenoh(connect=[endpoint], listen=[])) as session:
        session.declare_subscriber(key, take)
        sent = int(sys.stdin.readline() or 0)
        with arrived:
            arrived.wait_for(lambda: received.scenes >= sent, _LAST_ON_THE_WAY_S)
    return received


if __name__ == "__main__":
    report = msgspec.json.encode(receive(*sys.argv[1:])) + b"\n"
    with suppress(BrokenPipeError):  # the demo has ended before
        os.write(sys.stdout.fileno(), report)
