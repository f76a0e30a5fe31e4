"""What recordings are tested with: messages of all kinds, and readers that know nothing of this program."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader
from rosbags.highlevel import AnyReader

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.config import Config
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, Scene
from lcf_edge.recording.write.messages import Encoder, FrameAndScene, RecordedMessage, Statuses

STEP_NS = 50_000_000


@dataclass(frozen=True)
class Read:
    """A message as an independent reader found it."""

    topic: str
    log_time_ns: int
    kind: str
    message: Any


def scene(stamp_ns: int, seq: int, circles: int = 3) -> Scene:
    """Numbers that differ."""
    rows = np.zeros(circles, CIRCLE)
    rows["id"], rows["x"], rows["ttc"] = np.arange(circles), np.arange(circles) + 0.5, np.inf
    return Scene(stamp_ns, seq, 32, 24, 1.5, rows, np.zeros(1, PSI_REGION), objects=np.ones(2, OBJECT))


def recorded(count: int, start_ns: int = 10**9, encoder: Encoder | None = None) -> Iterator[RecordedMessage]:
    """``count`` images of 32×24 with all that comes with them."""
    encoder = encoder or Encoder(Config(), lambda *_: None)
    for seq in range(count):
        stamp_ns = start_ns + seq * STEP_NS
        image = np.full((24, 32), 10 * seq % 256, np.uint8)
        yield from encoder.encode(ImuSample(stamp_ns, (0.1, 0.2, 0.3), (0.0, -9.81, 0.0)))
        yield from encoder.encode(SpeedSample(stamp_ns, 1.5, float("nan")))
        yield from encoder.encode(FrameAndScene(Frame(stamp_ns, seq, image), scene(stamp_ns, seq)))
    statuses = [DeviceStatus("camera", Level.OK, "delivers", {"rate_hz": "20"})]
    yield from encoder.encode(Statuses(start_ns + count * STEP_NS, statuses))


@pytest.fixture(name="recorded", scope="session")
def recorded_fixture() -> Any:
    return recorded


def by_rosbags(path: Path) -> list[Read]:
    """All messages, with the types that the file itself defines."""
    with AnyReader([path]) as reader:
        return [
            Read(connection.topic, stamp_ns, connection.msgtype, reader.deserialize(raw, connection.msgtype))
            for connection, stamp_ns, raw in reader.messages()
        ]


@pytest.fixture(name="by_rosbags", scope="session")
def by_rosbags_fixture() -> Any:
    return by_rosbags


def by_mcap(path: Path) -> list[tuple[str, int]]:
    """Topic and time of all messages, in the order of the file, up to the first damage."""
    found = []
    with path.open("rb") as file:
        try:
            for _, channel, message in NonSeekingReader(file).iter_messages(log_time_order=False):
                found.append((channel.topic, message.log_time))  # what was found stays
        except (McapError, struct.error):
            pass
    return found


@pytest.fixture(name="by_mcap", scope="session")
def by_mcap_fixture() -> Any:
    return by_mcap
