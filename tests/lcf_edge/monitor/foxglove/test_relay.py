"""A client that speaks Foxglove's protocol reads what a daemon publishes, by the definitions that it is given."""

import asyncio
import json
import resource
import signal
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import aiohttp
import pytest
import zenoh
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lcf_edge.cdr import encode_compressed_image
from lcf_edge.cli.command_line import main
from lcf_edge.config import Zenoh
from lcf_edge.zenoh_link import opened_session

PATIENCE_S = 20.0
MESSAGE_DATA = 1


@pytest.fixture
def address(rover: Any) -> Iterator[str]:
    """Of a relay for the rover, which ends in good order."""
    command = (sys.executable, "-m", "lcf_edge", "foxglove", "--port", "0", "--connect", rover.endpoint)
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout
        yield next(word for word in process.stdout.readline().split() if word.startswith("ws://"))
        process.send_signal(signal.SIGTERM)
        _, said = process.communicate(timeout=PATIENCE_S)
        assert (process.returncode, said) == (0, "")


async def channels_of(socket: aiohttp.ClientWebSocketResponse) -> dict[str, dict[str, Any]]:
    """What the server advertises, by topic."""
    info = json.loads(await socket.receive_str())
    assert (info["op"], info["capabilities"]) == ("serverInfo", [])  # nothing can be sent to it
    channels: dict[str, dict[str, Any]] = {}
    while len(channels) < 11:
        message = json.loads(await socket.receive_str())
        if message["op"] == "advertise":
            channels |= {channel["topic"]: channel for channel in message["channels"]}
    return channels


def received(address: str, topic: str) -> Any:
    """The first message of a topic."""

    async def talk() -> Any:
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(address, protocols=["foxglove.sdk.v1"], max_msg_size=0) as socket,
        ):
            channel = (await channels_of(socket))[topic]
            assert channel["encoding"] == "cdr"
            wanted = {"op": "subscribe", "subscriptions": [{"id": 7, "channelId": channel["id"]}]}
            await socket.send_str(json.dumps(wanted))
            while True:
                message = await socket.receive()
                if message.type == aiohttp.WSMsgType.BINARY and message.data[0] == MESSAGE_DATA:
                    return channel, message.data

    channel, data = asyncio.run(asyncio.wait_for(talk(), PATIENCE_S))
    subscription, log_time_ns = struct.unpack_from("<IQ", data, 1)
    assert subscription == 7
    assert abs(log_time_ns - time.time_ns()) < PATIENCE_S * 1e9
    ros = get_typestore(Stores.EMPTY)
    ros.register(get_types_from_msg(channel["schema"], channel["schemaName"]))
    return ros.deserialize_cdr(data[13:], channel["schemaName"])


def test_scenes_and_what_is_drawn_of_them_arrive(address: str) -> None:
    assert received(address, "/lcf/scene").circles[3].ttc == 1.25
    texts = [text.text for text in received(address, "/lcf/annotations").texts]
    assert "cutting in" in texts


def test_previews_are_drawn_only_while_a_client_looks(address: str, rover: Any) -> None:
    rover.wait_for(lambda: rover.seq > 3)
    assert rover.previews == 0
    assert received(address, "/lcf/preview/compressed").format == "jpeg"
    rover.wait_for(lambda: rover.unseen > 10)  # frames since one was wanted


def test_diagnostics_arrive(address: str, rover: Any) -> None:
    statuses = received(address, "/lcf/diagnostics").status
    assert [status.name for status in statuses] == [one.name for one in rover.status]


def resident_mib(process: int) -> float:
    return int(Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1]) * resource.getpagesize() / 2**20


def test_clients_that_take_nothing_do_not_fill_its_memory(endpoint: str) -> None:
    command = (sys.executable, "-m", "lcf_edge", "foxglove", "--port", "0", "--connect", endpoint)
    with (
        opened_session(Zenoh(listen=[endpoint])) as session,
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process,
    ):
        assert process.stdout
        address = next(word for word in process.stdout.readline().split() if word.startswith("ws://"))
        publisher = session.declare_publisher(
            "lcf/preview/compressed", congestion_control=zenoh.CongestionControl.BLOCK
        )
        wanted_by_somebody = threading.Event()
        listener = publisher.declare_matching_listener(lambda _: wanted_by_somebody.set())
        preview = encode_compressed_image(1, "camera", "jpeg", bytes(100_000))

        async def look_away() -> float:
            async with aiohttp.ClientSession() as client:
                deaf = [await client.ws_connect(address, protocols=["foxglove.sdk.v1"]) for _ in range(4)]
                for socket in deaf:
                    channel = (await channels_of(socket))["/lcf/preview/compressed"]
                    wanted = {"op": "subscribe", "subscriptions": [{"id": 7, "channelId": channel["id"]}]}
                    await socket.send_str(json.dumps(wanted))
                assert await asyncio.to_thread(wanted_by_somebody.wait, PATIENCE_S)
                before_mib = resident_mib(process.pid)
                await asyncio.to_thread(lambda: [publisher.put(preview) for _ in range(1500)])
                return resident_mib(process.pid) - before_mib

        try:
            grown_mib = asyncio.run(asyncio.wait_for(look_away(), 60.0))
        finally:
            listener.undeclare()  # type: ignore[no-untyped-call]
            process.send_signal(signal.SIGTERM)
        assert grown_mib < 60.0  # 4 clients, 64 images each: 24 MiB; what was sent is 143 MiB
        assert process.wait(PATIENCE_S) == 0


def test_nonsense_of_clients_is_not_written_down(address: str) -> None:
    async def talk() -> None:
        async with aiohttp.ClientSession() as session:
            for text in ("", "{", '{"op": 1}', "[" * 10_000):
                async with session.ws_connect(address, protocols=["foxglove.sdk.v1"]) as socket:
                    await socket.send_str(text)
                    await socket.send_bytes(text.encode() + b"\x07")
                    await channels_of(socket)

    asyncio.run(asyncio.wait_for(talk(), PATIENCE_S))  # `address` wants its end in silence


@pytest.mark.parametrize(
    ("arguments", "message"),
    [(("--prefix", "a//b"), "name another prefix"), (("--connect", "nowhere"), "nowhere")],
)
def test_an_address_that_is_none_is_reported_in_one_line(
    capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], message: str
) -> None:
    assert main(["foxglove", "--port", "0", *arguments]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line


def test_a_port_that_is_taken_is_reported(capsys: pytest.CaptureFixture[str], address: str) -> None:
    port = address.rpartition(":")[2]
    assert main(["foxglove", "--port", port]) == 1
    assert "--port" in capsys.readouterr().err
