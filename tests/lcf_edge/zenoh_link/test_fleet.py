"""Rovers behind one router are seen together and distinguished, as docs/fleet.md says."""

import re
import tomllib
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import zenoh

from lcf_edge import client
from lcf_edge.cdr import encode_scene
from lcf_edge.config import Config, Publish, Zenoh
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, Scene
from lcf_edge.zenoh_link import open_session
from lcf_edge.zenoh_link.link import Link

DOCUMENT = (Path(__file__).parents[3] / "docs/fleet.md").read_text(encoding="utf-8")
WRITTEN = tomllib.loads("".join(re.findall(r"^```toml\n(.*?)^```$", DOCUMENT, re.M | re.S)))
ROVERS = ("rover_1", "rover_3")
PATIENCE_S = 20.0


def configuration(rover: str, endpoint: str) -> Config:
    """The documented one, without TLS."""
    written = {
        table: {
            key: str(value).replace("rover_3", rover) if isinstance(value, str) else value for key, value in it.items()
        }
        for table, it in WRITTEN.items()
    }
    publish, options = msgspec.convert(written["publish"], Publish), msgspec.convert(written["zenoh"], Zenoh)
    return Config(
        publish=publish, zenoh=msgspec.structs.replace(options, connect=[endpoint], listen=[], config_file="")
    )


@pytest.fixture
def router(start: Callable[..., Any], endpoint: str) -> Any:
    router = start(mode="router", listen__endpoints=[endpoint])
    router.subscribe("nothing")
    return router


@pytest.fixture
def links(router: Any, endpoint: str) -> Iterator[dict[str, tuple[zenoh.Session, Link]]]:
    assert router
    with ExitStack() as stack:
        rovers = {}
        for rover in ROVERS:
            config = configuration(rover, endpoint)
            session = open_session(config.zenoh)
            link = Link(session, config)
            stack.callback(link.close)
            rovers[rover] = session, link
        yield rovers


def test_one_subscription_sees_all_rovers_by_their_keys(
    links: dict[str, tuple[zenoh.Session, Link]],
    endpoint: str,
    until_matched: Callable[[zenoh.Session, str], None],
    scene: Callable[..., Scene],
) -> None:
    arriving = client.scenes(endpoint, "*/lcf/scene")
    for number, (rover, (session, link)) in enumerate(links.items()):
        until_matched(session, f"{rover}/lcf/scene")
        link.put_scene(scene(seq=number))
    received = {}
    for _ in ROVERS:
        number = next(arriving).seq
        received[arriving.key] = number
    assert received == {f"{rover}/lcf/scene": number for number, rover in enumerate(ROVERS)}
    arriving.close()


def test_each_shows_that_it_is_there(links: dict[str, tuple[zenoh.Session, Link]], router: Any) -> None:
    wanted = [f"{rover}/lcf/@alive/{rover}" for rover in ROVERS]
    assert links
    while router.tokens("*/lcf/@alive/*") != wanted:
        pass  # each question waits for its answers


def test_a_rover_starts_without_the_router(endpoint: str) -> None:
    config = configuration("rover_1", endpoint)
    link = Link(open_session(config.zenoh), config)
    link.close()


def test_a_scene_is_as_large_as_the_document_says() -> None:
    def size(circles: int = 0, regions: int = 0, objects: int = 0) -> int:
        rows, psi = np.zeros(circles, CIRCLE), np.zeros(regions, PSI_REGION)
        scene = Scene(1, 1, 640, 480, 1.0, rows, psi, objects=np.zeros(objects, OBJECT))
        return len(encode_scene(scene, Publish().frame_id))

    (figures,) = re.findall(
        r"A scene has (\d+) bytes, plus (\d+) for each circle, (\d+) for each ψ region and (\d+) for each object",
        DOCUMENT,
    )
    more = [size(**{table: 1}) - size() for table in ("circles", "regions", "objects")]
    assert [size(), *more] == [*map(int, figures)]
